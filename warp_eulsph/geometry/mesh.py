"""Bodies and regions from mesh files."""

from dataclasses import dataclass
from os import PathLike

import numpy as np

from .filling import Filling, Lattice
from .outline import read_outline
from .relaxation import Relaxation
from .repair import Repair
from .solid import Solid
from .surface import read_surface
from .union import united


def mesh(
    file: str | PathLike,
    spacing: float,
    *,
    scale: float = 1.0,
    filling: Filling = Lattice(),
    relaxation: Relaxation | None = None,
    repair: Repair = Repair(),
) -> tuple[np.ndarray, np.ndarray]:
    """Particles inside a closed surface, 3-D.

    Inside is what any closed piece of the surface encloses: pieces that lie in each other are united, and what is in
    two of them counts once. A piece that faces inwards is a hollow of the smallest piece around it.

    Args:
        file: any mesh that meshio or trimesh reads: STL, OBJ, PLY, VTK, VTU, gmsh; a surface, or solid elements.
        spacing: wanted spacing [m], the cube root of a particle's volume.
        scale: length of the file's unit [m], 1e-3 for millimetres.
        filling: Lattice(), BodyCentred() or Staggered(), cut to the shape.
        relaxation: Relaxation() to make them even and fit the surface; None leaves the cut filling.
        repair: what may be mended where the surface is not closed: Repair(weld=…, close=…, turn=…), or that it
            is to be taken as it is, Repair(take=True).

    Returns:
        Positions [m], (n, 3), and volumes [m³], (n,), all equal, whose sum is the volume that the mesh encloses.

    Raises:
        ModuleNotFoundError: meshio is not installed, or manifold3d where pieces meet or are to be closed.
        OSError: no such file.
        ValueError: not a mesh, an open surface, one that passes through itself, nothing inside, or a spacing too
            coarse.
    """
    surface = read_surface(file, scale, repair)
    who = f"mesh {file}"
    if repair.take:
        surface = surface if surface.volume > 0.0 else surface.turned()
        solid = Solid(*surface.extent, None, surface.query(winding=0.5), surface.query(winding=None))
        return solid.fill(spacing, filling, relaxation, who)
    surface.check_closed(who)
    if not abs(surface.volume) > 1e-9 * np.prod(np.ptp(surface.extent, axis=0)):
        raise ValueError(f"{who}: the surface must enclose a volume, got {surface.volume:.6g} m^3")
    surface = united(surface, who)
    solid = Solid(*surface.extent, surface.volume, surface.query(winding=0.5), surface.query(winding=None))
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
            if self.name is not None:
                surface = surface.part(self.name)
            elif not len(surface.open_edges()):
                surface = united(surface, f"mesh {self.file}")  # without what lies within matter
            distance = surface.query(winding=None)
        return distance(X)[0] <= self.depth
