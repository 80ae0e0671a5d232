"""Prescribed motion: positions given as a function of time."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..execution import Launcher
from ..fields import clock_structure
from ..space import Space
from ..structs import ClockArrays, StateArrays
from .base import Assembly, Bound, Boundary, Region
from .value import Value


@dataclass(frozen=True, eq=False)
class Motion(Boundary):
    """x = X + displacement(X, t) on a region, to round-off at the end of every step.

    The half step takes the mean velocity of the step, which moves the particles exactly to their places; the full step
    takes a centred difference about its end. Initial velocities are left as the body gives them.

    Args:
        displacement: function of initial position [m] and time [s] -> displacement [m], zero at the start of the run:
            a ``wp.func`` for one particle, or a Python function of positions (k, dim) (see ``Value``).
        region: particles (see ``Region``); None takes all of the body.
        body: name of the body, any by default.
    """

    displacement: Callable[..., Any]
    region: Region | None = None
    body: str | None = None

    def bind(self, assembly: Assembly) -> "BoundMotion":
        return BoundMotion(self, assembly)


@functools.cache
def _make_impose(space: Space) -> wp.Kernel:
    real, vec = space.real, space.vec
    Clock = clock_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def impose(
        first: int,
        indices: wp.array(dtype=wp.int32),
        before: wp.array(dtype=vec),
        after: wp.array(dtype=vec),
        clock: Clock,
        v: wp.array(dtype=vec),
    ):
        k = first + wp.tid()
        a = indices[k]
        dt = clock.dt[clock.run[a]]
        if dt > wp.float64(0.0):
            v[a] = (after[k] - before[k]) / real(dt)

    return impose


class BoundMotion(Bound):
    """Writes the velocity that the displacement asks for."""

    sortable = True

    def __init__(self, condition: Motion, assembly: Assembly):
        who = type(condition).__name__
        if not callable(condition.displacement):
            raise ValueError(
                f"{who}: displacement must be a function of initial position and time, got "
                f"{type(condition.displacement).__name__}; Fixed() holds particles in place"
            )
        self.space, self.device = assembly.space, assembly.device
        self._launch = Launcher(assembly.device)
        self.indices = assembly.select(condition.region, condition.body, who)
        self.X = assembly.order.carry(assembly.X, self.space.vec)
        self.before, self.after = (
            Value(assembly, self.indices, self.space.dim, condition.displacement, who) for _ in range(2)
        )
        self.recordable = self.independent = self.before.recordable

    def impose(self, state: StateArrays, clock: ClockArrays, fraction: float) -> None:
        before = self.before.at(self.X, clock, fraction - 0.5)
        after = self.after.at(self.X, clock, fraction + 0.5)
        arguments = [self.before.places, before, after, clock, state.v]
        self._launch(_make_impose(self.space), len(self.indices), arguments)
