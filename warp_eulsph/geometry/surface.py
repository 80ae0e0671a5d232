"""Closed triangle surfaces read from mesh files, and the distance to them."""

import functools
import itertools
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
import warp as wp

from ..execution import Launcher
from .faces import SURFACES, outer_triangles, surface_triangles, weld
from .mesh_file import MeshFile, read_mesh

# Corners nearer than this share of the size of a file are one where a surface is not closed otherwise: CAD programs
# write each facet by itself, rounded to single precision.
WELD = 1e-6
# Points at which closed surfaces are asked whether they lie in each other.
_ASKED = 4096


@dataclass(frozen=True)
class Surface:
    """Triangles.

    Attributes:
        points: corners [m], (k, 3), each once.
        triangles: numbers of their corners, (m, 3).
        patches: name -> corners of the triangles of it, (l, 3); the numbered or named groups of the file.
    """

    points: np.ndarray
    triangles: np.ndarray
    patches: dict[str, np.ndarray]

    @property
    def volume(self) -> float:
        """Volume inside [m³], by the divergence theorem; negative when the triangles face inwards."""
        corners = (self.points - self.points.mean(axis=0))[self.triangles]
        return float(np.einsum("mi,mi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))) / 6.0

    def simplified(self) -> "Surface":
        """Without what repeats: a triangle that is there twice, and two that are each other's back.

        Two solids that share a face become one.
        """
        low = np.argmin(self.triangles, axis=1)
        turned = np.take_along_axis(self.triangles, (low[:, None] + np.arange(3)) % 3, axis=1)  # the same sense
        kept = np.sort(np.unique(turned, axis=0, return_index=True)[1])
        once = self.triangles[kept]
        _, group, times = np.unique(np.sort(once, axis=1), axis=0, return_inverse=True, return_counts=True)
        return Surface(self.points, once[times[group.reshape(-1)] == 1], self.patches)

    def open_edges(self) -> np.ndarray:
        """Edges, (k, 2), along which not as many triangles turn one way as the other; none of a closed surface."""
        edges = self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        ways = np.where(edges[:, 0] < edges[:, 1], 1, -1)
        distinct, place = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
        return distinct[np.bincount(place.reshape(-1), ways, len(distinct)) != 0.0]

    def check_closed(self, who: str) -> None:
        """Raise ValueError unless as many triangles turn one way along every edge as the other."""
        edges = self.open_edges()
        if len(edges):
            raise ValueError(
                f"{who}: the surface must be closed and its triangles turn the same way, got {len(edges)} edges that "
                f"do not border two such triangles, the first at {self.points[edges[0, 0]]} m; close holes and unify "
                "normals in a mesh tool"
            )

    def check_apart(self, who: str) -> None:
        """Raise ValueError where closed parts of the surface lie in each other and what is inside is not told by them.

        Looked for at points in the boxes that two parts have in common; a part that faces inwards is a hollow.
        """
        parts = self.parts()
        if len(parts) < 2:
            return
        corners = [part.points[part.triangles].reshape(-1, 3) for part in parts]
        boxes = [(places.min(axis=0), places.max(axis=0)) for places in corners]
        inward = np.sign([part.volume for part in parts]) != np.sign(self.volume)
        queries: dict[int, Any] = {}
        for i, j in itertools.combinations(range(len(parts)), 2):
            low, high = np.maximum(boxes[i][0], boxes[j][0]), np.minimum(boxes[i][1], boxes[j][1])
            if not (high - low > WELD * np.ptp(corners[i], axis=0).max()).all():
                continue
            x = np.random.default_rng(0).uniform(low, high, (_ASKED, 3))
            times = np.zeros(len(x))
            for k, (lower, upper) in enumerate(boxes):
                if (lower < high).all() and (upper > low).all():
                    turned = parts[k] if parts[k].volume > 0.0 else parts[k].turned()
                    query = queries.setdefault(k, turned.query(winding=True))
                    times += np.where(inward[k], -1.0, 1.0) * (query(x)[0] > 0.0)
            wrong = (times < -0.5) | (times > 1.5)
            if wrong.any():
                raise ValueError(
                    f"{who}: closed surfaces of a mesh must not lie in each other, got two that do at {x[wrong][0]} m; "
                    "unite them in a mesh tool, or turn the inner one to face inwards for a hollow"
                )

    def turned(self) -> "Surface":
        """Facing the other way."""
        return Surface(self.points, self.triangles[:, ::-1], self.patches)

    def parts(self) -> list["Surface"]:
        """The pieces that hang together by corners."""
        labels = np.arange(len(self.points))
        while True:
            least = labels.copy()
            for corner in range(3):
                np.minimum.at(least, self.triangles[:, corner], labels[self.triangles].min(axis=1))
            least = least[least]
            if np.array_equal(least, labels):
                break
            labels = least
        of = labels[self.triangles[:, 0]]
        return [Surface(self.points, self.triangles[of == label], {}) for label in np.unique(of)]

    def part(self, patch: str) -> "Surface":
        """The triangles of a patch.

        Raises:
            ValueError: no such patch.
        """
        if patch not in self.patches:
            raise ValueError(f"patch of the mesh must be one of {sorted(self.patches)}, got {patch!r}")
        return Surface(self.points, self.patches[patch], {})

    def query(self, winding: bool) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Function of positions [m], (k, 3) -> distance [m], (k,), and unit vectors along which it grows, (k, 3).

        With ``winding`` the distance is negative outside; such a surface must be closed. In single precision, that of
        Warp's meshes, about the surface's centre.
        """
        centre = 0.5 * (self.points.min(axis=0) + self.points.max(axis=0))
        mesh = wp.Mesh(
            points=wp.array((self.points - centre).astype(np.float32), dtype=wp.vec3, device="cpu"),
            indices=wp.array(self.triangles.astype(np.int32).ravel(), dtype=wp.int32, device="cpu"),
            support_winding_number=winding,
        )
        reach = float(np.linalg.norm(np.ptp(self.points, axis=0)))

        def distance(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            places = wp.array((x - centre).astype(np.float32), dtype=wp.vec3, device="cpu")
            closest, signs = wp.zeros_like(places), wp.zeros(len(x), dtype=wp.float32, device="cpu")
            far = reach + float(np.linalg.norm(x - centre, axis=1).max(initial=0.0))
            Launcher("cpu")(_make_query(winding), len(x), [mesh.id, places, far, closest, signs])
            away = x - centre - closest.numpy()
            length = np.linalg.norm(away, axis=1)
            unit = np.divide(away, length[:, None], out=np.zeros_like(away), where=length[:, None] > 0.0)
            sign = signs.numpy().astype(float)
            return sign * length, sign[:, None] * unit

        return distance


@functools.cache
def _make_query(winding: bool) -> Any:
    @wp.kernel(module="unique", enable_backward=False)
    def query(
        first: int,
        mesh: wp.uint64,
        x: wp.array(dtype=wp.vec3),
        far: wp.float32,
        closest: wp.array(dtype=wp.vec3),
        signs: wp.array(dtype=wp.float32),
    ):
        a = first + wp.tid()
        if wp.static(winding):
            found = wp.mesh_query_point_sign_winding_number(mesh, x[a], far)
            closest[a] = wp.mesh_eval_position(mesh, found.face, found.u, found.v)
            signs[a] = -found.sign  # Warp's is negative inside
        else:
            near = wp.mesh_query_point_no_sign(mesh, x[a], far)
            closest[a] = wp.mesh_eval_position(mesh, near.face, near.u, near.v)
            signs[a] = 1.0

    return query


def read_surface(path: str | PathLike, scale: float = 1.0) -> Surface:
    """The surface of a mesh file: the outer faces of its solid elements, or else its surface elements.

    Quadrangles are cut in two, elements of second order at their midside nodes. Corners that are one to the last bit
    are one; where the surface is not closed so or in parts, those nearer than 1e-6 of its size.

    Args:
        path: the file.
        scale: length of the file's unit [m], 1e-3 for millimetres.

    Raises:
        ModuleNotFoundError, OSError: as ``read_mesh``.
        ValueError: as ``read_mesh``, or without elements that have a surface.
    """
    file = read_mesh(path, scale)
    groups = _groups(file)
    outer = outer_triangles(file.points, file.cells)
    triangles = outer if len(outer) else np.concatenate([np.zeros((0, 3), dtype=int), *groups.values()])
    if not len(triangles):
        kinds = sorted(file.cells)
        raise ValueError(f"{path}: a mesh must have triangles, quadrangles or tetrahedra, got cells {kinds}")
    # Each corner once, as files of single facets (STL) repeat them.
    points, places = np.unique(file.points, axis=0, return_inverse=True)
    surface = _welded(points, places.reshape(-1), triangles, groups)
    if len(surface.open_edges()) or len(surface.parts()) > 1:
        used = points[np.unique(places.reshape(-1)[triangles])]
        same = weld(points, WELD * float(np.ptp(used, axis=0).max()))
        first = np.unique(same, return_index=True)[1]
        near = _welded(points[first], same[places.reshape(-1)], triangles, groups)
        if not len(near.open_edges()) and len(near.triangles):
            return near
    return surface


def _welded(points: np.ndarray, places: np.ndarray, triangles: np.ndarray, groups: dict[str, np.ndarray]) -> Surface:
    """The surface whose corners have these new numbers; triangles that lost their area so are left out."""

    def renumbered(those: np.ndarray) -> np.ndarray:
        those = places[those]
        return those[(those != np.roll(those, 1, axis=1)).all(axis=1)]

    patches = {name: renumbered(those) for name, those in groups.items() if name}
    return Surface(points, renumbered(triangles), patches).simplified()


def _groups(file: MeshFile) -> dict[str, np.ndarray]:
    """Triangles of the surface elements by the name of their group, (l, 3); without one by the empty name."""
    found: dict[str, list[np.ndarray]] = {}
    for kind in (kind for kind in file.cells if kind in SURFACES):
        triangles, of = surface_triangles(kind, file.cells[kind])
        numbers = file.groups[kind][of]
        for number in np.unique(numbers):
            name = file.patch(number, 2) if number >= 0 else ""
            found.setdefault(name, []).append(triangles[numbers == number])
    return {name: np.concatenate(listed) for name, listed in found.items()}
