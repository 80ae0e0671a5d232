"""Where the time of a step goes: its parts by name, each timed around what the step calls."""

import time
from collections import defaultdict
from typing import Any

#: Parts of a step, and the methods that do them: attributes of the stepper, dots lead to its members.
PHASES = {
    "neighbour search": [
        f"configuration.lists.{part}" for part in ("count_neighbours", "sum_counts", "make_room", "fill")
    ],
    "pair sums and correction (M3)": ["configuration.move", "configuration.renew"],
    "balance (M13)": ["stabiliser.refresh"],
    "wave speeds and time step": ["_choose_dt"],
    "gradient (M4)": ["_velocity_gradient", "_known_gradient", "_mean_gradient"],
    "stress (M1)": ["_stress"],
    "forces (M5, M9)": ["_sum_forces"],
    "updates (M14)": ["_drift", "_kick", "_start_mean", "_finish_mean"],
    "shifting (M15)": ["_shift"],
    "histories and volumes (M24)": ["_update"],
    "conditions": ["_impose"],
    "ledger": ["ledger.record"],
}
OTHER = "other"


class PhaseClock:
    """Processor seconds spent in each phase of a stepper's steps from now on, each without the phases inside it."""

    def __init__(self, stepper: Any):
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self._inner: list[float] = []
        for phase, methods in PHASES.items():
            for method in methods:
                *path, name = method.split(".")
                owner = stepper
                for member in path:
                    owner = getattr(owner, member)
                if hasattr(owner, name):
                    setattr(owner, name, self._timed(phase, getattr(owner, name)))

    def _timed(self, phase: str, method: Any) -> Any:
        def timed(*arguments: Any, **named: Any) -> Any:
            self._inner.append(0.0)
            start = time.process_time()
            result = method(*arguments, **named)
            spent = time.process_time() - start
            self.seconds[phase] += spent - self._inner.pop()
            if self._inner:
                self._inner[-1] += spent
            return result

        return timed
