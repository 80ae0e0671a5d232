"""The other half of the acoustic flux: volume that flows from where pressure is high to where it is low (M24)."""

import functools
from collections.abc import Callable

import warp as wp

from ..execution import Launcher
from ..fields import clock_structure, neighbour_structure, structure
from ..materials import Law
from ..materials.base import history_row, long_form
from ..space import Space, difference
from ..structs import ClockArrays, ParticleArrays
from .flux import Flux
from .stabiliser import Sums


@functools.cache
def _make_pressure(space: Space) -> wp.Kernel:
    """Kernel: p of the stress in the reference."""
    real, row, Flux, dim = space.real, space.row(1), structure(space, "Flux"), float(space.dim)

    @wp.kernel(module="unique", enable_backward=False)
    def pressure(first: int, flux: Flux, out: wp.array(dtype=row)):
        a = first + wp.tid()
        out[a] = row(-wp.trace(flux.Q[a]) / real(dim))

    return pressure


@functools.cache
def _make_exchange(space: Space) -> wp.Kernel:
    """Kernel: ΔV_a/V_a = −ε Δt/V_a Σ_b A_ab [p_b − p_a − ½(∇p_a + ∇p_b)·ξ]/(Z_a + Z_b), A_ab = V_a V_b |W'| (M24).

    The velocity of the interface between two ends that have different pressures, as M9 has the pressure of one between
    different velocities; antisymmetric in volume, zero for linear pressures.
    """
    real, row, rows = space.real, space.row(1), space.row_gradient(1)
    Reference, Flux, Clock = structure(space, "Reference"), structure(space, "Flux"), clock_structure(space)
    Neighbours, separation = neighbour_structure(space), difference(space)

    @wp.kernel(module="unique", enable_backward=False)
    def exchange(
        first: int,
        reference: Reference,
        near: Neighbours,
        flux: Flux,
        p: wp.array(dtype=row),
        grad_p: wp.array(dtype=rows),
        epsilon: real,
        clock: Clock,
        out: wp.array(dtype=real),
    ):
        a = first + wp.tid()
        flow = real(0.0)
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            xi = separation(reference.x[b], reference.x[a], near.box)
            both = flux.impedance[a] + flux.impedance[b]
            if both > real(0.0):
                mean = (grad_p[a] + grad_p[b]) @ xi
                flow -= near.w[k] * wp.length(xi) * (p[b][0] - p[a][0] - real(0.5) * mean[0]) / both
        out[a] = flow * epsilon * real(clock.dt[0])

    return exchange


@functools.cache
def _make_take(space: Space, law: Law) -> wp.Kernel:
    """Kernel: J ← (1 + ΔV/V) J; what that took of the energy is dissipated, or heat where the law takes it."""
    real, mat, row, root = space.real, space.mat, history_row(space, law), 1.0 / space.dim
    Particles, Flux, Constants = structure(space, "Particles"), structure(space, "Flux"), law.Constants
    energy_of, remembers, heats, warmed = (
        long_form(space, law).energy,
        bool(law.history),
        law.heat is not None,
        law.heat,
    )

    @wp.kernel(module="unique", enable_backward=False)
    def take(
        first: int,
        begin: int,
        F: wp.array(dtype=mat),
        history: wp.array(dtype=row),
        particles: Particles,
        change: wp.array(dtype=real),
        c: Constants,
        flux: Flux,
    ):
        a = first + wp.tid()
        h = row()
        lost = real(0.0)
        if wp.static(remembers):
            h = history[a - begin]
            lost = flux.dissipated[a]
        F_a = F[a] * wp.pow(real(1.0) + change[a], real(root))
        gone = energy_of(F[a], h, c) - energy_of(F_a, h, c)
        if wp.static(heats):
            history[a - begin] = warmed(F_a, h, gone, c)
        else:
            lost += particles.V0[a] * gone
        flux.dissipated[a] = lost
        F[a] = F_a

    return take


class VolumeFlux:
    """M24 at work on one medium of fluids."""

    def __init__(self, space: Space, flux: Flux, particles: ParticleArrays, change: wp.array, device: wp.DeviceLike):
        self.space, self.flux, self.particles, self.change = space, flux, particles, change
        self._launch, n = Launcher(device), len(change)
        self._p = wp.zeros(n, dtype=space.row(1), device=device)
        self._grad_p = wp.zeros(n, dtype=space.row_gradient(1), device=device)

    def find(self, sums: Sums, exact: Callable[[wp.array], wp.array], clock: ClockArrays) -> None:
        """ΔV/V of the step, by the pressures that it was made with."""
        configuration, n = sums.configuration, len(self.change)
        self._launch(_make_pressure(self.space), n, [sums.flux, self._p])
        configuration.gradient(self._p, self._grad_p)
        gradient = exact(self._grad_p)
        arguments = [configuration.fields, configuration.near, sums.flux, self._p, gradient, sums.epsilon]
        self._launch(_make_exchange(self.space), n, [*arguments, clock, self.change])

    def take(self, F: wp.array) -> None:
        """Into J."""
        for part in self.flux.parts:
            arguments = [part.first, F, part.history, self.particles, self.change, part.constants, self.flux.fields]
            self._launch(_make_take(self.space, part.law), part.size, arguments, part.first)
