"""The updates of a step: momentum, deformation gradient, positions and surface vectors (M8)."""

import functools

import warp as wp

from ..fields import clock_structure, element, structure
from ..linalg import cofactor, det
from ..space import Space


@functools.cache
def moved_surface(space: Space) -> wp.Function:
    """``wp.func`` Nanson's rule: the area vector s moved from F to F_new, cof(F_new F⁻¹) s, without the inverse.

    In no time, ``tau`` = 0, it is s to the last bit.
    """
    real, vec, mat, determinant, cof = space.real, space.vec, space.mat, det(space), cofactor(space)

    @wp.func
    def moved_surface(s: vec, F: mat, F_new: mat, tau: real) -> vec:
        if tau == real(0.0):
            return s
        return cof(F_new) @ (wp.transpose(F) @ s) / determinant(F)

    return moved_surface


@functools.cache
def step_of_particle(space: Space) -> wp.Function:
    """``wp.func`` Δt [s] of particle a. Kernels that do little else take a tenth longer where they look up its run."""
    Clock = clock_structure(space)

    @wp.func
    def step_of_particle(clock: Clock, a: int) -> wp.float64:
        if clock.every == 0:
            return clock.dt[0]
        return clock.dt[clock.run[a]]

    return step_of_particle


@functools.cache
def make_predict(space: Space, fixed: bool, surfaces: bool) -> wp.Kernel:
    """Kernel: the half step, ``fraction`` = ½, from ``half`` = S(U) (M8); the one-step Lax scheme has 1."""
    real, mat = space.real, space.mat
    Particles, State, Forces = structure(space, "Particles"), structure(space, "State"), structure(space, "Forces")
    Clock, moved, step_of = clock_structure(space), moved_surface(space), step_of_particle(space)

    @wp.kernel(module="unique", enable_backward=False)
    def predict(
        first: int,
        particles: Particles,
        state: State,
        smoothed_F_k: wp.array(dtype=mat),
        grad_v: wp.array(dtype=mat),
        forces: Forces,
        clock: Clock,
        fraction: wp.float64,
        half: State,
    ):
        a = first + wp.tid()
        tau = real(fraction * step_of(clock, a))
        force = forces.internal[a] + forces.correction[a] + forces.tie[a] + forces.dissipation[a] + forces.external[a]
        half.v[a] = half.v[a] + force * (tau / particles.mass[a])
        dF = grad_v[a] * tau
        if wp.static(not fixed):
            dF = dF @ smoothed_F_k[a]
        half.F[a] = half.F[a] + dF
        half.x[a] = state.x[a] + state.v[a] * tau
        if wp.static(surfaces):
            half.surface[a] = moved(state.surface[a], state.F[a], state.F[a] + dF, tau)

    return predict


@functools.cache
def make_add(space: Space) -> wp.Kernel:
    """Kernel: the forces of an interaction added to those from outside."""
    vec = space.vec

    @wp.kernel(module="unique", enable_backward=False)
    def add(first: int, forces: wp.array(dtype=vec), external: wp.array(dtype=vec)):
        a = first + wp.tid()
        external[a] = external[a] + forces[a]

    return add


@functools.cache
def make_mean(space: Space, kind: str) -> wp.Kernel:
    """Kernel: f ← ½(f + f_new), elements of this kind (``fields.element``)."""
    real, of_kind = space.real, element(space, kind)

    @wp.kernel(module="unique", enable_backward=False)
    def mean(first: int, f_new: wp.array(dtype=of_kind), f: wp.array(dtype=of_kind)):
        a = first + wp.tid()
        f[a] = (f[a] + f_new[a]) * real(0.5)

    return mean


@functools.cache
def make_kick(space: Space) -> wp.Kernel:
    """Kernel: v^{n+1} (M8)."""
    real, vec = space.real, space.vec
    Particles, Forces, Clock = structure(space, "Particles"), structure(space, "Forces"), clock_structure(space)
    step_of = step_of_particle(space)

    @wp.kernel(module="unique", enable_backward=False)
    def kick(first: int, particles: Particles, forces: Forces, clock: Clock, v: wp.array(dtype=vec)):
        a = first + wp.tid()
        force = forces.internal[a] + forces.correction[a] + forces.tie[a] + forces.dissipation[a] + forces.external[a]
        v[a] = v[a] + force * (real(step_of(clock, a)) / particles.mass[a])

    return kick


@functools.cache
def make_drift(space: Space, fixed: bool, surfaces: bool) -> wp.Kernel:
    """Kernel: F, x and the surface vectors of ``state`` moved by ``fraction`` · Δt with velocity v (M8)."""
    real, vec, mat = space.real, space.vec, space.mat
    State, Reference, Clock = structure(space, "State"), structure(space, "Reference"), clock_structure(space)
    moved, step_of = moved_surface(space), step_of_particle(space)

    @wp.kernel(module="unique", enable_backward=False)
    def drift(
        first: int,
        reference: Reference,
        state: State,
        v: wp.array(dtype=vec),
        grad_v: wp.array(dtype=mat),
        clock: Clock,
        fraction: wp.float64,
        out: State,
    ):
        a = first + wp.tid()
        tau = real(fraction * step_of(clock, a))
        dF = grad_v[a] * tau
        if wp.static(not fixed):
            dF = dF @ reference.F[a]
        F_new = state.F[a] + dF
        if wp.static(surfaces):
            out.surface[a] = moved(state.surface[a], state.F[a], F_new, tau)
        out.F[a] = F_new
        out.x[a] = state.x[a] + v[a] * tau

    return drift
