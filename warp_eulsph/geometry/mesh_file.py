"""Mesh files read by meshio: corners in metres, cells, and the groups that they belong to."""

import contextlib
import io
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Integral
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..checks import real_number

# Where meshio keeps the number of a cell's group, by format.
GROUP_KEYS = ("gmsh:physical", "medit:ref", "cell_tags", "obj:group_ids", "patch")


@dataclass(frozen=True)
class MeshFile:
    """What a file holds.

    Attributes:
        points: corners [m], (k, 3).
        cells: kind (``triangle``, ``line`` …) -> numbers of their corners, (m, …).
        groups: kind -> number of the group of each cell, (m,), −1 without one.
        names: dimension and number of a group -> its name; files number groups of each dimension by themselves.
    """

    points: np.ndarray
    cells: dict[str, np.ndarray]
    groups: dict[str, np.ndarray]
    names: dict[tuple[int, int], str]

    def patch(self, group: int, dimension: int) -> str:
        """Name of a group of elements of this dimension, its number where it has none."""
        return self.names.get((dimension, int(group)), str(int(group)))


def read_mesh(path: str | PathLike, scale: float = 1.0) -> MeshFile:
    """A file that meshio reads (STL, OBJ, PLY, VTK, VTU, gmsh and others).

    Args:
        path: the file.
        scale: length of the file's unit [m], 1e-3 for millimetres.

    Raises:
        ModuleNotFoundError: meshio is not installed.
        OSError: no such file.
        ValueError: a file that meshio cannot read, or corners that are not finite.
    """
    try:
        import meshio
    except ModuleNotFoundError:
        raise ModuleNotFoundError("reading meshes needs meshio: pip install 'warp_eulsph[mesh]'") from None
    if not Path(path).is_file():
        raise FileNotFoundError(f"mesh file not found: {path}")
    if not (np.isfinite(real_number(scale, "scale")) and scale > 0.0):
        raise ValueError(f"scale must be positive and finite, got {scale}; 1e-3 is a file in millimetres")
    try:
        mesh = _quietly(meshio.read, path)
    except (Exception, SystemExit) as error:  # meshio raises whatever its readers stumble over, and may exit
        other = _by_trimesh(path, scale) or _by_pyvista(path, scale)
        if other is not None:
            return other
        raise ValueError(
            f"{path}: not a mesh that meshio reads ({type(error).__name__}: {error}); convert it, by "
            "gmsh or ParaView for example, to STL, VTU or MSH"
        ) from error
    if not len(mesh.points) or not any(len(block.data) for block in mesh.cells):
        raise ValueError(f"{path}: a mesh must have corners and cells, got {len(mesh.points)} corners and no cells")
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = scale * mesh.points
    if not np.isfinite(points).all():
        raise ValueError(f"{path}: corners of a mesh must be finite")
    key = next((key for key in GROUP_KEYS if key in mesh.cell_data), "")
    cells: dict[str, list[np.ndarray]] = {}
    groups: dict[str, list[np.ndarray]] = {}
    for k, block in enumerate(mesh.cells):
        number = np.asarray(mesh.cell_data[key][k]).astype(int).reshape(-1) if key else np.full(len(block.data), -1)
        cells.setdefault(block.type, []).append(np.asarray(block.data))
        groups.setdefault(block.type, []).append(number)
    return MeshFile(
        points,
        {kind: np.concatenate(blocks) for kind, blocks in cells.items()},
        {kind: np.concatenate(blocks) for kind, blocks in groups.items()},
        _names(mesh.field_data),
    )


def _names(field_data: dict[str, Any]) -> dict[tuple[int, int], str]:
    """Names of groups; those of files that tell no dimension count for lines and surfaces."""
    found = {}
    for name, given in field_data.items():
        if not all(isinstance(number, Integral) for number in np.ravel(np.array(given, dtype=object))):
            continue  # not what gmsh and others keep there
        tag, *dimension = np.ravel(given).tolist()
        for of in dimension[:1] or (1, 2):
            found[int(of), int(tag)] = name
    return found


def _by_trimesh(path: str | PathLike, scale: float) -> MeshFile | None:
    """What trimesh makes of a file that meshio cannot read: triangles without groups; None if it cannot either."""
    try:
        import trimesh

        mesh = _quietly(trimesh.load_mesh, path, process=False)
        points, triangles = scale * np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=int)
    except (Exception, SystemExit):  # as meshio it raises what its readers stumble over, and it may not be installed
        return None
    if not len(triangles) or points.shape[1:] != (3,) or not np.isfinite(points).all():
        return None
    return MeshFile(points, {"triangle": triangles}, {"triangle": np.full(len(triangles), -1)}, {})


def _by_pyvista(path: str | PathLike, scale: float) -> MeshFile | None:
    """The same by PyVista, which reads what newer versions of VTK write: the outer surface of solid elements."""
    try:
        import pyvista

        read = _quietly(pyvista.read, path)
        surface = _quietly(lambda: read.extract_surface().triangulate())
        points, triangles = scale * np.asarray(surface.points, dtype=float), surface.faces.reshape(-1, 4)[:, 1:]
    except (Exception, SystemExit):
        return None
    if not len(triangles) or not np.isfinite(points).all():
        return None
    return MeshFile(points, {"triangle": np.array(triangles)}, {"triangle": np.full(len(triangles), -1)}, {})


def _quietly(read: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """What a reader returns, without what it prints and warns."""
    heard = io.StringIO()
    with (
        contextlib.redirect_stdout(heard),
        contextlib.redirect_stderr(heard),
        warnings.catch_warnings(),
        np.errstate(all="ignore"),
    ):
        warnings.simplefilter("ignore")
        return read(*arguments, **options)
