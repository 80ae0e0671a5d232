"""Stress, waves, energy and histories of laws that have them for eight particles at once (``Law.eights``): on the CPU.

A thread has a block of eight particles of one kind of law, fewer at the end of it, and of each independent run, which
has a step and constants of its own. Block k begins with particle ``blocks[k]`` of the kind; other parameters are those
of the kernels of ``flux_kernels.py``.
"""

import functools

import warp as wp

from ..fields import clock_structure, structure
from ..materials import Law
from ..materials.base import Eights, history_row
from ..space import Space
from .flux_kernels import keep_flux, keep_speeds, keep_update
from .laws import constants_of_body, laws_structure


@functools.cache
def make_flux(space: Space, law: Law, eights: Eights, several: bool, fixed: bool, dual: bool) -> wp.Kernel:
    """Kernel: Q, and Π if it is kept."""
    mat, row, real, stress = space.mat, history_row(space, law), space.real, eights.stress
    Particles, Reference, Flux = structure(space, "Particles"), structure(space, "Reference"), structure(space, "Flux")
    Laws, Clock, keep = laws_structure(law), clock_structure(space), keep_flux(space, fixed, dual)
    constants_of = constants_of_body(space, law, several)

    @wp.kernel(module="unique", enable_backward=False)
    def compute_flux(
        first: int,
        blocks: wp.array(dtype=wp.int32),
        begin: int,
        F: wp.array(dtype=mat),
        grad_v: wp.array(dtype=mat),
        history: wp.array(dtype=row),
        particles: Particles,
        reference: Reference,
        clock: Clock,
        fraction: wp.float64,
        laws: Laws,
        flux: Flux,
    ):
        block = first + wp.tid()
        own = blocks[block]
        count, a = blocks[block + 1] - own, begin + own
        ahead = real(fraction * clock.dt[clock.run[a]])
        stress(F, history, a, own, count, ahead, constants_of(a, particles, laws), flux.Q)
        if wp.static(dual or not fixed):
            for b in range(a, a + count):
                keep(b, flux.Q[b], reference, flux)

    return compute_flux


@functools.cache
def make_wave_speeds(space: Space, law: Law, eights: Eights, several: bool, fixed: bool) -> wp.Kernel:
    """Kernel: the wave speeds."""
    mat, row, pair, moduli = space.mat, history_row(space, law), space.row(2), eights.wave_moduli
    Particles, Reference, Flux = structure(space, "Particles"), structure(space, "Reference"), structure(space, "Flux")
    Laws, Clock, keep = laws_structure(law), clock_structure(space), keep_speeds(space, law, fixed)
    constants_of = constants_of_body(space, law, several)

    @wp.kernel(module="unique", enable_backward=False)
    def wave_speeds(
        first: int,
        blocks: wp.array(dtype=wp.int32),
        begin: int,
        F: wp.array(dtype=mat),
        grad_v: wp.array(dtype=mat),
        history: wp.array(dtype=row),
        particles: Particles,
        reference: Reference,
        laws: Laws,
        flux: Flux,
        clock: Clock,
    ):
        block = first + wp.tid()
        own = blocks[block]
        count, a = blocks[block + 1] - own, begin + own
        c = constants_of(a, particles, laws)
        M = moduli(F, history, a, own, count, c)
        for k in range(count):
            b, of_b = a + k, pair(M[0, k], M[1, k])
            keep(b, of_b, F[b], grad_v[b], history[own + k], c, particles, reference, flux, clock)

    return wave_speeds


@functools.cache
def make_energy(space: Space, law: Law, eights: Eights, several: bool) -> wp.Kernel:
    """Kernel: the stored energy."""
    mat, row, density = space.mat, history_row(space, law), eights.energy
    Particles, Laws = structure(space, "Particles"), laws_structure(law)
    constants_of = constants_of_body(space, law, several)

    @wp.kernel(module="unique", enable_backward=False)
    def energy(
        first: int,
        blocks: wp.array(dtype=wp.int32),
        begin: int,
        F: wp.array(dtype=mat),
        history: wp.array(dtype=row),
        particles: Particles,
        laws: Laws,
        out: wp.array(dtype=wp.float64),
    ):
        block = first + wp.tid()
        own = blocks[block]
        count, a = blocks[block + 1] - own, begin + own
        density(F, history, a, own, count, constants_of(a, particles, laws), out)
        for b in range(a, a + count):
            out[b] = wp.float64(particles.V0[b]) * out[b]

    return energy


@functools.cache
def make_update(space: Space, law: Law, eights: Eights, several: bool, tied: bool) -> wp.Kernel:
    """Kernel: the history after a full step and the energy that it dissipated; a step of no length changes nothing."""
    real, mat, row, keep = space.real, space.mat, history_row(space, law), keep_update(space, law, tied)
    Particles, Reference, Clock = structure(space, "Particles"), structure(space, "Reference"), clock_structure(space)
    Flux, Laws, updated = structure(space, "Flux"), laws_structure(law), eights.update
    constants_of = constants_of_body(space, law, several)

    @wp.kernel(module="unique", enable_backward=False)
    def update(
        first: int,
        blocks: wp.array(dtype=wp.int32),
        begin: int,
        F: wp.array(dtype=mat),
        grad_v: wp.array(dtype=mat),
        history: wp.array(dtype=row),
        particles: Particles,
        reference: Reference,
        clock: Clock,
        laws: Laws,
        flux: Flux,
    ):
        block = first + wp.tid()
        own = blocks[block]
        count, a = blocks[block + 1] - own, begin + own
        dt, c = real(clock.dt[clock.run[a]]), constants_of(a, particles, laws)
        if dt > real(0.0):
            updated(F, history, a, own, count, dt, c, flux.dissipated)
            for k in range(count):
                keep(a + k, history[own + k], flux.dissipated[a + k], c, particles, clock, flux)
        else:
            for b in range(a, a + count):
                flux.dissipated[b] = real(0.0)
                if wp.static(tied):
                    flux.slipped[b] = real(0.0)

    return update
