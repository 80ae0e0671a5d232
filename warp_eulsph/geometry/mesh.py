"""Bodies and regions from mesh files."""

from dataclasses import dataclass
from os import PathLike

import numpy as np

from .filling import Filling, Lattice
from .outline import read_outline
from .relaxation import Relaxation
from .solid import Solid
from .surface import read_surface


def mesh(
    file: str | PathLike,
    spacing: float,
    *,
    scale: float = 1.0,
    filling: Filling = Lattice(),
    relaxation: Relaxation | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Particles inside a closed surface, 3-D.

    Inside is where the winding number says so, so that concave and nested surfaces are right.

    Args:
        file: any mesh that meshio or trimesh reads: STL, OBJ, PLY, VTK, VTU, gmsh; a surface, or solid elements.
        spacing: wanted spacing [m], the cube root of a particle's volume.
        scale: length of the file's unit [m], 1e-3 for millimetres.
        filling: Lattice(), BodyCentred() or Staggered(), cut to the shape.
        relaxation: Relaxation() to make them even and fit the surface; None leaves the cut filling.

    Returns:
        Positions [m], (n, 3), and volumes [m³], (n,), all equal, whose sum is the volume that the mesh encloses.

    Raises:
        ModuleNotFoundError: meshio is not installed.
        OSError: no such file.
        ValueError: not a mesh, an open surface, parts that lie in each other, nothing inside, or a spacing too coarse.
    """
    surface = read_surface(file, scale)
    who = f"mesh {file}"
    surface.check_closed(who)
    surface.check_apart(who)
    volume = surface.volume
    if volume < 0.0:  # all triangles face inwards
        surface, volume = surface.turned(), -volume
    corners = surface.points[surface.triangles].reshape(-1, 3)
    lower, upper = corners.min(axis=0), corners.max(axis=0)
    if not volume > 1e-9 * np.prod(upper - lower):
        raise ValueError(f"{who}: the surface must enclose a volume, got {volume:.6g} m^3")
    solid = Solid(lower, upper, volume, surface.query(winding=True), surface.query(winding=False))
    return solid.fill(spacing, filling, relaxation, who)


@dataclass(frozen=True)
class Patch:
    """A region for boundary conditions: particles near a mesh's surface, in 2-D its outline, or near one patch of it.

    Args:
        file: any mesh that meshio reads.
        depth: distance from the triangles, in 2-D from the lines, within which particles belong to the region [m].
        name: name or number of the patch in the file (gmsh physical group); None takes the whole surface.
        scale: length of the file's unit [m].

    Raises:
        ModuleNotFoundError, OSError, ValueError: when called, as ``mesh``; a patch that the file has not.
    """

    file: str | PathLike
    depth: float
    name: str | None = None
    scale: float = 1.0

    def __call__(self, X: np.ndarray) -> np.ndarray:
        """Which of the positions [m], (n, 2) or (n, 3), belong to the region, (n,) bool."""
        if X.shape[1] == 1:
            raise ValueError(f"a patch of a mesh needs particles in 2-D or 3-D, got positions of shape {X.shape}")
        if X.shape[1] == 2:
            lines = read_outline(self.file, self.scale)
            distance = (lines if self.name is None else lines.part(self.name)).query(inside=False)
        else:
            surface = read_surface(self.file, self.scale)
            distance = (surface if self.name is None else surface.part(self.name)).query(winding=False)
        return distance(X)[0] <= self.depth
