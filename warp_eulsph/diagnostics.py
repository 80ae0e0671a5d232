"""Momenta, extrema and sums over parts of a state, reduced on the device in float64."""

import functools
from collections.abc import Sequence

import numpy as np
import warp as wp

from .atomics import raise_to
from .execution import Launcher, launch
from .fields import neighbour_structure, part_of, structure
from .linalg import det, inverse
from .reduce import Sum, SumOfParticles
from .scheme.medium import Medium
from .space import Space, difference
from .structs import ForceArrays, ParticleArrays, StateArrays

_Vec6 = wp.types.vector(length=6, dtype=wp.float64)
_Vec11 = wp.types.vector(length=11, dtype=wp.float64)


@functools.cache
def _make_momenta(space: Space) -> wp.Kernel:
    """Kernel of ``SumOfParticles``: (m v, m x × v), padded to 3-D."""
    Particles, State, dim = structure(space, "Particles"), structure(space, "State"), space.dim

    @wp.kernel(module="unique", enable_backward=False)
    def momenta(
        first: int, bounds: wp.array(dtype=wp.int32), particles: Particles, state: State, out: wp.array(dtype=_Vec6)
    ):
        block = first + wp.tid()
        total = _Vec6()
        for a in range(bounds[block], bounds[block + 1]):
            x = wp.vec3d()
            p = wp.vec3d()
            for i in range(wp.static(dim)):
                x[i] = wp.float64(state.x[a][i])
                p[i] = wp.float64(particles.share[a] * particles.mass[a]) * wp.float64(state.v[a][i])
            L = wp.cross(x, p)
            total += _Vec6(p[0], p[1], p[2], L[0], L[1], L[2])
        out[block] = total

    return momenta


@functools.cache
def _make_jacobian(space: Space) -> wp.Kernel:
    real, mat = space.real, space.mat
    determinant = det(space)

    @wp.kernel(module="unique", enable_backward=False)
    def jacobian(first: int, F: wp.array(dtype=mat), out: wp.array(dtype=real)):
        a = first + wp.tid()
        out[a] = determinant(F[a])

    return jacobian


@functools.cache
def _make_extrema(space: Space) -> wp.Kernel:
    """Kernel: largest −det F, det F and speed; maxima do not depend on the order."""
    State, determinant, real = structure(space, "State"), det(space), space.real
    raise_largest = raise_to(real)

    @wp.kernel(module="unique", enable_backward=False)
    def find_extrema(
        first: int,
        state: State,
        most_negative: wp.array(dtype=real),
        largest: wp.array(dtype=real),
        fastest: wp.array(dtype=real),
    ):
        a = first + wp.tid()
        J = determinant(state.F[a])
        raise_largest(most_negative, -J)
        raise_largest(largest, J)
        raise_largest(fastest, wp.length(state.v[a]))

    return find_extrema


@functools.cache
def _make_mismatch(space: Space, fixed: bool) -> wp.Kernel:
    """Kernel: root of the mean square of r_ab (M16) since the last refresh, weighted as in M4, over the spacing."""
    real, mat, dim = space.real, space.mat, space.dim
    Particles, Reference, State = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        structure(space, "State"),
    )
    Neighbours, separation, invert = neighbour_structure(space), difference(space), inverse(space)
    raise_largest = raise_to(real)

    @wp.func
    def strain(a: int, state: State, reference: Reference) -> mat:
        G = state.F[a]
        if wp.static(not fixed):
            G = G @ invert(reference.F[a])
        return G - wp.identity(n=wp.static(dim), dtype=real)

    @wp.kernel(module="unique", enable_backward=False)
    def mismatch(
        first: int,
        particles: Particles,
        reference: Reference,
        near: Neighbours,
        state: State,
        out: wp.array(dtype=real),
        largest: wp.array(dtype=real),
    ):
        a = first + wp.tid()
        X_a, u_a, H_a = reference.x[a], state.x[a] - reference.x[a], strain(a, state, reference)
        total = real(0.0)
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            half = (H_a + strain(b, state, reference)) * real(0.5)
            r = state.x[b] - reference.x[b] - u_a - half @ separation(reference.x[b], X_a, near.box)
            total += near.w[k] * wp.dot(r, r)
        out[a] = wp.sqrt(total / wp.max(reference.diagonal[a], real(1e-30))) / particles.spacing[a]
        raise_largest(largest, out[a])

    return mismatch


@functools.cache
def _make_body_sums(space: Space) -> wp.Kernel:
    """Kernel: (m, m x, m v, m x × v, ½ m v²) of each particle of a body, padded to 3-D, ghosts left out."""
    Particles, State, dim = structure(space, "Particles"), structure(space, "State"), space.dim

    @wp.kernel(module="unique", enable_backward=False)
    def body_sums(first: int, begin: int, particles: Particles, state: State, out: wp.array(dtype=_Vec11)):
        a = first + wp.tid()
        m = wp.float64(particles.share[a] * particles.mass[a])
        x = wp.vec3d()
        v = wp.vec3d()
        for k in range(wp.static(dim)):
            x[k] = wp.float64(state.x[a][k])
            v[k] = wp.float64(state.v[a][k])
        L = wp.cross(x, v)
        kinetic = wp.float64(0.5) * wp.dot(v, v)
        out[a - begin] = m * _Vec11(wp.float64(1.0), x[0], x[1], x[2], v[0], v[1], v[2], L[0], L[1], L[2], kinetic)

    return body_sums


@functools.cache
def _make_section(space: Space) -> wp.Kernel:
    """Kernel: the force that other particles exert on those listed, padded to 3-D."""
    Forces, dim = structure(space, "Forces"), space.dim

    @wp.kernel(module="unique", enable_backward=False)
    def section(first: int, indices: wp.array(dtype=wp.int32), forces: Forces, out: wp.array(dtype=wp.vec3d)):
        k = first + wp.tid()
        a = indices[k]
        total = forces.internal[a] + forces.correction[a] + forces.tie[a] + forces.dissipation[a]
        force = wp.vec3d()
        for i in range(wp.static(dim)):
            force[i] = wp.float64(total[i])
        out[k] = force

    return section


class BodySums:
    """Mass, centre, momenta and kinetic energy of one body.

    Args:
        body: its range of particles.
    """

    def __init__(self, space: Space, particles: ParticleArrays, body: range, device: wp.DeviceLike):
        self.space, self.particles, self.body, self._launch = space, particles, body, Launcher(device)
        self._each = wp.zeros(len(body), dtype=_Vec11, device=device)
        self._total, self._sum = wp.zeros(1, dtype=_Vec11, device=device), Sum(_Vec11, len(body), device)

    def __call__(self, state: StateArrays) -> dict[str, np.ndarray]:
        """Of ``state``: centre of mass [m] and momentum [kg m/s], (dim,); angular momentum about the origin
        [kg m²/s], (3,); kinetic energy [J], ()."""
        arguments = [self.body.start, self.particles, state, self._each]
        self._launch(_make_body_sums(self.space), len(self.body), arguments, self.body.start)
        self._sum(self._each, self._total)
        total, dim = self._total.numpy()[0].copy(), self.space.dim
        return {
            "centre": total[1 : 1 + dim] / total[0],
            "momentum": total[4 : 4 + dim],
            "angular_momentum": total[7:10],
            "kinetic": total[10],
        }


class SectionForce:
    """Force that the rest of the material exerts on some of the particles.

    Args:
        places: of the particles, (k,) int32.
    """

    def __init__(self, space: Space, places: wp.array):
        self.space, self.device, self._places = space, places.device, places
        self._launch = Launcher(self.device)
        self._each, self._total = (wp.zeros(k, dtype=wp.vec3d, device=self.device) for k in (len(places), 1))
        self._sum = Sum(wp.vec3d, len(places), self.device)

    def __call__(self, forces: ForceArrays) -> np.ndarray:
        """[N], (dim,), from the step's ``forces``: what acts between the particles themselves cancels in the sum."""
        arguments = [self._places, forces, self._each]
        self._launch(_make_section(self.space), len(self._places), arguments)
        self._sum(self._each, self._total)
        return self._total.numpy()[0][: self.space.dim].copy()


class Diagnostics:
    """Sums and extrema over all particles of a state, and its volume ratios.

    Args:
        runs: particles of each run (``DeviceClock.sizes``).
    """

    def __init__(self, space: Space, particles: ParticleArrays, device: wp.DeviceLike, runs: Sequence[int]):
        self.space, self.particles, self.device = space, particles, device
        self._launch = Launcher(device)
        self._total = wp.zeros(len(runs), dtype=_Vec6, device=device)
        self._extrema = [wp.zeros(1, dtype=space.real, device=device) for _ in range(3)]
        self._sum = SumOfParticles(_Vec6, runs, device)
        self._mismatch = wp.zeros(0, dtype=space.real, device=device)
        self._largest = wp.zeros(1, dtype=space.real, device=device)

    def mismatch(self, media: Sequence[Medium], state: StateArrays) -> tuple[wp.array, float]:
        """How far positions and F disagree around each particle, in spacings, (n,) on the device, and the largest."""
        if len(self._mismatch) == 0:
            self._mismatch = wp.zeros(len(state.x), dtype=self.space.real, device=self.device)
        self._largest.zero_()
        for medium in media:
            configuration, out = medium.configuration, part_of(self._mismatch, medium.span)
            arguments = [medium.particles, configuration.fields, configuration.near, medium.of(state), out]
            kernel = _make_mismatch(self.space, configuration.fixed)
            self._launch(kernel, medium.n, [*arguments, self._largest])
        return self._mismatch, float(self._largest.numpy()[0])

    def momenta(self, state: StateArrays) -> tuple[np.ndarray, np.ndarray]:
        """Linear [kg m/s] and angular momentum about the origin [kg m²/s] of each run, both padded to (runs, 3)."""
        self._sum(_make_momenta(self.space), [self.particles, state], self._total)
        total = self._total.numpy().copy()
        return total[:, :3], total[:, 3:]

    def extrema(self, state: StateArrays) -> tuple[float, float, float]:
        """Least and largest det F [-], and largest speed [m/s]."""
        for array, least in zip(self._extrema, (-np.inf, -np.inf, 0.0), strict=True):
            array.fill_(least)
        self._launch(_make_extrema(self.space), len(state.x), [state, *self._extrema])
        most_negative, largest, speed = (float(array.numpy()[0]) for array in self._extrema)
        return -most_negative, largest, speed

    def jacobians(self, state: StateArrays) -> np.ndarray:
        """det F of each particle, (n,)."""
        return self.volume_ratios(state).numpy()

    def volume_ratios(self, state: StateArrays) -> wp.array:
        """det F of each particle, (n,), on the device."""
        found = wp.empty(len(state.F), dtype=self.space.real, device=self.device)
        launch(_make_jacobian(self.space), len(found), [state.F, found], self.device)
        return found
