"""Mesh files read by meshio: corners in metres, cells, and the groups that they belong to."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

# Where meshio keeps the number of a cell's group, by format.
GROUP_KEYS = ("gmsh:physical", "medit:ref", "cell_tags", "obj:group_ids", "patch")


@dataclass(frozen=True)
class MeshFile:
    """What a file holds.

    Attributes:
        points: corners [m], (k, 3).
        cells: kind (``triangle``, ``line`` …) -> numbers of their corners, (m, …).
        groups: kind -> number of the group of each cell, (m,), −1 without one.
        names: number of a group -> its name.
    """

    points: np.ndarray
    cells: dict[str, np.ndarray]
    groups: dict[str, np.ndarray]
    names: dict[int, str]

    def patch(self, group: int) -> str:
        """Name of a group, its number where it has none."""
        return self.names.get(int(group), str(int(group)))


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
    if not (np.isfinite(scale) and scale > 0.0):
        raise ValueError(f"scale must be positive and finite, got {scale}; 1e-3 is a file in millimetres")
    try:
        mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio raises whatever its readers stumble over, and may exit
        raise ValueError(f"{path}: not a mesh that meshio reads ({type(error).__name__}: {error})") from error
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
        {int(tag): name for name, (tag, *_) in mesh.field_data.items()},
    )
