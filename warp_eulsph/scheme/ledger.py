"""Where the energy went: one account per mechanism, and the residual that closes the books."""

import functools
from typing import Any

import numpy as np
import warp as wp

from ..execution import Launcher
from ..fields import clock_structure, structure
from ..reduce import Sum, SumOfParticles
from ..space import Space, matrix_type, vector_type
from .flux import Flux
from .reference import Configuration
from .time_step import DeviceClock

#: Energy that each mechanism added since the start [J]; negative values were dissipated.
ACCOUNTS = ("external", "constraint", "dissipation", "material", "correction", "tie", "limiter", "stepping", "shifting")
_Entry = wp.types.vector(length=len(ACCOUNTS), dtype=wp.float64)


@functools.cache
def _note(space: Space) -> Any:
    """``wp.func``: keep the end of a step as the start of the next."""
    vec, State, wide = space.vec, structure(space, "State"), wp.float64

    @wp.func
    def note(a: int, state: State, W: wp.array(dtype=wide), v_old: wp.array(dtype=vec), W_old: wp.array(dtype=wide)):
        v_old[a] = state.v[a]
        W_old[a] = W[a]

    return note


@functools.cache
def _make_entries(space: Space, tied: bool, limited: bool, smoothed: bool, inelastic: bool) -> Any:
    """Kernel of ``SumOfParticles``: what each mechanism did in this step, by the mean velocity of the step.

    With v̄ = ½(vⁿ + v^{n+1}) a force f changes the kinetic energy by exactly Δt f·v̄. The stepping account is what the
    two-step scheme itself gains: ΔW − Δt V Q:∇v^{n+½} + Δt f_int·(v̄ − v^{n+½}), zero for an exact time integration.
    The limiter's is m Δv·v̄ plus the stored energy ΔW_limited that its change of F made, taken out of ΔW. Where the
    scheme smooths v in every step (``smoothed``, one-step Lax), Δv is that of S and m Δv·v̄ belongs to the stepping.
    The tie's is the power of its force and of its stress, which Q holds and W does not (M16). The material's is what
    the laws say that they dissipated (``inelastic``).
    """
    vec, mat = space.vec, space.mat
    Particles, Reference, State = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        structure(space, "State"),
    )
    Forces, Clock, wide = structure(space, "Forces"), clock_structure(space), wp.float64
    Flux, note = structure(space, "Flux"), _note(space)
    precise = vector_type(space.dim, wp.float64)
    precise_mat = matrix_type(space.dim, space.dim, wp.float64)

    @wp.kernel(module="unique", enable_backward=False)
    def entries(
        first: int,
        n: int,
        each: int,
        particles: Particles,
        reference: Reference,
        state: State,
        half: State,
        flux: Flux,
        grad_v: wp.array(dtype=mat),
        v_old: wp.array(dtype=vec),
        W_old: wp.array(dtype=wide),
        W: wp.array(dtype=wide),
        dv: wp.array(dtype=vec),
        dW_limited: wp.array(dtype=wide),
        clock: Clock,
        forces: Forces,
        out: wp.array(dtype=_Entry),
    ):
        block = first + wp.tid()
        dt = clock.dt[0]
        total = _Entry()
        for a in range(block * each, wp.min((block + 1) * each, n)):
            mass = wide(particles.mass[a])
            v = precise(state.v[a])
            v_mean = wide(0.5) * (precise(v_old[a]) + v)
            impulse = (v - precise(forces.free_v[a])) * mass
            strain_rate = precise_mat(grad_v[a]) * wide(reference.V[a])
            strain_power = wp.ddot(precise_mat(flux.Q[a]), strain_rate)
            tie = wide(0.0)
            if wp.static(tied):
                tied_power = wp.ddot(precise_mat(flux.tie[a]), strain_rate)
                strain_power -= tied_power
                tie = dt * (wp.dot(precise(forces.tie[a]), v_mean) - tied_power)
            lost = wide(0.0)
            if wp.static(inelastic):
                lost = wide(flux.dissipated[a])
            lag = v_mean - precise(half.v[a])
            stepping = W[a] - W_old[a] + lost - dt * strain_power + dt * wp.dot(precise(forces.internal[a]), lag)
            limiter = wide(0.0)
            if wp.static(limited):
                limiter = mass * wp.dot(precise(dv[a]), v_mean) + dW_limited[a]
                stepping -= dW_limited[a]
            if wp.static(smoothed):
                stepping += mass * wp.dot(precise(dv[a]), v_mean)
            total += wide(particles.share[a]) * _Entry(
                dt * wp.dot(precise(forces.external[a]), v_mean),
                wp.dot(impulse, v_mean),
                dt * wp.dot(precise(forces.dissipation[a]), v_mean),
                -lost,
                dt * wp.dot(precise(forces.correction[a]), v_mean),
                tie,
                limiter,
                stepping,
                wide(0.0),
            )
            if dt > wide(0.0):
                forces.reaction[a] = vec(impulse / dt)
            note(a, state, W, v_old, W_old)
        out[block] = total

    return entries


@functools.cache
def _make_shift_entry(space: Space) -> Any:
    """Kernel of ``SumOfParticles``: energy gained since the last entry, all of it by shifting (M15)."""
    vec, Particles, State, wide = space.vec, structure(space, "Particles"), structure(space, "State"), wp.float64
    precise = vector_type(space.dim, wp.float64)
    last, note = len(ACCOUNTS) - 1, _note(space)

    @wp.kernel(module="unique", enable_backward=False)
    def shift_entry(
        first: int,
        n: int,
        each: int,
        particles: Particles,
        state: State,
        v_old: wp.array(dtype=vec),
        W_old: wp.array(dtype=wide),
        W: wp.array(dtype=wide),
        out: wp.array(dtype=_Entry),
    ):
        block = first + wp.tid()
        total = wide(0.0)
        for a in range(block * each, wp.min((block + 1) * each, n)):
            v, before = precise(state.v[a]), precise(v_old[a])
            gain = wide(0.5) * wide(particles.mass[a]) * wp.dot(v - before, v + before) + W[a] - W_old[a]
            total += wide(particles.share[a]) * gain
            note(a, state, W, v_old, W_old)
        entry = _Entry()
        entry[last] = total
        out[block] = entry

    return shift_entry


@functools.cache
def _make_subtract() -> Any:
    @wp.kernel(module="unique", enable_backward=False)
    def subtract(value: wp.array(dtype=wp.float64), out: wp.array(dtype=wp.float64)):
        a = wp.tid()
        out[a] = value[a] - out[a]

    return subtract


@functools.cache
def _make_kinetic(space: Space) -> Any:
    Particles, vec = structure(space, "Particles"), space.vec
    precise = wp.types.vector(length=space.dim, dtype=wp.float64)

    @wp.kernel(module="unique", enable_backward=False)
    def kinetic(particles: Particles, v: wp.array(dtype=vec), out: wp.array(dtype=wp.float64)):
        a = wp.tid()
        v_a = precise(v[a])
        out[a] = wp.float64(0.5) * wp.float64(particles.share[a] * particles.mass[a]) * wp.dot(v_a, v_a)

    return kinetic


@functools.cache
def _make_own(space: Space) -> Any:
    """Kernel: leave out what ghosts hold."""
    Particles = structure(space, "Particles")

    @wp.kernel(module="unique", enable_backward=False)
    def own(particles: Particles, value: wp.array(dtype=wp.float64)):
        a = wp.tid()
        value[a] = value[a] * wp.float64(particles.share[a])

    return own


@functools.cache
def _make_book() -> Any:
    @wp.kernel(module="unique", enable_backward=False)
    def book(step: wp.array(dtype=_Entry), total: wp.array(dtype=_Entry)):
        total[0] = total[0] + step[0]

    return book


class Ledger:
    """Energy accounts on the device, booked every step in float64 and read when asked.

    ``limiter`` is None, or has the velocity change ``dv`` [m/s] that it made in the step, (n,) of vec.
    """

    def __init__(
        self,
        space: Space,
        particles: Any,
        flux: Flux,
        configuration: Configuration,
        clock: DeviceClock,
        limiter: Any,
        device: Any,
    ):
        n = len(particles.mass)
        self.space, self.particles, self.flux, self.device = space, particles, flux, device
        self._launch = Launcher(device)
        self.configuration, self.clock, self.limiter = configuration, clock, limiter
        self._v_old = wp.zeros(n, dtype=space.vec, device=device)
        self._W_old, self._W = (wp.zeros(n, dtype=wp.float64, device=device) for _ in range(2))
        self._dW_limited = wp.zeros(n if limiter is not None else 0, dtype=wp.float64, device=device)
        self._step, self._total = (wp.zeros(1, dtype=_Entry, device=device) for _ in range(2))
        self._energy = wp.zeros(1, dtype=wp.float64, device=device)
        self._sum_entries, self._sum = SumOfParticles(_Entry, n, device), Sum(wp.float64, n, device)
        self.start, self._most = 0.0, 0.0

    def open(self, U: Any) -> None:
        """Start the books at state ``U``."""
        wp.copy(self._v_old, U.v)
        self.flux.energy(U.F, self._W_old)
        self._total.zero_()
        self.start = self.kinetic(U) + self.stored(U)

    def evolving(self) -> dict[str, wp.array]:
        """The accounts and the end of the last step booked, by name; with ``start`` what a checkpoint must hold."""
        return {"Ledger.total": self._total, "Ledger.v_old": self._v_old, "Ledger.W_old": self._W_old}

    def open_limiter(self, U: Any) -> None:
        """Note the stored energies before the limiter changes ``U``."""
        self.flux.energy(U.F, self._dW_limited)

    def close_limiter(self, U: Any) -> None:
        """Note what the limiter did to the stored energies."""
        self.flux.energy(U.F, self._W)
        wp.launch(_make_subtract(), len(self._W), [self._W, self._dW_limited], device=self.device)

    def record(self, U: Any, half: Any, grad_v: wp.array, forces: Any, smoothed: wp.array | None = None) -> None:
        """Book a step that ended in ``U``, with the half state, ∇v^{n+½} and the forces of the full step.

        ``smoothed`` is S(v) − v [m/s] of a scheme whose full step smooths, (n,) of vec.
        """
        self.flux.energy(U.F, self._W)
        arguments = [self.particles, self.configuration.fields, U, half, self.flux.fields, grad_v]
        dv = smoothed
        if dv is None:
            dv = self.limiter.dv if self.limiter is not None else self._v_old
        arguments += [self._v_old, self._W_old, self._W, dv, self._dW_limited]
        arguments += [self.clock.fields, forces]
        tied, inelastic = len(self.flux.fields.tie) > 0, len(self.flux.fields.dissipated) > 0
        kernel = _make_entries(self.space, tied, self.limiter is not None, smoothed is not None, inelastic)
        self._book(kernel, arguments)

    def book_shift(self, U: Any) -> None:
        """Book what shifting did to ``U`` since the last step."""
        self.flux.energy(U.F, self._W)
        self._book(_make_shift_entry(self.space), [self.particles, U, self._v_old, self._W_old, self._W])

    def _book(self, kernel: Any, arguments: list[Any]) -> None:
        self._sum_entries(kernel, arguments, self._step)
        self._launch.once(_make_book(), 1, [self._step, self._total])

    def kinetic(self, U: Any) -> float:
        """Kinetic energy [J]; reads the device."""
        wp.launch(_make_kinetic(self.space), len(self._W), [self.particles, U.v, self._W], device=self.device)
        self._sum(self._W, self._energy)
        return float(self._energy.numpy()[0])

    def stored(self, U: Any) -> float:
        """Stored energy [J]; reads the device."""
        self.flux.energy(U.F, self._W)
        wp.launch(_make_own(self.space), len(self._W), [self.particles, self._W], device=self.device)
        self._sum(self._W, self._energy)
        return float(self._energy.numpy()[0])

    def accounts(self) -> dict[str, float]:
        """Energy that each mechanism added since the start [J]; reads the device."""
        return dict(zip(ACCOUNTS, np.asarray(self._total.numpy()[0]).tolist(), strict=True))

    def made(self) -> float:
        """Energy that the steps themselves made, over the most that was put in at any look; reads the device."""
        accounts = self.accounts()
        put_in = abs(self.start) + sum(max(accounts[name], 0.0) for name in ("external", "constraint", "limiter"))
        self._most = max(self._most, put_in)
        return max(accounts["stepping"], 0.0) / self._most if self._most > 0.0 else 0.0

    def residual(self, U: Any) -> float:
        """Energy that no account explains [J]; round-off if the operators are duals of each other."""
        return self.kinetic(U) + self.stored(U) - self.start - sum(self.accounts().values())
