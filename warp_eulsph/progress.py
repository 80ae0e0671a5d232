"""How far a run is: a bar on a terminal or in a notebook."""

import sys
from typing import Any, Protocol

# A run that is over sooner [s] needs no bar.
DELAY = 1.0


def watched() -> bool:
    """Whether somebody looks on: standard error is a terminal, or this is a notebook."""
    stderr = sys.stderr  # None in a program without a console
    return (stderr is not None and stderr.isatty()) or "ipykernel" in sys.modules


class Watched(Protocol):
    """What is asked of a run; ``watch`` is the bar that shows it."""

    watch: "Bar | None"

    @property
    def t(self) -> float:
        """Time [s]."""

    @property
    def dt(self) -> float:
        """Last time step [s]."""

    @property
    def steps(self) -> int:
        """Steps taken."""


class Bar:
    """Shows time, step and step length of a run; a context, in which it is called after steps.

    Args:
        simulation: what runs.
        until: end time [s].
        show: whether there is a bar; found out if None.
    """

    def __init__(self, simulation: Watched, until: float, show: bool | None = None):
        self.simulation, self.until = simulation, until
        self.show = watched() if show is None else show
        self._delay = DELAY if show is None else 0.0
        self._start = float(simulation.t)
        self._bar: Any = None

    def __enter__(self) -> "Bar | None":
        if not self.show or self.until <= self._start:
            return None
        from tqdm import tqdm

        form = "{percentage:5.1f}% |{bar:20}| {elapsed}<{remaining}{postfix}"
        self._bar = tqdm(total=self.until - self._start, bar_format=form, delay=self._delay, smoothing=0.0)
        return self

    def __exit__(self, *raised: object) -> None:
        self.simulation.watch = None
        if self._bar is not None:
            self._bar.close()

    def __call__(self, simulation: Watched) -> None:
        """Show where ``simulation`` is now."""
        assert self._bar is not None  # __enter__ gave this object away only with a bar
        self._bar.set_postfix_str(
            f"t = {simulation.t:.4g} s, step {simulation.steps}, dt = {simulation.dt:.3g} s", refresh=False
        )
        self._bar.update(min(simulation.t, self.until) - self._start - self._bar.n)
