"""Where the energy went: one account per mechanism, and the residual that closes the books."""

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from ..execution import Launcher
from ..fields import clock_structure, part_of, structure
from ..reduce import SumOfParticles, sum_of
from ..space import Space, matrix_type, vector_type
from ..structs import ParticleArrays, StateArrays
from .exchanges import Exchanges
from .medium import Medium
from .powers import loads_power, lost, make_kinetic, make_own, make_subtract, note, powers, slipped, work
from .time_step import DeviceClock

#: Energy that each mechanism added since the start [J]; negative values were dissipated.
ACCOUNTS = (
    "external",
    "constraint",
    "damping",
    "dissipation",
    "material",
    "correction",
    "tie",
    "limiter",
    "stepping",
    "shifting",
)
#: Those by which energy comes in.
PUT_IN = ("external", "constraint", "limiter")
_Entry = wp.types.vector(length=len(ACCOUNTS), dtype=wp.float64)


@functools.cache
def _make_entries(
    space: Space,
    tied: bool,
    dragged: bool,
    limited: bool,
    smoothed: bool,
    damped: bool,
    inelastic: bool,
    yielding: bool,
) -> wp.Kernel:
    """Kernel of ``SumOfParticles``: what each mechanism did in this step, by the mean velocity of the step.

    With v̄ = ½(vⁿ + v^{n+1}) a force f changes the kinetic energy by exactly Δt f·v̄. The stepping account is what the
    two-step scheme itself gains: ΔW − Δt V Q:∇v^{n+½} + Δt f_int·(v̄ − v^{n+½}), zero for an exact time integration.
    The limiter's is m Δv·v̄ plus the stored energy ΔW_limited that its change of F made, taken out of ΔW. Where the
    scheme smooths v in every step (``smoothed``, one-step Lax), Δv is that of S and m Δv·v̄ belongs to the stepping.
    The tie's is the power of its force and of its stress, which Q holds and W does not (M16); the dissipation's too,
    where it has a stress (M9). The material's is what the laws say that they dissipated (``inelastic``), and what the
    tie lost where they yield (``yielding``).
    """
    vec, mat = space.vec, space.mat
    Particles, Reference, State = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        structure(space, "State"),
    )
    Forces, Clock, wide = structure(space, "Forces"), clock_structure(space), wp.float64
    Flux, keep, work_of, lost_of = structure(space, "Flux"), note(space), work(space), lost(space, inelastic)
    slipped_of = slipped(space, yielding)
    precise, pairs_power = vector_type(space.dim, wp.float64), powers(space, tied, dragged)
    power_of = loads_power(space, damped)
    precise_mat = matrix_type(space.dim, space.dim, wp.float64)

    @wp.kernel(module="unique", enable_backward=False)
    def entries(
        first: int,
        bounds: wp.array(dtype=wp.int32),
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
        dt, total = clock.dt[clock.run[bounds[block]]], _Entry()
        for a in range(bounds[block], bounds[block + 1]):
            mass, v = wide(particles.mass[a]), precise(state.v[a])
            v_mean = wide(0.5) * (precise(v_old[a]) + v)
            impulse = (v - precise(forces.free_v[a])) * mass
            strain_rate = precise_mat(grad_v[a]) * wide(reference.V[a])
            of_pairs = pairs_power(a, flux, strain_rate)
            strain_power = wp.ddot(precise_mat(flux.Q[a]), strain_rate) - of_pairs[0] - of_pairs[1]
            lost, slip = lost_of(a, flux), slipped_of(a, flux)
            stepping = W[a] - W_old[a] + lost - dt * strain_power
            stepping += dt * work_of(forces.internal[a], v_mean - precise(half.v[a]))
            limiter = wide(0.0)
            if wp.static(limited):
                limiter = mass * wp.dot(precise(dv[a]), v_mean) + dW_limited[a]
                stepping -= dW_limited[a]
            if wp.static(smoothed):
                stepping += mass * wp.dot(precise(dv[a]), v_mean)
            loads = power_of(a, forces, v_mean)
            total += wide(particles.share[a]) * _Entry(
                dt * loads[0],
                wp.dot(impulse, v_mean),
                dt * loads[1],
                dt * (work_of(forces.dissipation[a], v_mean) - of_pairs[1]),
                -lost - slip,
                dt * work_of(forces.correction[a], v_mean),
                dt * (work_of(forces.tie[a], v_mean) - of_pairs[0]) + slip,
                limiter,
                stepping,
                wide(0.0),
            )
            if dt > wide(0.0):
                forces.reaction[a] = vec(impulse / dt)
            keep(a, state, W, v_old, W_old)
        out[block] = total

    return entries


@functools.cache
def _make_shift_entry(space: Space) -> wp.Kernel:
    """Kernel of ``SumOfParticles``: energy gained since the last entry, all of it by shifting (M15)."""
    vec, Particles, State, wide = space.vec, structure(space, "Particles"), structure(space, "State"), wp.float64
    precise = vector_type(space.dim, wp.float64)
    last, keep = len(ACCOUNTS) - 1, note(space)

    @wp.kernel(module="unique", enable_backward=False)
    def shift_entry(
        first: int,
        bounds: wp.array(dtype=wp.int32),
        particles: Particles,
        state: State,
        v_old: wp.array(dtype=vec),
        W_old: wp.array(dtype=wide),
        W: wp.array(dtype=wide),
        out: wp.array(dtype=_Entry),
    ):
        block = first + wp.tid()
        total = wide(0.0)
        for a in range(bounds[block], bounds[block + 1]):
            v, before = precise(state.v[a]), precise(v_old[a])
            gain = wide(0.5) * wide(particles.mass[a]) * wp.dot(v - before, v + before) + W[a] - W_old[a]
            total += wide(particles.share[a]) * gain
            keep(a, state, W, v_old, W_old)
        entry = _Entry()
        entry[last] = total
        out[block] = entry

    return shift_entry


@functools.cache
def _make_book() -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False)
    def book(first: int, step: wp.array(dtype=_Entry), total: wp.array(dtype=_Entry)):
        r = first + wp.tid()
        total[r] = total[r] + step[r]

    return book


class _Page:
    """The books of one medium: what its particles have in the arrays of all, and the entries of its runs."""

    def __init__(
        self,
        medium: Medium,
        clock: DeviceClock,
        v_old: wp.array,
        W_old: wp.array,
        W: wp.array,
        dW_limited: wp.array,
        total: wp.array,
    ):
        self.medium, span = medium, medium.span
        self.v_old, self.W_old, self.W = (part_of(array, span) for array in (v_old, W_old, W))
        self.dW_limited = part_of(dW_limited, span)
        runs = clock.runs_of(span)
        self.sum_entries = SumOfParticles(_Entry, [len(part) for part in runs.values()], v_old.device)
        self.total = total[min(runs) : max(runs) + 1]
        self.step = wp.zeros(len(runs), dtype=_Entry, device=v_old.device)


class Ledger:
    """Energy accounts of each run on the device, booked every step in float64 and read when asked.

    What is told of all runs together leaves out those that have failed.

    What interactions do has an account where there are any: their work on the bodies and what they hold themselves.

    Attributes:
        v_old: velocities [m/s] at the end of the last step booked, (n,) of vec.
    """

    def __init__(
        self,
        space: Space,
        particles: ParticleArrays,
        media: Sequence[Medium],
        clock: DeviceClock,
        device: wp.DeviceLike,
        exchanges: Exchanges | None = None,
        damped: bool = False,
    ):
        n = len(particles.mass)
        self.space, self.particles, self.clock, self.device = space, particles, clock, device
        self._launch = Launcher(device)
        limited = any(medium.limiter is not None for medium in media)
        self.v_old = wp.zeros(n, dtype=space.vec, device=device)
        self._W_old, self._W = (wp.zeros(n, dtype=wp.float64, device=device) for _ in range(2))
        self._dW_limited = wp.zeros(n if limited else 0, dtype=wp.float64, device=device)
        runs, arrays = len(clock.sizes), (self.v_old, self._W_old, self._W, self._dW_limited)
        self._total = wp.zeros(runs, dtype=_Entry, device=device)
        self._pages = [_Page(medium, clock, *arrays, self._total) for medium in media]
        self._energy = wp.zeros(runs, dtype=wp.float64, device=device)
        self._sum = sum_of(wp.float64, clock.sizes, device)
        self._starts = wp.zeros(runs, dtype=wp.float64, device=device)
        self._start, self._most = 0.0, np.zeros(runs)
        self._exchanges, self._damped = exchanges, damped

    def open(self, U: StateArrays) -> None:
        """Start the books at state ``U``."""
        wp.copy(self.v_old, U.v)
        for page in self._pages:
            page.medium.flux.energy(page.medium.of(U).F, page.W_old)
        self._total.zero_()
        if self._exchanges is not None:
            self._exchanges.open()
        starts = self.kinetic_of_runs(U) + self.stored_of_runs(U) + self.held()
        self._starts.assign(starts)
        self._start = float(starts[0])

    def evolving(self) -> dict[str, wp.array]:
        """The accounts and the end of the last step booked, by name; with ``start`` what a checkpoint must hold."""
        held = {"Ledger.total": self._total, "Ledger.v_old": self.v_old, "Ledger.W_old": self._W_old}
        if self.clock.independent:
            held["Ledger.start"] = self._starts
        return held if self._exchanges is None else held | self._exchanges.evolving()

    def open_limiter(self, U: StateArrays) -> None:
        """Note the stored energies before limiters change ``U``."""
        for page in self._limited():
            page.medium.flux.energy(page.medium.of(U).F, page.dW_limited)

    def close_limiter(self, U: StateArrays) -> None:
        """Note what limiters did to the stored energies."""
        for page in self._limited():
            page.medium.flux.energy(page.medium.of(U).F, page.W)
            self._launch(make_subtract(), len(page.W), [page.W, page.dW_limited])

    def _limited(self) -> list[_Page]:
        return [page for page in self._pages if page.medium.limiter is not None]

    def record(self, U: StateArrays, half: StateArrays, smoothed: Sequence[wp.array] | None = None) -> None:
        """Book a step that ended in ``U``, with the half state; its media have ∇v^{n+½} and the forces.

        ``smoothed`` is S(v) − v [m/s] of a scheme whose full step smooths, (particles of the medium,) of vec for each.
        """
        if self._exchanges is not None:
            self._exchanges.record(U, self.v_old, self._total, ACCOUNTS.index("external"))
        for k, page in enumerate(self._pages):
            medium, limiter = page.medium, page.medium.limiter
            flux = medium.flux
            flux.energy(medium.of(U).F, page.W)
            arguments = [medium.particles, medium.configuration.fields, medium.of(U), medium.of(half)]
            dv = page.v_old if limiter is None else limiter.dv
            if smoothed is not None:
                dv = smoothed[k]
            arguments += [flux.fields, medium.grad_v, page.v_old, page.W_old, page.W, dv, page.dW_limited]
            arguments += [medium.clock, medium.forces]
            tied, dragged = len(flux.fields.tie) > 0, len(flux.fields.drag) > 0
            limits, smooths, inelastic = limiter is not None, smoothed is not None, len(flux.fields.dissipated) > 0
            yielding = len(flux.fields.slipped) > 0
            kernel = _make_entries(self.space, tied, dragged, limits, smooths, self._damped, inelastic, yielding)
            self._book(page, kernel, arguments)

    def book_shift(self, U: StateArrays) -> None:
        """Book what shifting did to ``U`` since the last step."""
        for page in self._pages:
            medium = page.medium
            medium.flux.energy(medium.of(U).F, page.W)
            arguments = [medium.particles, medium.of(U), page.v_old, page.W_old, page.W]
            self._book(page, _make_shift_entry(self.space), arguments)

    def _book(self, page: _Page, kernel: wp.Kernel, arguments: list[Any]) -> None:
        page.sum_entries(kernel, arguments, page.step)
        self._launch(_make_book(), len(page.step), [page.step, page.total])

    @property
    def start(self) -> float:
        """Energy at the start [J]; may be set where there is one clock."""
        return float(self.clock.total(self._starts.numpy())) if self.clock.independent else self._start

    @start.setter
    def start(self, energy: float) -> None:
        self._start = energy

    def kinetic(self, U: StateArrays) -> float:
        """Kinetic energy [J]; reads the device."""
        return float(self.clock.total(self.kinetic_of_runs(U)))

    def kinetic_of_runs(self, U: StateArrays) -> np.ndarray:
        """Kinetic energy [J] of each run, (runs,); reads the device."""
        self._launch(make_kinetic(self.space), len(self._W), [self.particles, U.v, self._W])
        self._sum(self._W, self._energy)
        return self._energy.numpy().copy()

    def stored_by_particle(self, U: StateArrays) -> np.ndarray:
        """Stored energy [J] of each particle, by place, (n,); reads the device."""
        self._store(U)
        return self._W.numpy().copy()

    def _store(self, U: StateArrays) -> None:
        for page in self._pages:
            page.medium.flux.energy(page.medium.of(U).F, page.W)

    def stored(self, U: StateArrays) -> float:
        """Stored energy [J]; reads the device."""
        return float(self.clock.total(self.stored_of_runs(U)))

    def stored_of_runs(self, U: StateArrays) -> np.ndarray:
        """Stored energy [J] of each run, (runs,); reads the device."""
        self._store(U)
        self._launch(make_own(self.space), len(self._W), [self.particles, self._W])
        self._sum(self._W, self._energy)
        return self._energy.numpy().copy()

    def held(self) -> float:
        """Energy that interactions hold [J]; reads the device."""
        return 0.0 if self._exchanges is None else self._exchanges.held()

    def exchanged(self) -> list[float]:
        """Energy that each interaction added since the start [J], with what it holds; reads the device."""
        return [] if self._exchanges is None else self._exchanges.accounts()

    def accounts(self) -> dict[str, float]:
        """Energy that each mechanism added since the start [J], interactions where there are any; reads the device."""
        found = dict(zip(ACCOUNTS, self.clock.total(self._total.numpy()).tolist(), strict=True))
        if self._exchanges is not None:
            found["external"] += self._exchanges.supplied()
            found["interaction"] = sum(self.exchanged())
        return found

    def accounts_of_runs(self) -> dict[str, np.ndarray]:
        """What each mechanism but interactions added to each run since the start [J], (runs,); reads the device."""
        return dict(zip(ACCOUNTS, self._total.numpy().T.copy(), strict=True))

    def start_of_runs(self) -> np.ndarray:
        """Energy of each run at the start [J], (runs,); reads the device."""
        return self._starts.numpy().copy() if self.clock.independent else np.array([self._start])

    def made(self) -> float:
        """Energy that steps by the only clock made, over the most that was put in at any look; reads the device."""
        accounts = self.accounts()
        put_in = abs(self._start) + sum(max(accounts[name], 0.0) for name in PUT_IN)
        most = self._most[0] = max(self._most[0], put_in)
        return max(accounts["stepping"], 0.0) / most if most > 0.0 else 0.0

    def made_by_runs(self) -> np.ndarray:
        """Energy that the steps of each run made, over the most that was put in, (runs,); reads the device."""
        accounts = self.accounts_of_runs()
        put_in = np.abs(self.start_of_runs()) + sum(np.maximum(accounts[name], 0.0) for name in PUT_IN)
        self._most = np.fmax(self._most, put_in)
        made = np.maximum(accounts["stepping"], 0.0)
        return np.divide(made, self._most, out=np.zeros_like(made), where=self._most > 0.0)

    def residual(self, U: StateArrays) -> float:
        """Energy that no account explains [J]; round-off if the operators are duals of each other."""
        return self.kinetic(U) + self.stored(U) + self.held() - self.start - sum(self.accounts().values())
