"""Closed triangle surfaces read from mesh files, and the distance to them."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
import warp as wp

from ..execution import Launcher
from .mesh_file import MeshFile, read_mesh

# Faces of a tetrahedron, outwards for one of positive volume.
TETRA_FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


@dataclass(frozen=True)
class Surface:
    """Triangles.

    Attributes:
        points: corners [m], (k, 3), each once.
        triangles: numbers of their corners, (m, 3).
        patches: name -> which triangles belong to it, (m,) bool; the numbered or named groups of the file.
    """

    points: np.ndarray
    triangles: np.ndarray
    patches: dict[str, np.ndarray]

    @property
    def volume(self) -> float:
        """Volume inside [m³], by the divergence theorem; negative when the triangles face inwards."""
        corners = (self.points - self.points.mean(axis=0))[self.triangles]
        return float(np.einsum("mi,mi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))) / 6.0

    def check_closed(self, who: str) -> None:
        """Raise ValueError unless every edge borders two triangles that turn the same way."""
        edges = self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        there, there_times = np.unique(edges, axis=0, return_counts=True)
        both = np.concatenate([there, there[:, ::-1]])
        _, times = np.unique(both, axis=0, return_counts=True)
        unmatched = int((times == 1).sum()) // 2 + int((there_times > 1).sum())
        if unmatched:
            back = {tuple(edge) for edge in there[:, ::-1].tolist()}
            lone = [edge for edge in there.tolist() if tuple(edge) not in back]
            where = "" if not lone else f", the first at {self.points[lone[0][0]]} m"
            raise ValueError(
                f"{who}: the surface must be closed and its triangles turn the same way, got {unmatched} edges that "
                f"do not border two such triangles{where}; close holes and unify normals in a mesh tool"
            )

    def part(self, patch: str) -> "Surface":
        """The triangles of a patch.

        Raises:
            ValueError: no such patch.
        """
        if patch not in self.patches:
            raise ValueError(f"patch of the mesh must be one of {sorted(self.patches)}, got {patch!r}")
        return Surface(self.points, self.triangles[self.patches[patch]], {})

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
    """The triangles of a mesh file that meshio reads.

    Quadrangles are cut in two; of tetrahedra the outer faces are taken, unless the file has surface elements.

    Args:
        path: the file.
        scale: length of the file's unit [m], 1e-3 for millimetres.

    Raises:
        ModuleNotFoundError, OSError: as ``read_mesh``.
        ValueError: as ``read_mesh``, or without triangles, quadrangles or tetrahedra.
    """
    file = read_mesh(path, scale)
    triangles, numbers = _triangles(file)
    if not len(triangles):
        kinds = sorted(file.cells)
        raise ValueError(f"{path}: a mesh must have triangles, quadrangles or tetrahedra, got cells {kinds}")
    # Each corner once, as files of single facets (STL) repeat them.
    points, places = np.unique(file.points, axis=0, return_inverse=True)
    triangles = places.reshape(-1)[triangles]
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    patches = {file.patch(k): numbers[whole] == k for k in np.unique(numbers) if k >= 0}
    return Surface(points, triangles[whole], patches)


def _triangles(file: MeshFile) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (m, 3) and the number of the group of each, (m,)."""
    faces, numbers = [np.zeros((0, 3), dtype=int)], [np.zeros(0, dtype=int)]
    if "triangle" in file.cells:
        faces.append(file.cells["triangle"])
        numbers.append(file.groups["triangle"])
    if "quad" in file.cells:
        faces.append(file.cells["quad"][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3))
        numbers.append(np.repeat(file.groups["quad"], 2))
    if len(faces) == 1 and "tetra" in file.cells:
        faces.append(_outer_faces(file.points, file.cells["tetra"]))
        numbers.append(np.full(len(faces[-1]), -1))
    return np.concatenate(faces), np.concatenate(numbers)


def _outer_faces(points: np.ndarray, tetrahedra: np.ndarray) -> np.ndarray:
    """Faces that belong to one tetrahedron only, outwards."""
    edges = points[tetrahedra[:, 1:]] - points[tetrahedra[:, :1]]
    turned = np.einsum("mi,mi->m", edges[:, 0], np.cross(edges[:, 1], edges[:, 2])) < 0.0
    tetrahedra = np.where(turned[:, None], tetrahedra[:, [0, 2, 1, 3]], tetrahedra)
    faces = tetrahedra[:, TETRA_FACES].reshape(-1, 3)
    _, first, times = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[first[times == 1]]
