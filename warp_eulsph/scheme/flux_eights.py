"""Stress, waves, energy and histories of laws that have them for eight particles at once (``Law.eights``): on the CPU.

A thread has a block of eight particles of one kind of law. Parameters are those of the kernels of ``flux_kernels.py``.
"""

import functools

import warp as wp

from ..fields import clock_structure, structure
from ..materials import Law
from ..materials.base import Eights, history_row
from ..materials.in_eights import EIGHT, block_structure
from ..space import Space
from .flux_kernels import keep_flux, keep_speeds, keep_update
from .laws import laws_structure


@functools.cache
def block_of(space: Space, law: Law) -> wp.Function:
    """``wp.func`` (number of a thread, first particle of the kind, F, history) -> the thread's block."""
    mat, row = space.mat, history_row(space, law)
    Block = block_structure(mat, row)

    @wp.func
    def block_of(thread: int, begin: int, F: wp.array(dtype=mat), history: wp.array(dtype=row)) -> Block:
        own = thread * EIGHT
        return Block(F, history, begin + own, own, wp.min(len(history) - own, EIGHT))

    return block_of


@functools.cache
def make_flux(space: Space, law: Law, eights: Eights, fixed: bool, dual: bool) -> wp.Kernel:
    """Kernel: Q, and Π if it is kept."""
    mat, row, real, stress = space.mat, history_row(space, law), space.real, eights.stress
    Particles, Reference, Flux = structure(space, "Particles"), structure(space, "Reference"), structure(space, "Flux")
    Laws, Clock, keep = laws_structure(law), clock_structure(space), keep_flux(space, fixed, dual)
    take = block_of(space, law)

    @wp.kernel(module="unique", enable_backward=False)
    def compute_flux(
        first: int,
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
        block = take(first + wp.tid(), begin, F, history)
        stress(block, real(fraction * clock.dt[0]), laws.constants[0], flux.Q)
        if wp.static(dual or not fixed):
            for a in range(block.first, block.first + block.count):
                keep(a, flux.Q[a], reference, flux)

    return compute_flux


@functools.cache
def make_wave_speeds(space: Space, law: Law, eights: Eights, fixed: bool) -> wp.Kernel:
    """Kernel: the wave speeds."""
    mat, row, pair, moduli = space.mat, history_row(space, law), space.row(2), eights.wave_moduli
    Particles, Reference, Flux = structure(space, "Particles"), structure(space, "Reference"), structure(space, "Flux")
    Laws, Clock, keep = laws_structure(law), clock_structure(space), keep_speeds(space, law, fixed)
    take = block_of(space, law)

    @wp.kernel(module="unique", enable_backward=False)
    def wave_speeds(
        first: int,
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
        block, c = take(first + wp.tid(), begin, F, history), laws.constants[0]
        M = moduli(block, c)
        for k in range(block.count):
            a, of_a = block.first + k, pair(M[0, k], M[1, k])
            keep(a, of_a, F[a], grad_v[a], history[block.own + k], c, particles, reference, flux, clock)

    return wave_speeds


@functools.cache
def make_energy(space: Space, law: Law, eights: Eights) -> wp.Kernel:
    """Kernel: the stored energy."""
    mat, row, density = space.mat, history_row(space, law), eights.energy
    Particles, Laws, take = structure(space, "Particles"), laws_structure(law), block_of(space, law)

    @wp.kernel(module="unique", enable_backward=False)
    def energy(
        first: int,
        begin: int,
        F: wp.array(dtype=mat),
        history: wp.array(dtype=row),
        particles: Particles,
        laws: Laws,
        out: wp.array(dtype=wp.float64),
    ):
        block = take(first + wp.tid(), begin, F, history)
        density(block, laws.constants[0], out)
        for a in range(block.first, block.first + block.count):
            out[a] = wp.float64(particles.V0[a]) * out[a]

    return energy


@functools.cache
def make_update(space: Space, law: Law, eights: Eights, tied: bool) -> wp.Kernel:
    """Kernel: the history after a full step and the energy that it dissipated; a step of no length changes nothing."""
    real, mat, row, keep = space.real, space.mat, history_row(space, law), keep_update(space, law, tied)
    Particles, Reference, Clock = structure(space, "Particles"), structure(space, "Reference"), clock_structure(space)
    Flux, Laws, updated, take = structure(space, "Flux"), laws_structure(law), eights.update, block_of(space, law)

    @wp.kernel(module="unique", enable_backward=False)
    def update(
        first: int,
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
        block, dt, c = take(first + wp.tid(), begin, F, history), real(clock.dt[0]), laws.constants[0]
        if dt > real(0.0):
            updated(block, dt, c, flux.dissipated)
        for k in range(block.count):
            a = block.first + k
            if dt > real(0.0):
                keep(a, history[block.own + k], flux.dissipated[a], c, particles, clock, flux)
            else:
                flux.dissipated[a] = real(0.0)
                if wp.static(tied):
                    flux.slipped[a] = real(0.0)

    return update
