"""What a run shows while it runs: a bar on a terminal, a line every ten seconds otherwise."""

import logging
import sys
import time
from typing import Any

from ..output.recorded import Recorded, transport
from ..simulation import Simulation

log = logging.getLogger(__name__)

_BAR = "{percentage:5.1f}% |{bar:12}| {remaining} left{postfix}"


class Progress:
    """Called after each step; a context, so that the bar is closed.

    Args:
        until: end time [s].
        terminal: whether there is one; found out by default.
    """

    def __init__(self, until: float, terminal: bool | None = None):
        self.until = until
        self.terminal = sys.stderr.isatty() if terminal is None else terminal
        self._interval = 0.5 if self.terminal else 10.0
        self._bar: Any = None
        self._start: tuple[float, float, int] | None = None
        self._shown = (0.0, 0)

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *raised: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def __call__(self, simulation: Recorded) -> None:
        """Show where ``simulation`` is, if the last time was long enough ago."""
        now = time.monotonic()
        if self._start is None:
            self._begin(simulation, now)
        elif now - self._shown[0] >= self._interval or simulation.t >= self.until:
            self._show(simulation, now)

    def _begin(self, simulation: Recorded, now: float) -> None:
        self._start, self._shown = (now, simulation.t, simulation.steps), (now, simulation.steps)
        if self.terminal:
            from tqdm import tqdm

            left = max(self.until - simulation.t, 1e-300)
            self._bar = tqdm(total=left, bar_format=_BAR, smoothing=0.0, leave=True)

    def _show(self, simulation: Recorded, now: float) -> None:
        assert self._start is not None  # _begin came first
        began, first, _ = self._start
        t, step = simulation.t, simulation.steps
        speed = (step - self._shown[1]) * len(simulation.particles.mass) / max(now - self._shown[0], 1e-9)
        self._shown = (now, step)
        rate = f"dt = {simulation.dt:.3g} s, {speed:.3g} particle-steps/s"
        if self._bar is not None:
            self._bar.n = min(t - first, self._bar.total)
            # What matters first: a narrow terminal cuts the rest.
            self._bar.set_postfix_str(f"{health(simulation)}, step {step}, {rate}, t = {t:.4g} s")
            return
        done = (t - first) / max(self.until - first, 1e-300)
        left = (now - began) * (1.0 - done) / max(done, 1e-9)
        text = f"step {step}, t = {t:.4g} s, {rate}, {health(simulation)}"
        log.info("%s, %.1f %% of %.4g s, %.0f s left", text, 100.0 * t / self.until, self.until, left)


def health(simulation: Recorded) -> str:
    """The figure that tells soonest that a run goes wrong."""
    if isinstance(simulation, Simulation):
        return f"energy drift {energy_drift(simulation):+.1e}"
    amounts = simulation.amounts() if transport(simulation) else {}
    return f"values {amounts['least']:.3g} to {amounts['largest']:.3g}" if amounts else ""


def energy_drift(simulation: Simulation) -> float:
    """Energy that loads and conditions do not explain over that which there is, was, or went through them [-].

    What is dissipated counts, but for what ``Damping`` takes.
    """
    energy = simulation.energy()
    start = simulation.stepper.ledger.start
    gained = energy["total"] - start - energy["external"] - energy["constraint"] - energy["damping"]
    scale = max(abs(energy["total"]), abs(start), abs(energy["external"]), abs(energy["constraint"]), 1e-300)
    return gained / scale
