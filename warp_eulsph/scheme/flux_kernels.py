"""Kernels of what materials say of each particle: stress, wave speeds, stored energy, what laws remember."""

import functools

import warp as wp

from ..atomics import lower_at, raise_at
from ..fields import clock_structure, structure
from ..linalg import det, inverse, largest_shortening
from ..materials import Law
from ..materials.base import history_row, long_form
from ..space import Space
from .laws import constants_of_body, laws_structure
from .reference import resolution


@functools.cache
def velocity_gradient(space: Space, fixed: bool) -> wp.Function:
    """``wp.func`` l = Ḟ F⁻¹ of particle a, whose deformation gradient is F, from ∇_k v."""
    mat, Reference, invert = space.mat, structure(space, "Reference"), inverse(space)

    @wp.func
    def velocity_gradient(a: int, F: mat, grad_v: mat, reference: Reference) -> mat:
        if wp.static(fixed):
            return grad_v @ invert(F)
        return grad_v @ reference.F[a] @ invert(F)

    return velocity_gradient


@functools.cache
def keep_flux(space: Space, fixed: bool, dual: bool) -> wp.Function:
    """``wp.func`` that keeps the stress P of particle a as the flux Q in the reference, and Π = Q Lᵀ."""
    mat, determinant = space.mat, det(space)
    Reference, Flux = structure(space, "Reference"), structure(space, "Flux")

    @wp.func
    def keep_flux(a: int, P: mat, reference: Reference, flux: Flux):
        Q = P
        if wp.static(not fixed):
            F_k = reference.F[a]
            Q = P @ wp.transpose(F_k) / determinant(F_k)
        flux.Q[a] = Q
        if wp.static(dual):
            flux.Pi[a] = Q @ wp.transpose(reference.L[a])

    return keep_flux


@functools.cache
def make_flux(space: Space, law: Law, several: bool, fixed: bool, dual: bool) -> wp.Kernel:
    mat, real, keep = space.mat, space.real, keep_flux(space, fixed, dual)
    Reference, Flux, Clock = structure(space, "Reference"), structure(space, "Flux"), clock_structure(space)
    Laws, row, remembers = laws_structure(law), history_row(space, law), bool(law.history)
    P_of, rate_of = long_form(space, law).stress, velocity_gradient(space, fixed)
    Particles, constants_of = structure(space, "Particles"), constants_of_body(space, law, several)

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
        a = first + wp.tid()
        c = constants_of(a, particles, laws)
        rate = mat()
        h = row()
        ahead = real(0.0)
        if wp.static(remembers):
            rate = rate_of(a, F[a], grad_v[a], reference)
            h = history[a - begin]
            ahead = real(fraction * clock.dt[clock.run[a]])
        keep(a, P_of(F[a], rate, h, ahead, c), reference, flux)

    return compute_flux


@functools.cache
def rate_with_viscosity(real: type) -> wp.Function:
    """``wp.func`` (rate of waves r, of viscosity s) -> what Δt is to be counted by [1/s] (M22).

    Waves of the frequency ω ≤ 2 r and the decay λ ≤ 4 s, of the same operator, are stable in a step that takes the
    viscous force at its start where (ω Δt)² + 2 λ Δt ≤ 4, by determinant and trace of a step: r² Δt² + 2 s Δt ≤ 1.
    """

    @wp.func
    def rate_with_viscosity(r: real, s: real) -> real:
        return s + wp.sqrt(s * s + r * r)

    return rate_with_viscosity


# Largest |∇v| Δt over the Courant number. Single particles can outrun the waves where an arrangement is lost, and would
# pass through their neighbours in one step: without this the punch at 50² to 90² fails now and then.
STRAIN = 0.25


@functools.cache
def keep_speeds(space: Space, law: Law, fixed: bool) -> wp.Function:
    """``wp.func`` that keeps the wave speeds of particle a, of wave moduli M, and raises the rate of the clock."""
    real, mat, pair, row, dim = space.real, space.mat, space.row(2), history_row(space, law), float(space.dim)
    Particles, Reference, Flux = structure(space, "Particles"), structure(space, "Reference"), structure(space, "Flux")
    Clock, Constants, invert, shortening_of = (
        clock_structure(space),
        law.Constants,
        inverse(space),
        largest_shortening(space),
    )
    drag_of, viscous, rate_of = law.viscosity, law.viscosity is not None, velocity_gradient(space, fixed)
    raise_rate, resolution_of, with_viscosity = raise_at(real), resolution(space), rate_with_viscosity(real)

    @wp.func
    def keep_speeds(
        a: int,
        M: pair,
        F: mat,
        grad_v: mat,
        h: row,
        c: Constants,
        particles: Particles,
        reference: Reference,
        flux: Flux,
        clock: Clock,
    ):
        # A wave of speed c runs at c |G⁻¹| when distances are measured in the reference, G = F F_k⁻¹.
        G = F
        if wp.static(not fixed):
            G = G @ invert(reference.F[a])
        shortening = shortening_of(G)  # squared
        per_density = shortening * particles.V0[a] / particles.mass[a]
        speed = wp.sqrt(wp.max(M[0], real(0.0)) * per_density)
        shear_speed = wp.sqrt(wp.max(M[1], real(0.0)) * per_density)
        rho_k = particles.mass[a] / reference.V[a]
        flux.speed[a] = speed
        flux.impedance[a] = rho_k * speed
        flux.shear_impedance[a] = rho_k * shear_speed
        if wp.static(fixed):
            per_length = reference.resolution[a]
        else:
            per_length = resolution_of(a, particles, reference)
        rate = speed * per_length
        if wp.static(viscous):
            nu = drag_of(F, rate_of(a, F, grad_v, reference), h, c) * per_density
            rate = with_viscosity(rate, nu * per_length * per_length)
        # |∇v G⁻¹| ≤ |∇v| |G⁻¹| and, of the bound, |G⁻¹|² ≤ d · shortening: seldom is more than that asked for
        strain_rate = real(STRAIN) * rate
        if wp.ddot(grad_v, grad_v) * shortening * real(dim) > strain_rate * strain_rate:
            D = grad_v @ invert(G)
            rate = wp.max(rate, wp.sqrt(wp.ddot(D, D)) / real(STRAIN))
        raise_rate(clock.rate, clock.run[a], rate)

    return keep_speeds


@functools.cache
def make_wave_speeds(space: Space, law: Law, several: bool, fixed: bool) -> wp.Kernel:
    mat, row, remembers, keep = space.mat, history_row(space, law), bool(law.history), keep_speeds(space, law, fixed)
    Particles, Reference, Flux = structure(space, "Particles"), structure(space, "Reference"), structure(space, "Flux")
    Clock, Laws, moduli = clock_structure(space), laws_structure(law), long_form(space, law).wave_moduli
    constants_of = constants_of_body(space, law, several)

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
        a = first + wp.tid()
        c = constants_of(a, particles, laws)
        h = row()
        if wp.static(remembers):
            h = history[a - begin]
        keep(a, moduli(F[a], h, c), F[a], grad_v[a], h, c, particles, reference, flux, clock)

    return wave_speeds


@functools.cache
def make_moduli(space: Space, law: Law) -> wp.Kernel:
    """Kernel of one thread: the wave moduli at F = I."""
    real, dim, pair, Constants = space.real, space.dim, space.row(2), law.Constants
    row, moduli = history_row(space, law), long_form(space, law).wave_moduli

    @wp.kernel(module="unique", enable_backward=False)
    def moduli_at_rest(start: wp.array(dtype=row), c: Constants, out: wp.array(dtype=pair)):
        M = moduli(wp.identity(n=wp.static(dim), dtype=real), start[0], c)
        out[0] = pair(M[0], M[1])

    return moduli_at_rest


@functools.cache
def make_energy(space: Space, law: Law, several: bool) -> wp.Kernel:
    mat, row, remembers = space.mat, history_row(space, law), bool(law.history)
    Particles, Laws, density = structure(space, "Particles"), laws_structure(law), long_form(space, law).energy
    constants_of = constants_of_body(space, law, several)

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
        a = first + wp.tid()
        c = constants_of(a, particles, laws)
        h = row()
        if wp.static(remembers):
            h = history[a - begin]
        out[a] = wp.float64(particles.V0[a] * density(F[a], h, c))

    return energy


@functools.cache
def make_forget(space: Space, law: Law, several: bool) -> wp.Kernel:
    """Kernel: what a law without a history leaves of F after a full step."""
    mat, Laws, kept = space.mat, laws_structure(law), law.update
    Particles, constants_of = structure(space, "Particles"), constants_of_body(space, law, several)

    @wp.kernel(module="unique", enable_backward=False)
    def forget(first: int, F: wp.array(dtype=mat), particles: Particles, laws: Laws):
        a = first + wp.tid()
        c = constants_of(a, particles, laws)
        F[a] = kept(F[a], c)

    return forget


@functools.cache
def keep_update(space: Space, law: Law, tied: bool) -> wp.Function:
    """``wp.func`` that books what the update of particle a, with history h now, dissipated per initial volume.

    A particle whose history is not finite is bad: its law found no state. Where the law yields and is ``tied``, so does
    the tie (M16).
    """
    real, row, length, secant_of = space.real, history_row(space, law), len(law.start), law.secant
    Particles, Flux, Clock = structure(space, "Particles"), structure(space, "Flux"), clock_structure(space)
    Constants = law.Constants

    @wp.func
    def keep_update(a: int, h: row, lost: real, c: Constants, particles: Particles, clock: Clock, flux: Flux):
        flux.dissipated[a] = particles.V0[a] * lost
        if wp.static(tied):
            secant = wp.sqrt(secant_of(h, c))
            flux.slipped[a] = (flux.secant[a] - secant) * flux.tied[a]
            flux.secant[a] = secant
        nothing = real(0.0)  # NaN as soon as a component is not finite
        for i in range(wp.static(length)):
            nothing += h[i] * real(0.0)
        if nothing != real(0.0):
            lower_at(clock.bad, clock.run[a], clock.first + a)

    return keep_update


@functools.cache
def make_update(space: Space, law: Law, several: bool, fixed: bool, tied: bool) -> wp.Kernel:
    """Kernel: the history after a full step and the energy that it dissipated; a step of no length changes nothing."""
    real, mat, row, keep = space.real, space.mat, history_row(space, law), keep_update(space, law, tied)
    Particles, Reference, Clock = structure(space, "Particles"), structure(space, "Reference"), clock_structure(space)
    Flux, Laws, updated = structure(space, "Flux"), laws_structure(law), law.update
    rate_of, constants_of = velocity_gradient(space, fixed), constants_of_body(space, law, several)

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
        a = first + wp.tid()
        c = constants_of(a, particles, laws)
        flux.dissipated[a] = real(0.0)
        if wp.static(tied):
            flux.slipped[a] = real(0.0)
        dt = real(clock.dt[clock.run[a]])
        if dt > real(0.0):
            rate = rate_of(a, F[a], grad_v[a], reference)
            F_a, h, lost = updated(F[a], rate, history[a - begin], dt, c)
            F[a] = F_a
            history[a - begin] = h
            keep(a, h, lost, c, particles, clock, flux)

    return update


@functools.cache
def make_rebase(space: Space, law: Law, several: bool) -> wp.Kernel:
    """Kernel: F and history as a new reference takes them."""
    mat, row, Laws, rebased = space.mat, history_row(space, law), laws_structure(law), law.rebase
    Particles, constants_of = structure(space, "Particles"), constants_of_body(space, law, several)

    @wp.kernel(module="unique", enable_backward=False)
    def rebase(
        first: int,
        begin: int,
        F: wp.array(dtype=mat),
        history: wp.array(dtype=row),
        particles: Particles,
        laws: Laws,
    ):
        a = first + wp.tid()
        c = constants_of(a, particles, laws)
        F_a, h = rebased(F[a], history[a - begin], c)
        F[a] = F_a
        history[a - begin] = h

    return rebase
