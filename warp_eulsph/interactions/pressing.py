"""Kernels by which points of surfaces and a rigid body press on each other."""

import functools
from typing import Any

import warp as wp

from ..atomics import raise_to
from ..fields import clock_structure
from ..space import Space
from .rigid_motion import Pose, Wrench
from .shapes import Numbers, Triangles


@functools.cache
def trace_structure(space: Space) -> Any:
    """Points of surfaces: ``start``, ``places`` and ``weights`` of their rows, ``half`` [m], and what they oppose.

    ``stiffness`` [N/m] along the normal, ``shear`` [N/m] across, and ``inertia`` [1/kg], how the particles of a row
    answer a force on it, Σ ω²/m.
    """

    @wp.struct
    class TracePoints:
        start: wp.array(dtype=wp.int32)
        places: wp.array(dtype=wp.int32)
        weights: wp.array(dtype=space.real)
        half: wp.array(dtype=wp.float64)
        stiffness: wp.array(dtype=wp.float64)
        shear: wp.array(dtype=wp.float64)
        inertia: wp.array(dtype=wp.float64)

    return TracePoints


@functools.cache
def read_row(space: Space) -> wp.Function:
    """``wp.func``: Σ ω f over the row of a point, in three components."""
    vec, dim, TracePoints = space.vec, space.dim, trace_structure(space)

    @wp.func
    def read_row_of(points: TracePoints, k: int, f: wp.array(dtype=vec)) -> wp.vec3d:
        y = wp.vec3d()
        for i in range(points.start[k], points.start[k + 1]):
            value, weight = f[points.places[i]], wp.float64(points.weights[i])
            for j in range(wp.static(dim)):
                y[j] = y[j] + weight * wp.float64(value[j])
        return y

    return read_row_of


@functools.cache
def signed_gap(distance: Any) -> wp.Function:
    """``wp.func``: unit normal out of the rigid body, and the distance [m] of a place from it."""

    @wp.func
    def gap(y: wp.vec3d, pose: Pose, side: wp.float64, numbers: Numbers, triangles: Triangles) -> wp.vec4d:
        R = pose.R[0]
        found = distance(wp.transpose(R) @ (y - pose.x[0]), numbers, triangles)
        n = R @ wp.vec3d(found[0], found[1], found[2])
        return side * wp.vec4d(n[0], n[1], n[2], found[3])

    return gap


@functools.cache
def make_measure(space: Space, distance: Any) -> wp.Kernel:
    vec, gap, read, TracePoints = space.vec, signed_gap(distance), read_row(space), trace_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def measure(
        first: int,
        points: TracePoints,
        x: wp.array(dtype=vec),
        pose: Pose,
        side: wp.float64,
        numbers: Numbers,
        triangles: Triangles,
        out: wp.array(dtype=wp.float64),
    ):
        k = first + wp.tid()
        found = gap(read(points, k, x), pose, side, numbers, triangles)
        out[k] = found[3] - points.half[k]

    return measure


@wp.func
def rubbed(y: wp.vec3d, anchor: wp.vec3d, n: wp.vec3d, stiffness: wp.float64, most: wp.float64) -> wp.vec3d:
    """Friction on a point at y that was tied at ``anchor``: elastic along the surface, at most ``most`` (Coulomb)."""
    slip = y - anchor
    slip = slip - wp.dot(slip, n) * n
    force = -stiffness * slip
    size = wp.length(force)
    if size > most:
        force = force * (most / size)
    return force


@functools.cache
def make_press(space: Space, distance: Any, rubs: bool) -> wp.Kernel:
    """Kernel: the force of the rigid body on each point, what it does to the rigid body, and the energy it holds."""
    vec, gap, read, TracePoints = space.vec, signed_gap(distance), read_row(space), trace_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def press(
        first: int,
        points: TracePoints,
        x: wp.array(dtype=vec),
        pose: Pose,
        side: wp.float64,
        numbers: Numbers,
        triangles: Triangles,
        friction: wp.float64,
        anchors: wp.array(dtype=wp.vec3d),
        push: wp.array(dtype=wp.vec3d),
        wrench: wp.array(dtype=Wrench),
        energy: wp.array(dtype=wp.float64),
    ):
        k = first + wp.tid()
        y = read(points, k, x)
        found = gap(y, pose, side, numbers, triangles)
        n = wp.vec3d(found[0], found[1], found[2])
        depth = wp.max(points.half[k] - found[3], wp.float64(0.0))
        normal = points.stiffness[k] * depth
        force = normal * n
        held = wp.float64(0.5) * normal * depth
        if wp.static(rubs):
            shear = points.shear[k]
            if depth > wp.float64(0.0) and shear > wp.float64(0.0):
                tangential = rubbed(y, pose.x[0] + pose.R[0] @ anchors[k], n, shear, friction * normal)
                force += tangential
                held += wp.float64(0.5) * wp.dot(tangential, tangential) / shear
        moment = wp.cross(y - pose.x[0], force)
        push[k] = force
        wrench[k] = -Wrench(force[0], force[1], force[2], moment[0], moment[1], moment[2])
        energy[k] = held

    return press


@functools.cache
def make_tie(space: Space, distance: Any) -> wp.Kernel:
    """Kernel: where each point is tied to the rigid body, in its frame: after a step where it is, less elastic slip."""
    vec, gap, read, TracePoints = space.vec, signed_gap(distance), read_row(space), trace_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def tie(
        first: int,
        points: TracePoints,
        x: wp.array(dtype=vec),
        pose: Pose,
        side: wp.float64,
        numbers: Numbers,
        triangles: Triangles,
        friction: wp.float64,
        anchors: wp.array(dtype=wp.vec3d),
    ):
        k = first + wp.tid()
        y = read(points, k, x)
        R, tied = pose.R[0], y
        found = gap(y, pose, side, numbers, triangles)
        depth, shear = points.half[k] - found[3], points.shear[k]
        if depth > wp.float64(0.0) and shear > wp.float64(0.0):
            n = wp.vec3d(found[0], found[1], found[2])
            most = friction * points.stiffness[k] * depth
            tied = y + rubbed(y, pose.x[0] + R @ anchors[k], n, shear, most) / shear
        anchors[k] = wp.transpose(R) @ (tied - pose.x[0])

    return tie


@functools.cache
def make_gather(space: Space) -> wp.Kernel:
    """Kernel: each particle takes its shares of the forces on the points that it is a member of."""
    vec, dim, real = space.vec, space.dim, space.real

    @wp.kernel(module="unique", enable_backward=False)
    def gather(
        first: int,
        places: wp.array(dtype=wp.int32),
        start: wp.array(dtype=wp.int32),
        points: wp.array(dtype=wp.int32),
        weights: wp.array(dtype=real),
        push: wp.array(dtype=wp.vec3d),
        out: wp.array(dtype=vec),
    ):
        i = first + wp.tid()
        total = wp.vec3d()
        for j in range(start[i], start[i + 1]):
            total += wp.float64(weights[j]) * push[points[j]]
        force = out[places[i]]
        for j in range(wp.static(dim)):
            force[j] = force[j] + real(total[j])
        out[places[i]] = force

    return gather


@functools.cache
def make_ask(space: Space, distance: Any) -> wp.Kernel:
    """Kernel: squares of frequencies [1/s²] of the points that touch, or may in the step to come.

    The largest k Σ ω²/m of a point, and k (1/M + r²/I) of each, which add up to a bound for the rigid body; with
    friction r² counts twice, for the force across.
    """
    vec, gap, read, TracePoints = space.vec, signed_gap(distance), read_row(space), trace_structure(space)
    Clock, raise_largest = clock_structure(space), raise_to(wp.float64)

    @wp.kernel(module="unique", enable_backward=False)
    def ask(
        first: int,
        points: TracePoints,
        x: wp.array(dtype=vec),
        v: wp.array(dtype=vec),
        pose: Pose,
        side: wp.float64,
        numbers: Numbers,
        triangles: Triangles,
        inverse: wp.vec2d,
        clock: Clock,
        own: wp.array(dtype=wp.float64),
        of_rigid: wp.array(dtype=wp.float64),
    ):
        k = first + wp.tid()
        y = read(points, k, x)
        r = y - pose.x[0]
        found = gap(y, pose, side, numbers, triangles)
        n = wp.vec3d(found[0], found[1], found[2])
        closing = wp.dot(pose.v[0] + wp.cross(pose.spin[0], r) - read(points, k, v), n)
        nearest = points.half[k] + wp.max(closing, wp.float64(0.0)) / wp.float64(clock.rate[0])
        of_rigid[k] = wp.float64(0.0)
        if found[3] < nearest:
            of_rigid[k] = points.stiffness[k] * (inverse[0] + wp.dot(r, r) * inverse[1])
            raise_largest(own, points.stiffness[k] * points.inertia[k])

    return ask


@functools.cache
def make_raise(space: Space) -> wp.Kernel:
    Clock, real = clock_structure(space), space.real

    @wp.kernel(module="unique", enable_backward=False)
    def raise_frequency(own: wp.array(dtype=wp.float64), of_rigid: wp.array(dtype=wp.float64), clock: Clock):
        clock.frequency[0] = wp.max(clock.frequency[0], real(wp.sqrt(own[0] + of_rigid[0])))
        own[0] = wp.float64(0.0)

    return raise_frequency
