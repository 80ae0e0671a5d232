"""One-step Lax for {p, F}: the paper's first scheme (§4.1), first order, for comparison with Lax-Wendroff."""

import functools
from dataclasses import dataclass
from typing import Any, ClassVar

import warp as wp

from ..fields import clock_structure, part_of, structure
from ..space import Space
from ..structs import StateArrays
from .balance import Balance
from .base import Scheme
from .dissipation import Upwind
from .smoothing import NeighbourAverage, Smoothing
from .stabiliser import Correction
from .stepper import Stepper
from .world import Parts


@dataclass(frozen=True)
class Lax(Scheme):
    """U^{n+1} = S(Uⁿ) + Δt (rates of Uⁿ): every step smooths, so that it damps strongly, more so the smaller Δt is.

    Args:
        smoothing: S of the step; NeighbourAverage() is the paper's. LinearExact() is too weak here: it leaves long
            waves alone, and those grow in an explicit Euler step.
        dissipation: M9; None is the paper's scheme, whose S damps all but the saw-tooth.
        correction: what makes a moving reference stable, as in LaxWendroff.
    """

    smoothing: Smoothing = NeighbourAverage()
    dissipation: Upwind | None = Upwind()
    correction: Correction | None = Balance()
    cfl: ClassVar[float] = 0.4

    def build(self, parts: Parts) -> "LaxStepper":
        """The scheme at work."""
        return LaxStepper(self, parts)


@functools.cache
def _make_note(space: Space) -> wp.Kernel:
    """Kernel: dv = S(v) − v."""
    vec = space.vec

    @wp.kernel(module="unique", enable_backward=False)
    def note(first: int, v: wp.array(dtype=vec), smoothed: wp.array(dtype=vec), dv: wp.array(dtype=vec)):
        a = first + wp.tid()
        dv[a] = smoothed[a] - v[a]

    return note


@functools.cache
def _make_adopt(space: Space) -> wp.Kernel:
    """Kernel: U and the new state change places; not in a step of Δt = 0, which must change nothing."""
    vec = space.vec
    State, Clock = structure(space, "State"), clock_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def adopt(first: int, clock: Clock, state: State, other: State, dv: wp.array(dtype=vec)):
        a = first + wp.tid()
        if clock.dt[clock.run[a]] == wp.float64(0.0):
            other.v[a] = state.v[a]
            dv[a] = vec()
            return
        # One by one: Warp copies the right side of a single assignment, but not those of a tuple
        x = state.x[a]
        v = state.v[a]
        F = state.F[a]
        surface = state.surface[a]
        state.x[a] = other.x[a]
        state.v[a] = other.v[a]
        state.F[a] = other.F[a]
        state.surface[a] = other.surface[a]
        other.x[a] = x
        other.v[a] = v
        other.F[a] = F
        other.surface[a] = surface

    return adopt


class LaxStepper(Stepper):
    """One-step Lax at work."""

    def __init__(self, options: Lax, parts: Parts):
        super().__init__(options, parts)
        self.dv = wp.zeros(self.n, dtype=self.space.vec, device=self.device)
        self._dv_by_medium = [part_of(self.dv, medium.span) for medium in self.media]

    def advance(self) -> None:
        """Advance U on the present reference."""
        U, other = self.U, self.half
        self._gradients(U)  # M4: ∇_k v, ∇_k F
        self._choose_dt(U)
        self._sense(U)  # d of M9
        self._stress(U, 0.0)  # M1: Q = P F_kᵀ / J_k
        self._sum_forces(U, U, 0.0)  # M5, M9
        self._smooth(U, other)  # M6 or M7: S(U)
        self._note_smoothing(U, other)
        self._predict(U, other, 1.0)  # U^{n+1} = S(Uⁿ) + Δt (rates of Uⁿ), x^{n+1} = xⁿ + Δt vⁿ
        self._adopt(U, other)  # U is U^{n+1}, other is Uⁿ
        self._release(U)  # the free velocity, for the reactions
        self._impose(U, 1.0)
        self._update(U)  # histories; liquids keep J only
        self._check(U)
        self.ledger.record(U, other, self._dv_by_medium)
        self.clock.tick()

    def _note_smoothing(self, U: StateArrays, other: Any) -> None:
        self._launch(_make_note(self.space), self.n, [U.v, other.v, self.dv])

    def _adopt(self, U: StateArrays, other: Any) -> None:
        self._launch(_make_adopt(self.space), self.n, [self.clock.fields, U, other, self.dv])
