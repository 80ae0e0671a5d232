"""Shapes of rigid bodies: how far a place is from the surface, volume and moments of inertia."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from ..boundaries.base import unit_vector
from ..checks import positive, real_array, short

#: Numbers that a shape gives to its function of distance.
Numbers = wp.types.vector(length=6, dtype=wp.float64)


@wp.struct
class Triangles:
    """Triangles of a mesh: Warp's own for searches, in single precision, and the corners [m] in double precision."""

    mesh: wp.uint64
    points: wp.array(dtype=wp.vec3d)
    corners: wp.array(dtype=wp.int32)


class Solid(NamedTuple):
    """A shape in its own frame, whose axes are principal, in 3-D: what is missing in 1-D and 2-D is 0.

    Attributes:
        home: where its centre of mass lies as the user gave the shape [m], (3,).
        axes: principal axes as columns, (3, 3).
        volume: [m^dim]; inf where it ends nowhere.
        inertia: principal moments of inertia over mass [m²], (3,).
        numbers: for its function of distance, at most 6.
        triangles: struct ``Triangles``.
        mesh: Warp's, which lives as long as this.
    """

    home: np.ndarray
    axes: np.ndarray
    volume: float
    inertia: np.ndarray
    numbers: Sequence[float]
    triangles: Any
    mesh: Any = None


class Shape(ABC):
    """The shape of a rigid body.

    Attributes:
        distance: ``wp.func`` (p: vec3d, numbers: Numbers, triangles: Triangles) -> vec4d: the unit normal at place p
            [m] in the shape's frame, out of the shape, and the distance from its surface [m], negative inside.
    """

    distance: Any

    @abstractmethod
    def solid(self, dim: int, device: wp.DeviceLike) -> Solid:
        """The shape in ``dim`` dimensions.

        Raises:
            ValueError: there is none in these dimensions.
        """


def simple(volume: float, inertia: Sequence[float], numbers: Sequence[float]) -> Solid:
    """A shape given about its centre and along its principal axes."""
    return Solid(np.zeros(3), np.eye(3), volume, np.array(inertia, dtype=float), numbers, Triangles())


@wp.func
def plane_distance(p: wp.vec3d, numbers: Numbers, triangles: Triangles) -> wp.vec4d:
    n = wp.vec3d(numbers[0], numbers[1], numbers[2])
    return wp.vec4d(n[0], n[1], n[2], wp.dot(n, p))


@wp.func
def sphere_distance(p: wp.vec3d, numbers: Numbers, triangles: Triangles) -> wp.vec4d:
    r = wp.length(p)
    n = wp.vec3d(wp.float64(1.0), wp.float64(0.0), wp.float64(0.0))
    if r > wp.float64(0.0):
        n = p / r
    return wp.vec4d(n[0], n[1], n[2], r - numbers[0])


@wp.func
def cylinder_distance(p: wp.vec3d, numbers: Numbers, triangles: Triangles) -> wp.vec4d:
    """Radius, half length (inf in 2-D), and the unit axis."""
    axis = wp.vec3d(numbers[2], numbers[3], numbers[4])
    along = wp.dot(p, axis)
    beside = p - along * axis
    r = wp.length(beside)
    radial = wp.vec3d()
    if r > wp.float64(0.0):
        radial = beside / r
    end = axis
    if along < wp.float64(0.0):
        end = -axis
    over, beyond = r - numbers[0], wp.abs(along) - numbers[1]
    n, distance = radial, over
    if over > wp.float64(0.0) and beyond > wp.float64(0.0):
        distance = wp.sqrt(over * over + beyond * beyond)
        n = (over * radial + beyond * end) / distance
    elif beyond > over:
        n = end
        distance = beyond
    return wp.vec4d(n[0], n[1], n[2], distance)


@wp.func
def box_distance(p: wp.vec3d, numbers: Numbers, triangles: Triangles) -> wp.vec4d:
    """Half the sides, inf where there is no such side."""
    zero = wp.float64(0.0)
    outside, n = wp.vec3d(), wp.vec3d()
    deepest = wp.float64(-1.0e300)
    for i in range(3):
        over = wp.abs(p[i]) - numbers[i]
        if over > zero:
            outside[i] = wp.sign(p[i]) * over
        if over > deepest:
            deepest = over
            n = wp.vec3d()
            n[i] = wp.sign(p[i])
    distance = deepest
    if deepest > zero:
        distance = wp.length(outside)
        n = outside / distance
    return wp.vec4d(n[0], n[1], n[2], distance)


@dataclass(frozen=True)
class Plane(Shape):
    """All that lies behind a plane through the centre, without end; it cannot move freely.

    Args:
        normal: out of the matter, (dim,), of any length.

    Raises:
        ValueError: a normal that is none.
    """

    normal: Sequence[float]
    distance = plane_distance

    def solid(self, dim: int, device: wp.DeviceLike) -> Solid:
        normal = np.zeros(3)
        normal[:dim] = unit_vector(self.normal, dim, "Plane")
        return simple(math.inf, [0.0] * 3, normal.tolist())


@dataclass(frozen=True)
class Sphere(Shape):
    """A sphere about the centre; a disc in 2-D, a segment in 1-D.

    Args:
        radius: [m].

    Raises:
        ValueError: not positive.
    """

    radius: float
    distance = sphere_distance

    def __post_init__(self) -> None:
        positive(self.radius, "Sphere: radius", "give it in m")

    def solid(self, dim: int, device: wp.DeviceLike) -> Solid:
        r = self.radius
        volume = {1: 2.0 * r, 2: math.pi * r**2, 3: 4.0 / 3.0 * math.pi * r**3}[dim]
        return simple(volume, [(0.5 if dim == 2 else 0.4) * r**2] * 3, [r])


@dataclass(frozen=True)
class Box(Shape):
    """A box about the centre, its sides along the axes until it is turned; a rectangle in 2-D, a segment in 1-D.

    Args:
        sides: lengths [m], (dim,).

    Raises:
        ValueError: not positive.
    """

    sides: Sequence[float]
    distance = box_distance

    def __post_init__(self) -> None:
        sides = real_array(self.sides, "Box: sides")
        if sides.ndim != 1 or not len(sides) or not (sides > 0.0).all():
            raise ValueError(f"Box: sides must be positive lengths [m], one for each axis, got {short(self.sides)}")

    def solid(self, dim: int, device: wp.DeviceLike) -> Solid:
        sides = np.array(self.sides, dtype=float)
        if sides.shape != (dim,):
            raise ValueError(f"Box: sides must be {dim} lengths in {dim}-D, got {self.sides}")
        square = np.zeros(3)
        square[:dim] = sides**2 / 12.0
        half = np.full(3, np.inf)
        half[:dim] = 0.5 * sides
        return simple(float(sides.prod()), square.sum() - square, half.tolist())


@dataclass(frozen=True)
class Cylinder(Shape):
    """A cylinder about the centre, 3-D, with flat ends.

    Args:
        radius: [m].
        length: [m].
        axis: along it, (3,), of any length.

    Raises:
        ValueError: not positive, or an axis that is none.
    """

    radius: float
    length: float
    axis: Sequence[float] = (0.0, 0.0, 1.0)
    distance = cylinder_distance

    def __post_init__(self) -> None:
        positive(self.radius, "Cylinder: radius", "give it in m")
        positive(self.length, "Cylinder: length", "give it in m")
        unit_vector(self.axis, 3, "Cylinder: axis")

    def solid(self, dim: int, device: wp.DeviceLike) -> Solid:
        if dim != 3:
            raise ValueError(f"Cylinder: is for 3-D, got bodies in {dim}-D; its section is a Sphere or a Box there")
        r, length, axis = self.radius, self.length, unit_vector(self.axis, 3, "Cylinder: axis")
        across = r**2 / 4.0 + length**2 / 12.0
        # principal axes, the cylinder's last: with two rows of an orthogonal complement
        beside = np.linalg.svd(axis[None, :])[2][1:]
        axes = np.stack([beside[0], np.cross(axis, beside[0]), axis], axis=1)
        solid = simple(math.pi * r**2 * length, [across, across, r**2 / 2.0], [r, 0.5 * length, 0.0, 0.0, 1.0])
        return solid._replace(axes=axes)
