"""A rigid body from a mesh file."""

from dataclasses import dataclass
from os import PathLike

import numpy as np
import warp as wp

from ..geometry.repair import Repair
from ..geometry.surface import read_surface
from ..geometry.union import united
from .shapes import Numbers, Shape, Solid, Triangles

# Rounding of single precision, in which Warp's meshes are searched.
ROUNDING = float(np.finfo(np.float32).eps)


@wp.func
def mesh_distance(p: wp.vec3d, numbers: Numbers, triangles: Triangles) -> wp.vec4d:
    """From the nearest place, which is found in single precision and reckoned in double."""
    place = wp.vec3f(wp.float32(p[0]), wp.float32(p[1]), wp.float32(p[2]))
    found = wp.mesh_query_point_sign_normal(triangles.mesh, place, wp.float32(1.0e30))
    a = triangles.points[triangles.corners[3 * found.face]]
    b = triangles.points[triangles.corners[3 * found.face + 1]]
    c = triangles.points[triangles.corners[3 * found.face + 2]]
    n = wp.normalize(wp.cross(b - a, c - a))
    u, v = wp.float64(found.u), wp.float64(found.v)
    w = wp.float64(1.0) - u - v
    distance = wp.dot(n, p - a)
    little = wp.float64(wp.static(8.0 * ROUNDING))
    if wp.min(u, wp.min(v, w)) <= little:  # at an edge or a corner
        away = p - (u * a + v * b + w * c)
        length = wp.length(away)
        if length > little * numbers[0]:
            distance = wp.float64(found.sign) * length
            n = away / distance
    return wp.vec4d(n[0], n[1], n[2], distance)


@dataclass(frozen=True)
class TriangleMesh(Shape):
    """What a closed surface encloses, 3-D; its origin is the file's.

    The nearest triangle is found in single precision, the distance from it is in double.

    Args:
        file: any mesh that ``geometry.mesh`` reads.
        scale: length of the file's unit [m], 1e-3 for millimetres.
        repair: what may be mended where the surface is not closed, as in ``geometry.mesh``.

    Raises:
        ModuleNotFoundError, OSError, ValueError: when the simulation is built, as ``geometry.mesh``.
    """

    file: str | PathLike
    scale: float = 1.0
    repair: Repair = Repair()
    distance = mesh_distance

    def solid(self, dim: int, device: wp.DeviceLike) -> Solid:
        who = f"TriangleMesh {self.file}"
        if dim != 3:
            raise ValueError(f"{who}: is for 3-D, got bodies in {dim}-D")
        surface = read_surface(self.file, self.scale, self.repair)
        surface = surface if surface.volume > 0.0 else surface.turned()
        if not self.repair.take:
            surface.check_closed(who)
            surface = united(surface, who)
        volume, centre, inertia, axes = mass_properties(surface.points[surface.triangles])
        points = (surface.points - centre) @ axes
        corners = wp.array(surface.triangles.ravel(), dtype=wp.int32, device=device)
        mesh = wp.Mesh(wp.array(points, dtype=wp.vec3f, device=device), corners)
        triangles = Triangles()
        triangles.mesh, triangles.corners = mesh.id, corners
        triangles.points = wp.array(points, dtype=wp.vec3d, device=device)
        size = float(np.linalg.norm(np.ptp(points, axis=0)))
        return Solid(centre, axes, volume, inertia, [size], triangles, mesh)


def mass_properties(corners: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Volume, centre, principal moments over mass and principal axes of what triangles (m, 3, 3) enclose.

    By tetrahedra from a point to each triangle, of which ∫ x⊗x has a closed form.
    """
    origin = corners.reshape(-1, 3).mean(axis=0)
    tips = corners - origin
    volumes = np.einsum("mi,mi->m", tips[:, 0], np.cross(tips[:, 1], tips[:, 2])) / 6.0
    volume, sums = float(volumes.sum()), tips.sum(axis=1)
    centre = volumes @ sums / (4.0 * volume)
    second = np.einsum("m,mi,mj->ij", volumes, sums, sums) + np.einsum("m,mki,mkj->ij", volumes, tips, tips)
    second = second / (20.0 * volume) - np.outer(centre, centre)
    moments, axes = np.linalg.eigh(np.trace(second) * np.eye(3) - second)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    return volume, origin + centre, moments, axes
