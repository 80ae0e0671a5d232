"""Is the state still physical? A flag for each run on the device, set by the bad particle that is first in memory."""

import functools
from typing import Any

import warp as wp

from ..atomics import lower_at
from ..execution import Launcher
from ..fields import clock_structure, structure
from ..linalg import det
from ..space import Space
from ..structs import ClockArrays, StateArrays

#: Value of ``clock.bad`` while every particle is well.
WELL = 2**31 - 1


class UnstableError(RuntimeError):
    """A run met det F ≤ 0 or a non-finite value; the message names particle, position, time and remedies.

    Attributes:
        particle: number of a bad particle, where it began as far as the state tells (``worst.py``), or the fastest.
        time: time [s] at the end of the last good step.
        step: number of steps taken, the bad one included.
    """

    def __init__(self, message: str, particle: int, time: float, step: int):
        super().__init__(message)
        self.particle, self.time, self.step = particle, time, step


def last_good(output: Any) -> str:
    """What a failed run left: words on the last snapshot of ``output``, which keeps frames, or None."""
    last = getattr(output, "last", None)
    return "no snapshot was written" if last is None else f"the last good snapshot is {last}"


@functools.cache
def _make_check(space: Space) -> wp.Kernel:
    real = space.real
    State, Clock, determinant = structure(space, "State"), clock_structure(space), det(space)

    @wp.kernel(module="unique", enable_backward=False)
    def check(first: int, state: State, clock: Clock):
        a = first + wp.tid()
        nothing = real(0.0)  # NaN as soon as a component is not finite
        for i in range(wp.static(space.dim)):
            nothing += state.x[a][i] * real(0.0) + state.v[a][i] * real(0.0)
            for j in range(wp.static(space.dim)):
                nothing += state.F[a][i, j] * real(0.0)
        if nothing != real(0.0) or determinant(state.F[a]) <= real(0.0):
            lower_at(clock.bad, clock.run[a], a)

    return check


def check(launch: Launcher, space: Space, state: StateArrays, clock: ClockArrays) -> None:
    """Set ``clock.bad`` of each run to the lowest index of a particle with det F ≤ 0 or a non-finite x, v or F."""
    launch(_make_check(space), len(state.x), [state, clock])
