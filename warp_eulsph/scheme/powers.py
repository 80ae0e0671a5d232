"""What the ledger asks of a particle: work and power in a step in float64, as ``wp.func``, and energies, by kernels."""

import functools

import warp as wp

from ..fields import structure
from ..space import Space, matrix_type, vector_type


@functools.cache
def loads_power(space: Space, damped: bool) -> wp.Function:
    """``wp.func`` (power of the loads on a particle at velocity v, power of what damps among them) [W]."""
    Forces, precise = structure(space, "Forces"), vector_type(space.dim, wp.float64)

    @wp.func
    def loads_power(a: int, forces: Forces, v: precise) -> wp.vec2d:
        loads, damping = precise(forces.external[a]), wp.float64(0.0)
        if wp.static(damped):
            loads -= precise(forces.damping[a])
            damping = wp.dot(precise(forces.damping[a]), v)
        return wp.vec2d(wp.dot(loads, v), damping)

    return loads_power


@functools.cache
def note(space: Space) -> wp.Function:
    """``wp.func``: keep the end of a step as the start of the next."""
    vec, State, wide = space.vec, structure(space, "State"), wp.float64

    @wp.func
    def note(a: int, state: State, W: wp.array(dtype=wide), v_old: wp.array(dtype=vec), W_old: wp.array(dtype=wide)):
        v_old[a] = state.v[a]
        W_old[a] = W[a]

    return note


@functools.cache
def lost(space: Space, inelastic: bool) -> wp.Function:
    """``wp.func``: energy that the law of a particle dissipated in the step, 0 where none does."""
    Flux = structure(space, "Flux")

    @wp.func
    def lost(a: int, flux: Flux) -> wp.float64:
        if wp.static(inelastic):
            return wp.float64(flux.dissipated[a])
        return wp.float64(0.0)

    return lost


@functools.cache
def slipped(space: Space, yielding: bool) -> wp.Function:
    """``wp.func``: energy that a tie lost by yielding in the step (M16), 0 where none does."""
    Flux = structure(space, "Flux")

    @wp.func
    def slipped(a: int, flux: Flux) -> wp.float64:
        if wp.static(yielding):
            return wp.float64(flux.slipped[a])
        return wp.float64(0.0)

    return slipped


@functools.cache
def powers(space: Space, tied: bool, dragged: bool) -> wp.Function:
    """``wp.func``: power [W] of the stresses in Q of a particle that are the tie's and the dissipation's."""
    Flux, precise_mat = structure(space, "Flux"), matrix_type(space.dim, space.dim, wp.float64)

    @wp.func
    def powers(a: int, flux: Flux, strain_rate: precise_mat) -> wp.vec2d:
        found = wp.vec2d()
        if wp.static(tied):
            found[0] = wp.ddot(precise_mat(flux.tie[a]), strain_rate)
        if wp.static(dragged):
            found[1] = wp.ddot(precise_mat(flux.drag[a]), strain_rate)
        return found

    return powers


@functools.cache
def work(space: Space) -> wp.Function:
    """``wp.func``: force · velocity in float64."""
    vec, precise = space.vec, vector_type(space.dim, wp.float64)

    @wp.func
    def work(force: vec, v: precise) -> wp.float64:
        return wp.dot(precise(force), v)

    return work


@functools.cache
def make_subtract() -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False)
    def subtract(first: int, value: wp.array(dtype=wp.float64), out: wp.array(dtype=wp.float64)):
        a = first + wp.tid()
        out[a] = value[a] - out[a]

    return subtract


@functools.cache
def make_kinetic(space: Space) -> wp.Kernel:
    Particles, vec = structure(space, "Particles"), space.vec
    precise = wp.types.vector(length=space.dim, dtype=wp.float64)

    @wp.kernel(module="unique", enable_backward=False)
    def kinetic(first: int, particles: Particles, v: wp.array(dtype=vec), out: wp.array(dtype=wp.float64)):
        a = first + wp.tid()
        v_a = precise(v[a])
        out[a] = wp.float64(0.5) * wp.float64(particles.share[a] * particles.mass[a]) * wp.dot(v_a, v_a)

    return kinetic


@functools.cache
def make_own(space: Space) -> wp.Kernel:
    """Kernel: leave out what ghosts hold."""
    Particles = structure(space, "Particles")

    @wp.kernel(module="unique", enable_backward=False)
    def own(first: int, particles: Particles, value: wp.array(dtype=wp.float64)):
        a = first + wp.tid()
        value[a] = value[a] * wp.float64(particles.share[a])

    return own
