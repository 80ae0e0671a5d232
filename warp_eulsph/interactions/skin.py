"""The skin of bodies: their outermost particles, the face of each, and which way out is."""

import functools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..boundaries import Assembly
from ..boundaries.outermost import BLOCKING, HEIGHT, LARGE, LEAST_HEIGHT
from ..execution import Launcher
from ..fields import neighbour_structure, part_of, structure
from ..linalg import cofactor, inverse, symmetric_eigen
from ..space import Space, difference
from ..weights import CubicSpline

if TYPE_CHECKING:
    from ..scheme.medium import Medium
    from ..scheme.world import World

# Smoothing length over spacing of sums over a surface, a spline of one dimension less: on a row of particles they are
# even to 0.3 %, wherever they are taken.
REACH = 1.2
# Cosine between the ways out of two particles of one face: 60°, so that a corner is of the faces that meet there, and
# these are not of each other.
ALIKE = 0.5


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
def _alike(space: Space) -> Any:
    """``wp.func`` whether two area vectors may be those of one face."""
    real, vec = space.real, space.vec

    @wp.func
    def alike(s: vec, other: vec) -> bool:
        return wp.dot(s, other) > real(ALIKE) * wp.length(s) * wp.length(other)

    return alike


@functools.cache
def _make_outward(space: Space) -> Any:
    """Kernel: which way out is, −2 V_a Σ_b w_ab ξ [m^(d−1)], where the arrangement moves."""
    vec, real, separation = space.vec, space.real, difference(space)
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def find_outward(first: int, reference: Reference, near: Neighbours, outward: wp.array(dtype=vec)):
        a = first + wp.tid()
        total = vec()
        for k in range(near.start[a], near.start[a + 1]):
            total -= near.w[k] * separation(reference.x[near.index[k]], reference.x[a], near.box)
        outward[a] = total * (real(2.0) * reference.V[a])

    return find_outward


@functools.cache
def _make_find(space: Space) -> Any:
    """Kernel: whether a particle is outermost: a large area vector, and none above it (``boundaries/outermost.py``).

    Fragments without an area vector, which have hardly any neighbours, are outermost.
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
            for k in range(near.start[a], near.start[a + 1]):
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
        elif poor[a] != 0:
            found = 1
        if particles.share[a] == real(0.0):
            found = 0
        outermost[a] = found

    return find


@functools.cache
def _make_area(space: Space) -> Any:
    """Kernel: the face of each outermost particle, 1/Σ_b φ_ab over those of its face."""
    vec, real, dim, separation = space.vec, space.real, space.dim, difference(space)
    weight_of, alike = surface_weight(space)[0], _alike(space)
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
        there: wp.array(dtype=wp.int32),
        area: wp.array(dtype=real),
    ):
        k = first + wp.tid()
        a = members[k] - offset
        there[k] = outermost[a]
        h = real(REACH) * particles.spacing[a]
        total = weight_of(real(0.0), h)
        if wp.static(dim > 1):
            for i in range(near.start[a], near.start[a + 1]):
                b = near.index[i]
                if outermost[b] == 1 and alike(outward[a], outward[b]):
                    total += weight_of(wp.length(separation(reference.x[b], reference.x[a], near.box)), h)
        area[k] = real(1.0) / total

    return find_area


@functools.cache
def _make_normals(space: Space, fixed: bool) -> Any:
    """Kernel: normals of the planes through the outermost particles around, and how far these are from a plane."""
    vec, mat, real, dim, separation = space.vec, space.mat, space.real, space.dim, difference(space)
    weight_of, eigen, cof, invert = surface_weight(space)[0], symmetric_eigen(space), cofactor(space), inverse(space)
    alike = _alike(space)
    Particles, Reference, State, Neighbours = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        structure(space, "State"),
        neighbour_structure(space),
    )

    @wp.kernel(module="unique", enable_backward=False)
    def find_normals(
        first: int,
        members: wp.array(dtype=wp.int32),
        offset: int,
        particles: Particles,
        reference: Reference,
        near: Neighbours,
        state: State,
        outward: wp.array(dtype=vec),
        outermost: wp.array(dtype=wp.int32),
        normal: wp.array(dtype=vec),
        bend: wp.array(dtype=real),
    ):
        k = first + wp.tid()
        a = members[k] - offset
        out = outward[a]
        if wp.static(fixed):
            out = cof(state.F[a]) @ out
        else:
            out = cof(state.F[a] @ invert(reference.F[a])) @ out
        n = wp.normalize(out)
        uneven = real(1.0)
        if wp.static(dim == 1):
            uneven = real(0.0)
        if wp.static(dim > 1):
            h = real(REACH) * particles.spacing[a]
            mass = weight_of(real(0.0), h)
            mean = vec()
            square = mat()
            for i in range(near.start[a], near.start[a + 1]):
                b = near.index[i]
                if outermost[b] == 1 and alike(outward[a], outward[b]):
                    w = weight_of(wp.length(separation(reference.x[b], reference.x[a], near.box)), h)
                    xi = separation(state.x[b], state.x[a], near.box) / particles.spacing[a]
                    mass += w
                    mean += w * xi
                    square += w * wp.outer(xi, xi)
            mean = mean / mass
            axes, spread = eigen(square / mass - wp.outer(mean, mean))
            least = int(0)
            for i in range(1, wp.static(dim)):
                if spread[i] < spread[least]:
                    least = i
            next = real(wp.inf)
            for i in range(wp.static(dim)):
                if i != least:
                    next = wp.min(next, spread[i])
            if next > real(1.0e-6) and wp.length(out) > real(0.0):
                uneven = wp.clamp(spread[least] / next, real(0.0), real(1.0))
                for i in range(wp.static(dim)):
                    n[i] = axes[i, least]
                if wp.dot(n, out) < real(0.0):
                    n = -n
        normal[k] = n
        bend[k] = uneven

    return find_normals


class _Layer:
    """The skin of one medium; its outermost particles are those of the reference."""

    def __init__(self, space: Space, medium: "Medium", device: Any):
        self.space, self.medium, self._launch = space, medium, Launcher(device)
        n = medium.n
        self.outermost = wp.zeros(n, dtype=wp.int32, device=device)
        fixed, exact = medium.configuration.fixed, medium.surface_given
        self.outward = medium.particles.outward
        if not fixed and not exact:
            self.outward = wp.zeros(n, dtype=space.vec, device=device)
        self.least = 0.0 if exact else LARGE

    @property
    def changes(self) -> bool:
        """Whether other particles may become outermost."""
        return self.outward is not self.medium.particles.outward

    def find(self) -> None:
        """Which are outermost in the present reference."""
        configuration, n = self.medium.configuration, self.medium.n
        if self.changes:
            arguments = [configuration.fields, configuration.near, self.outward]
            self._launch(_make_outward(self.space), n, arguments)
        arguments = [self.medium.particles, configuration.fields, configuration.near, configuration.poor, self.outward]
        self._launch(_make_find(self.space), n, [*arguments, self.least, self.outermost])

    def areas(self, places: wp.array, there: wp.array, area: wp.array) -> None:
        """The face of each of its particles at ``places``, and whether it is outermost."""
        configuration = self.medium.configuration
        arguments = [places, self.medium.span.start, self.medium.particles, configuration.fields, configuration.near]
        self._launch(_make_area(self.space), len(places), [*arguments, self.outward, self.outermost, there, area])

    def normals(self, places: wp.array, state: Any, normal: wp.array, bend: wp.array) -> None:
        """Which way out is of those at ``places``, by where the particles of ``state`` are."""
        configuration = self.medium.configuration
        arguments = [places, self.medium.span.start, self.medium.particles, configuration.fields, configuration.near]
        arguments += [self.medium.of(state), self.outward, self.outermost, normal, bend]
        self._launch(_make_normals(self.space, configuration.fixed), len(places), arguments)


class Skin:
    """The outermost particles of bodies, in gathers that are the same on any number of threads.

    Where the arrangement stays that of the start, its outermost particles stay outermost, and the skin has them alone;
    where it is read anew, every particle may be, and ``there`` says which are. An outermost particle lies half a
    spacing beneath the surface; bodies are at least two particles thick.

    Args:
        world: at its start, with the first references.
        assembly: what its parts were bound with.
        bodies: names; all if None.

    Attributes:
        indices: numbers of the particles that are or may be outermost, (k,) int32, ascending.
        places: where they lie, (k,) int32 on the device, kept right.
        bodies: number of the body of each, (k,) int32, on the device.
        there: whether it is outermost, (k,) int32.
        area: face of each in the reference [m^(d−1)], (k,).
        half: distance from the particle to the surface, half a spacing [m], (k,).
        modulus, shear_modulus: ρ c² of pressure and of shear waves at F = I [Pa], (k,).
        normal: unit vector that points out, (k,) of vec, zero where a fragment has none; after ``look``.
        bend: how far the particles around are from a plane, 0 flat to 1 (k,): least over next eigenvalue of their
            second moment; about ¼ in corners. Where it is 1 the normal tells nothing.

    Raises:
        ValueError: a body without outermost particles.
    """

    def __init__(self, world: "World", assembly: Assembly, bodies: Sequence[str] | None = None):
        self.space, device = world.space, world.device
        names = list(assembly.bodies) if bodies is None else list(bodies)
        self._layers = [_Layer(world.space, medium, device) for medium in world.media]
        self.find_layers()
        ranges = [assembly.bodies[name] for name in names]
        may_be = np.zeros(len(assembly.X), dtype=bool)
        for layer in self._layers:
            span = layer.medium.span
            found = np.ones(len(span), dtype=bool) if layer.changes else layer.outermost.numpy() == 1
            may_be[span.start : span.stop] = found
        may_be = assembly.order.by_number(may_be)
        wanted = np.zeros_like(may_be)
        for name, own in zip(names, ranges, strict=True):
            wanted[own.start : own.stop] = True
            if not may_be[own.start : own.stop].any():
                raise ValueError(
                    f"body {name!r} has no outermost particles, at least two particles across each direction are "
                    "needed, and no surface=0"
                )
        self.indices = np.flatnonzero(may_be & wanted).astype(np.int32)
        self.places, k = assembly.order.places_of(self.indices), len(self.indices)
        ends = np.searchsorted(self.indices, [0, *[layer.medium.span.stop for layer in self._layers]])
        self._spans = [range(*pair) for pair in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)]
        body, spacing = (
            assembly.order.by_number(values.numpy())[self.indices]
            for values in (world.particles.body, world.particles.spacing)
        )
        moduli = np.array([both for layer in self._layers for both in layer.medium.flux.moduli()])[body]
        self.bodies = wp.array(body, dtype=wp.int32, device=device)
        self.half = wp.array(0.5 * spacing, dtype=world.space.real, device=device)
        self.modulus, self.shear_modulus = (wp.array(M, dtype=world.space.real, device=device) for M in moduli.T)
        self.there = wp.zeros(k, dtype=wp.int32, device=device)
        self.area, self.bend = (wp.zeros(k, dtype=world.space.real, device=device) for _ in range(2))
        self.normal = wp.zeros(k, dtype=world.space.vec, device=device)
        self._parts = [
            [part_of(array, own) if len(own) else array[:0] for array in self._arrays()] for own in self._spans
        ]
        self.find()

    def _arrays(self) -> list[wp.array]:
        return [self.places, self.there, self.area, self.normal, self.bend]

    @property
    def changes(self) -> bool:
        """Whether other particles may become outermost."""
        return any(layer.changes for layer in self._layers)

    def find_layers(self) -> None:
        """Which particles of the media are outermost."""
        for layer in self._layers:
            layer.find()

    def find(self) -> None:
        """Which particles are outermost in the present references, and the face of each; launches only."""
        self.find_layers()
        for layer, (places, there, area, _, _) in zip(self._layers, self._parts, strict=True):
            layer.areas(places, there, area)

    def look(self, state: Any) -> None:
        """Normals of the skin where the particles are in ``state`` (struct ``State``); launches only."""
        for layer, (places, _, _, normal, bend) in zip(self._layers, self._parts, strict=True):
            layer.normals(places, state, normal, bend)
