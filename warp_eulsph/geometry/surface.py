"""Closed triangle surfaces read from mesh files, and the distance to them."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike

import numpy as np
import warp as wp

from ..execution import Launcher
from .faces import SURFACES, components, outer_triangles, surface_triangles, weld
from .mesh_file import MeshFile, read_mesh
from .repair import Repair, closed, edges_of, turned_alike

# Corners nearer than this share of the size of a file are one where a surface is not closed otherwise: CAD programs
# write each facet by itself, rounded to single precision.
WELD = 1e-6
# Points at which a surface is asked whether it encloses anything twice, and how far they lie from it, in its size.
_ASKED, _AWAY = 4096, 1e-4


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
    def extent(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner of the box around it [m], (3,) each."""
        corners = self.points[self.triangles].reshape(-1, 3)
        return corners.min(axis=0), corners.max(axis=0)

    @property
    def _centre(self) -> np.ndarray:
        """Of the box [m], (3,); points that no triangle has may be anywhere."""
        lower, upper = self.extent
        return 0.5 * (lower + upper)

    @property
    def area(self) -> float:
        """[m²]."""
        return float(np.linalg.norm(self._doubled_areas(), axis=1).sum()) / 2.0

    def _doubled_areas(self) -> np.ndarray:
        """Normals as long as twice the area of each triangle [m²], (m, 3)."""
        a, b, c = self.points[self.triangles].transpose(1, 0, 2)
        return np.cross(b - a, c - a)

    @property
    def volume(self) -> float:
        """Volume inside [m³], by the divergence theorem; negative when the triangles face inwards."""
        corners = self.points[self.triangles] - self._centre
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
        edges = edges_of(self.triangles)
        return edges.ends[edges.balance != 0]

    def check_closed(self, who: str) -> None:
        """Raise ValueError unless as many triangles turn one way along every edge as the other."""
        edges = edges_of(self.triangles)
        wrong = edges.ends[edges.balance != 0]
        if not len(wrong):
            return
        loose = int((edges.times % 2 == 1)[edges.balance != 0].sum())
        remedies = ["repair=Repair(close=True)"] if loose else []
        remedies += ["repair=Repair(turn=True)"] if loose < len(wrong) else []
        raise ValueError(
            f"{who}: the surface must be closed and its triangles turn the same way, got {len(wrong)} edges that do "
            f"not border two such triangles, {loose} of them at an opening, the first at "
            f"{self.points[wrong[0, 0]]} m; mend it by {' and '.join(remedies)}, where corners miss each other by "
            "repair=Repair(weld=...), or in a mesh tool; repair=Repair(take=True) takes it as it is"
        )

    def check_simple(self, who: str) -> None:
        """Raise ValueError where a closed surface, facing outwards, encloses a place twice or inside out.

        Looked for beside the triangles, at random places that are the same each time.
        """
        normals = self._doubled_areas()
        sizes = np.linalg.norm(normals, axis=1)
        rng = np.random.default_rng(0)
        chosen = rng.choice(len(sizes), _ASKED, p=sizes / sizes.sum())
        shares = rng.dirichlet(np.ones(3), _ASKED)
        places = np.einsum("ki,kid->kd", shares, self.points[self.triangles[chosen]])
        away = _AWAY * float(np.ptp(self.extent, axis=0).max()) * normals[chosen] / sizes[chosen, None]
        x = np.concatenate([places + away, places - away])
        wrong = (self.query(winding=1.5)(x)[0] > 0.0) | (self.query(winding=-0.5)(x)[0] < 0.0)
        if wrong.any():
            raise ValueError(
                f"{who}: the surface of a mesh must not pass through itself, nor face inwards where there is no matter "
                f"around, got one that does at {x[wrong][0]} m; mend it in a mesh tool, or take it as it is by "
                "repair=Repair(take=True)"
            )

    def turned(self) -> "Surface":
        """Facing the other way."""
        return Surface(self.points, self.triangles[:, ::-1], self.patches)

    def parts(self) -> list["Surface"]:
        """The pieces that hang together by edges."""
        of = components([edges_of(self.triangles).of])
        return [Surface(self.points, self.triangles[of == label], {}) for label in np.unique(of)]

    def part(self, patch: str) -> "Surface":
        """The triangles of a patch.

        Raises:
            ValueError: no such patch.
        """
        if patch not in self.patches:
            raise ValueError(f"patch of the mesh must be one of {sorted(self.patches)}, got {patch!r}")
        return Surface(self.points, self.patches[patch], {})

    def query(self, winding: float | None) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Function of positions [m], (k, 3) -> distance [m], (k,), and unit vectors along which it grows, (k, 3).

        With ``winding``, ½ for what is inside, the distance is negative where the winding number is less; such a
        surface must be closed. In single precision, that of Warp's meshes, about the surface's centre.
        """
        centre = self._centre
        mesh = wp.Mesh(
            points=wp.array((self.points - centre).astype(np.float32), dtype=wp.vec3, device="cpu"),
            indices=wp.array(self.triangles.astype(np.int32).ravel(), dtype=wp.int32, device="cpu"),
            support_winding_number=winding is not None,
        )
        reach = float(np.linalg.norm(np.ptp(self.extent, axis=0)))

        def distance(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            places = wp.array((x - centre).astype(np.float32), dtype=wp.vec3, device="cpu")
            closest, signs = wp.zeros_like(places), wp.zeros(len(x), dtype=wp.float32, device="cpu")
            far = reach + float(np.linalg.norm(x - centre, axis=1).max(initial=0.0))
            arguments = [mesh.id, places, far, 0.0 if winding is None else winding, closest, signs]
            Launcher("cpu")(_make_query(winding is not None), len(x), arguments)
            away = x - centre - closest.numpy()
            length = np.linalg.norm(away, axis=1)
            unit = np.divide(away, length[:, None], out=np.zeros_like(away), where=length[:, None] > 0.0)
            sign = signs.numpy().astype(float)
            return sign * length, sign[:, None] * unit

        return distance


@functools.cache
def _make_query(winding: bool) -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False)
    def query(
        first: int,
        mesh: wp.uint64,
        x: wp.array(dtype=wp.vec3),
        far: wp.float32,
        threshold: wp.float32,
        closest: wp.array(dtype=wp.vec3),
        signs: wp.array(dtype=wp.float32),
    ):
        a = first + wp.tid()
        if wp.static(winding):
            found = wp.mesh_query_point_sign_winding_number(mesh, x[a], far, 2.0, threshold)
            closest[a] = wp.mesh_eval_position(mesh, found.face, found.u, found.v)
            signs[a] = -found.sign  # Warp's is negative inside
        else:
            near = wp.mesh_query_point_no_sign(mesh, x[a], far)
            closest[a] = wp.mesh_eval_position(mesh, near.face, near.u, near.v)
            signs[a] = 1.0

    return query


def read_surface(path: str | PathLike, scale: float = 1.0, repair: Repair = Repair()) -> Surface:
    """The surface of a mesh file: the outer faces of its solid elements, or else its surface elements.

    Quadrangles are cut in two, elements of second order at their midside nodes. Corners that are one to the last bit
    are one; where the surface is not closed so or in parts, those nearer than 1e-6 of its size, or as ``repair`` says.

    Args:
        path: the file.
        scale: length of the file's unit [m], 1e-3 for millimetres.
        repair: what is mended.

    Raises:
        ModuleNotFoundError, OSError: as ``read_mesh``.
        ValueError: as ``read_mesh``, without elements that have a surface, or what cannot be mended.
    """
    file = read_mesh(path, scale)
    groups = _groups(file)
    outer = outer_triangles(file.points, file.cells)
    triangles = outer if len(outer) else np.concatenate([np.zeros((0, 3), dtype=int), *groups.values()])
    if not len(triangles):
        kinds = sorted(file.cells)
        raise ValueError(f"{path}: a mesh must have triangles, quadrangles or tetrahedra, got cells {kinds}")
    surface = _joined(file.points, triangles, groups, repair.weld)
    if not len(surface.triangles):
        raise ValueError(f"{path}: a mesh must have triangles with an area, got {len(triangles)} without")
    kept, who = surface.triangles, f"mesh {path}"
    if repair.turn:
        kept = turned_alike(surface.points, kept, who)
    if repair.close:
        kept = closed(surface.points, kept, who)
    return Surface(surface.points, kept, surface.patches)


def _joined(file: np.ndarray, triangles: np.ndarray, groups: dict[str, np.ndarray], tolerance: float | None) -> Surface:
    """The surface of these corners, each once, as files of single facets (STL) repeat them."""
    points, places = np.unique(file, axis=0, return_inverse=True)
    surface = _welded(points, places.reshape(-1), triangles, groups)
    if tolerance == 0.0 or (tolerance is None and not len(surface.open_edges()) and len(surface.parts()) == 1):
        return surface
    used = points[np.unique(places.reshape(-1)[triangles])]
    same = weld(points, WELD * float(np.ptp(used, axis=0).max()) if tolerance is None else tolerance)
    first = np.unique(same, return_index=True)[1]
    near = _welded(points[first], same[places.reshape(-1)], triangles, groups)
    better = len(near.triangles) and len(near.open_edges()) <= len(surface.open_edges())
    return near if better or tolerance is not None else surface


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
