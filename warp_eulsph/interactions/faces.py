"""Sums over surfaces: their weight, which particles are outermost, the face of each, and how flat it lies."""

import functools
from typing import Any

import warp as wp

from ..boundaries.outermost import BLOCKING, HEIGHT, LEAST_HEIGHT
from ..fields import neighbour_structure, structure
from ..linalg import symmetric_eigen
from ..space import Space, difference
from ..weights import CubicSpline

# Smoothing length over spacing of sums over a surface, a spline of one dimension less: on a row of particles they are
# even to 0.3 %, wherever they are taken.
REACH = 1.2
# Cosine between the ways out of two particles of one face: 60°, so that a corner is of the faces that meet there, and
# these are not of each other.
ALIKE = 0.5
# Second moment of the particles of a face, in spacings², below which they say nothing of a plane.
SPREAD = 1.0e-6


@functools.cache
def surface_weight(space: Space) -> tuple[Any, Any]:
    """``wp.func`` φ(r, h) and −φ'(r, h)/r of the cubic spline of dimension d − 1 [1/m^(d−1)]; 1 and 0 in 1-D."""
    real, dim = space.real, space.dim
    value_of, slope_of = CubicSpline().profile(real)
    sigma = CubicSpline.sigma[max(dim - 2, 0)]

    if dim == 1:

        @wp.func
        def one(r: real, h: real) -> real:
            return real(1.0)

        @wp.func
        def zero(r: real, h: real) -> real:
            return real(0.0)

        return one, zero

    @wp.func
    def scale(h: real) -> real:
        if wp.static(dim == 2):
            return real(sigma) / h
        return real(sigma) / (h * h)

    @wp.func
    def value(r: real, h: real) -> real:
        q = r / h
        if q >= real(2.0):
            return real(0.0)
        return scale(h) * value_of(q)

    @wp.func
    def slope(r: real, h: real) -> real:
        q = r / h
        if q >= real(2.0):
            return real(0.0)
        return scale(h) / (h * h) * slope_of(q)

    return value, slope


@functools.cache
def alike_vectors(space: Space) -> wp.Function:
    """``wp.func`` whether two area vectors may be those of one face."""
    real, vec = space.real, space.vec

    @wp.func
    def alike(s: vec, other: vec) -> bool:
        return wp.dot(s, other) > real(ALIKE) * wp.length(s) * wp.length(other)

    return alike


@functools.cache
def least_two(space: Space) -> wp.Function:
    """``wp.func`` the place of the least eigenvalue, it, and the next to it.

    No entry is taken by a number found at run time, which on GPUs would need memory instead of registers.
    """
    vec, dim = space.vec, space.dim

    @wp.func
    def find_two(values: vec):
        place = int(0)
        least = values[0]
        for i in range(1, wp.static(dim)):
            if values[i] < least:
                place = i
                least = values[i]
        next = values[0]
        if place == 0:
            next = values[wp.static(min(1, dim - 1))]
        for i in range(wp.static(dim)):
            if i != place and values[i] < next:
                next = values[i]
        return place, least, next

    return find_two


@functools.cache
def make_outward(space: Space) -> wp.Kernel:
    """Kernel: which way out is, −2 V_a Σ_b w_ab ξ [m^(d−1)], where the arrangement moves; zero where it flows."""
    vec, real, separation = space.vec, space.real, difference(space)
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def find_outward(
        first: int,
        reference: Reference,
        near: Neighbours,
        flowing: wp.array(dtype=wp.int32),
        outward: wp.array(dtype=vec),
    ):
        a = first + wp.tid()
        if flowing[a] == 1:
            return
        total = vec()
        for k in range(near.start[a], near.stop[a], near.stride):
            total -= near.w[k] * separation(reference.x[near.index[k]], reference.x[a], near.box)
        outward[a] = total * (real(2.0) * reference.V[a])

    return find_outward


@functools.cache
def make_find(space: Space) -> wp.Kernel:
    """Kernel: whether a particle is outermost: a large area vector, and none above it (``boundaries/outermost.py``).

    Fragments without an area vector, which have hardly any neighbours, are outermost, and so are all that flow.
    """
    vec, real, dim, separation = space.vec, space.real, space.dim, difference(space)
    Particles, Reference, Neighbours = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        neighbour_structure(space),
    )

    @wp.kernel(module="unique", enable_backward=False)
    def find(
        first: int,
        particles: Particles,
        reference: Reference,
        near: Neighbours,
        poor: wp.array(dtype=wp.int32),
        flowing: wp.array(dtype=wp.int32),
        outward: wp.array(dtype=vec),
        least: real,
        outermost: wp.array(dtype=wp.int32),
    ):
        a = first + wp.tid()
        size = wp.length(outward[a])
        face = wp.pow(particles.V0[a], real(wp.static(1.0 - 1.0 / dim)))
        found = int(size > least * face)
        if found == 1:
            n = outward[a] / size
            around = int(0)
            reach = real(0.0)
            lean = vec()
            for k in range(near.start[a], near.stop[a], near.stride):
                away = separation(reference.x[near.index[k]], reference.x[a], near.box) / particles.spacing[a]
                height = wp.dot(away, n)
                if height > real(wp.static(LEAST_HEIGHT - 0.1)) and wp.length(away) < real(HEIGHT):
                    beside = away - n * height
                    across = wp.length(beside)
                    if height > real(LEAST_HEIGHT) and across < real(BLOCKING):
                        found = 0
                    if height < real(1.6) and across < real(1.5) * height:
                        around += 1
                        reach += across
                        lean += beside
            if around > 1 and wp.length(lean) <= real(0.35) * reach:
                found = 0
        elif poor[a] != 0 or flowing[a] == 1:
            found = 1
        if particles.share[a] == real(0.0):
            found = 0
        outermost[a] = found

    return find


@functools.cache
def plane_moments(space: Space) -> wp.Function:
    """``wp.func`` (a, particles, reference, near, x, outward, outermost) -> Σ w, mean of ξ, second moment about it.

    Of the outermost particles that may be of one face with a, itself included, at ``x``: ξ in spacings from a, w by the
    distance in the reference.
    """
    vec, mat, real, separation = space.vec, space.mat, space.real, difference(space)
    weight_of, alike = surface_weight(space)[0], alike_vectors(space)
    Particles, Reference, Neighbours = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        neighbour_structure(space),
    )

    @wp.func
    def plane_moments(
        a: int,
        particles: Particles,
        reference: Reference,
        near: Neighbours,
        x: wp.array(dtype=vec),
        outward: wp.array(dtype=vec),
        outermost: wp.array(dtype=wp.int32),
    ):
        h = real(REACH) * particles.spacing[a]
        total = weight_of(real(0.0), h)
        mean = vec()
        square = mat()
        for i in range(near.start[a], near.stop[a], near.stride):
            b = near.index[i]
            if outermost[b] == 1 and alike(outward[a], outward[b]):
                w = weight_of(wp.length(separation(reference.x[b], reference.x[a], near.box)), h)
                xi = separation(x[b], x[a], near.box) / particles.spacing[a]
                total += w
                mean += w * xi
                square += w * wp.outer(xi, xi)
        mean = mean / total
        return total, mean, square / total - wp.outer(mean, mean)

    return plane_moments


@functools.cache
def make_area(space: Space) -> wp.Kernel:
    """Kernel: the face of each outermost particle, 1/Σ_b φ_ab over those of its face, and how far these are from flat.

    What was outermost before keeps both: energies that depend on them must not jump. Those ``alone`` are outermost too.
    ``came`` says what was not, or has lost pairs since: ``torn`` is 2 where all are ``cut``, 1 where some are.
    """
    vec, real, dim, weight_of = space.vec, space.real, space.dim, surface_weight(space)[0]
    moments_of, eigen, order_of = plane_moments(space), symmetric_eigen(space), least_two(space)
    Particles, Reference, Neighbours = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        neighbour_structure(space),
    )

    @wp.kernel(module="unique", enable_backward=False)
    def find_area(
        first: int,
        members: wp.array(dtype=wp.int32),
        offset: int,
        particles: Particles,
        reference: Reference,
        near: Neighbours,
        outward: wp.array(dtype=vec),
        outermost: wp.array(dtype=wp.int32),
        alone: wp.array(dtype=wp.int32),
        cut: wp.array(dtype=wp.int32),
        there: wp.array(dtype=wp.int32),
        torn: wp.array(dtype=wp.int32),
        came: wp.array(dtype=wp.int32),
        area: wp.array(dtype=real),
        bend: wp.array(dtype=real),
    ):
        k = first + wp.tid()
        a = members[k] - offset
        now = wp.max(outermost[a], alone[a])
        known = there[k] == 1 and now == 1
        apart = alone[a] + cut[a]
        came[k] = int(now == 1 and (not known or apart > torn[k]))
        torn[k] = apart
        there[k] = now
        if known:
            return
        total = weight_of(real(0.0), real(REACH) * particles.spacing[a])
        uneven = real(0.0)
        if wp.static(dim > 1):
            total, _mean, square = moments_of(a, particles, reference, near, reference.x, outward, outermost)
            _, spread = eigen(square)
            _place, least, next = order_of(spread)
            uneven = real(1.0)
            if next > real(SPREAD):
                uneven = wp.clamp(least / next, real(0.0), real(1.0))
        area[k] = real(1.0) / total
        if alone[a] == 1 or wp.length_sq(outward[a]) == real(0.0):  # nobody knows beside whom
            area[k] = wp.pow(particles.V0[a], real(wp.static(1.0 - 1.0 / dim)))
        bend[k] = uneven

    return find_area
