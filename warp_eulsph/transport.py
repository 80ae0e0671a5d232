"""A quantity carried along on particles that do not move, as a run: what ``Simulation`` is for solids."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import warp as wp

from .checks import check_restorable
from .order import Order
from .schedule import SAME
from .scheme.health import UnstableError, last_good
from .scheme.reference import Configuration
from .scheme.scalar import ConservationLaw
from .simulation import STEPS_BETWEEN_LOOKS
from .turns import in_turn
from .whole import Whole

# Values that grew to so many times the largest at the start: nothing that is only carried along does that.
GROWN = 100.0


@in_turn()
class Transport:
    """Runs a scalar conservation law in steps of one length; ``output.record`` takes it as it takes a ``Simulation``.

    Args:
        law: at its start, t = 0.
        time_step: length of the steps [s]; those before a time to be hit exactly are shorter.
        exact: positions [m], (n, dim), and time [s] -> exact values, (n,), to be stored and compared; None if unknown.

    Attributes:
        law: what is run.
        output: who keeps frames: its ``last`` is named when the run fails.

    Raises:
        ValueError: a time step that is not positive and finite.
    """

    def __init__(
        self,
        law: ConservationLaw,
        time_step: float,
        exact: Callable[[np.ndarray, float], np.ndarray] | None = None,
    ):
        if not (math.isfinite(time_step) and time_step > 0.0):
            raise ValueError(f"time step must be positive and finite, got {time_step} s")
        self.law, self.time_step, self.exact = law, float(time_step), exact
        self.space, self.device, self.particles = law.space, law.device, law.configuration.particles
        self.ranges: dict[str, range] = {}  # there are no bodies
        self.order = Order(len(law.U), self.device)  # particles stay where they are, in memory too
        self.steps, self.dt = 0, 0.0
        self._most = GROWN * float(np.abs(law.start).max()) or np.inf
        self.whole = Whole()
        self.output: Any = None

    def advance(self, until: float, most: int | None = None, look: float = math.inf) -> None:
        """Take a few steps towards ``until`` [s], at most ``most``; the last one there ends at it exactly.

        Raises:
            UnstableError: values that are not finite, or a hundred times as large as at the start.
            BrokenError: an exception left an earlier step half done.
        """
        self.whole.check()
        batch = STEPS_BETWEEN_LOOKS if self.device.is_cuda else 1
        before = self.t
        for _ in range(batch if most is None else min(batch, most)):
            left = until - self.t
            if left <= 0.0 or self.t >= look:
                break
            # What is left beyond the step by less than SAME of it is rounding, not another step
            last = left <= self.time_step * (1.0 + SAME)
            with self.whole:
                self.dt = left if last else self.time_step
                self.law.step(self.dt)
                self.law.t = until if last else self.law.t
                self.steps += 1
        self._raise_if_bad(before)

    # what a checkpoint holds

    def evolving(self) -> dict[str, wp.array]:
        """Every array that a step reads before it writes it, by name."""
        return {"U": self.law.U}

    @property
    def counters(self) -> dict[str, float]:
        """The numbers beside the arrays that evolve: steps taken, time and last time step [s]."""
        return {"steps": self.steps, "t": self.t, "dt": self.dt}

    def restore(self, arrays: Mapping[str, np.ndarray], counters: Mapping[str, float]) -> None:
        """Take over what ``evolving`` and ``counters`` were in this same transport, at any step of it.

        Raises:
            ValueError: names or shapes that are not those of this one; nothing was changed.
        """
        check_restorable(self, arrays, counters)
        with self.whole:
            self.law.U.assign(arrays["U"])
            self.steps, self.law.t, self.dt = int(counters["steps"]), float(counters["t"]), float(counters["dt"])
        self.whole.mend()

    # what a user looks at

    @property
    def t(self) -> float:
        """Time [s]."""
        return self.law.t

    @property
    def configuration(self) -> Configuration:
        """The configuration in which weights live."""
        return self.law.configuration

    @property
    def x(self) -> np.ndarray:
        """Positions [m], a copy of shape (n, dim)."""
        return self.configuration.fields.x.numpy().copy()

    X = x  # nothing moves

    @property
    def values(self) -> np.ndarray:
        """The quantity, a copy of shape (n,)."""
        return self.law.values

    @property
    def exact_values(self) -> np.ndarray:
        """The exact quantity now, (n,).

        Raises:
            ValueError: there is no exact solution.
        """
        if self.exact is None:
            raise ValueError("exact values need an exact solution, got none; give one to Transport")
        return np.asarray(self.exact(self.x, self.t), dtype=float)

    def amounts(self) -> dict[str, float]:
        """∫U dV [m^dim], least and largest U, and, where an exact solution is, the L2 error √∫(U − exact)² dV."""
        U, volume = self.values.astype(float), self.particles.V0.numpy().astype(float)
        found = {"amount": float(volume @ U), "least": float(U.min()), "largest": float(U.max())}
        if self.exact is not None:
            found["error"] = math.sqrt(float(volume @ np.square(U - self.exact_values)))
        return found

    def _raise_if_bad(self, before: float) -> None:
        bad = np.flatnonzero(~(np.abs(self.values) < self._most))
        if not bad.size:
            return
        where = np.array2string(self.x[bad[0]], precision=6)
        raise UnstableError(
            f"unstable at t = {self.t:.8g} s, step {self.steps}: particle {bad[0]} at x = {where} m has the value "
            f"{self.values[bad[0]]}; {last_good(self.output)}; try a smaller time step than {self.time_step:.6g} s",
            int(bad[0]),
            before,
            self.steps,
        )
