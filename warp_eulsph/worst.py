"""The particle that is named when a run has failed: where it began as far as the state tells, or the worst."""

from typing import NamedTuple, Protocol

import numpy as np

from .order import Order
from .scheme.stepper import Stepper


class Bad(Protocol):
    """What is asked of a simulation that has a bad particle."""

    stepper: Stepper
    order: Order

    @property
    def X(self) -> np.ndarray:
        """Initial positions [m], (n, dim)."""

    @property
    def x(self) -> np.ndarray:
        """Positions [m], (n, dim)."""

    @property
    def v(self) -> np.ndarray:
        """Velocities [m/s], (n, dim)."""

    @property
    def F(self) -> np.ndarray:
        """Deformation gradients, (n, dim, dim)."""


class Worst(NamedTuple):
    """A bad particle.

    Attributes:
        particle: its number.
        J: its det F, not a number where F is not finite.
        finite: x, v and F are, so that with J > 0 its law is what refused the state.
        bad: how many are bad.
    """

    particle: int
    J: float
    finite: bool
    bad: int


def worst_of(simulation: Bad, place: int, among: range) -> Worst:
    """The particle of the least det F that is not positive, the fastest of several; else the middle of what is lost.

    What is not finite spreads by sums over neighbours, so the middle is of that where fewest particles have lost it: F,
    v, x or what their law remembers. Where none of this is bad it is the one at ``place``, which was found bad. All
    this is of the particles ``among`` which it is, those of one run.
    """
    x, v, F = simulation.x[among], simulation.v[among], simulation.F[among]
    lost = [~np.isfinite(values).reshape(len(x), -1).all(axis=1) for values in (F, v, x)]
    without, below = (which[among] for which in _without_state(simulation))
    with np.errstate(over="ignore", invalid="ignore"):
        J, speed = np.linalg.det(np.where(lost[0][:, None, None], np.nan, F)), np.linalg.norm(v, axis=1)
    finite, flat, found = ~np.any(lost, axis=0), J <= 0.0, simulation.order.ids.numpy()[place] == np.array(among)
    bad = np.any([*lost, without, below, flat, found], axis=0)
    if flat.any():
        particle = int(np.lexsort((-speed, J))[0])
    else:
        lost = [each for each in [*lost, without] if each.any()] or [below if below.any() else found]
        particle = _middle(np.where(np.isfinite(x), x, simulation.X[among]), min(lost, key=np.sum))
    return Worst(among[particle], float(J[particle]), bool(finite[particle]), int(bad.sum()))


def _without_state(simulation: Bad) -> tuple[np.ndarray, np.ndarray]:
    """Which particles remember what is not finite, and which less than can be, (n,) bool each, by number."""
    without, below = np.zeros((2, len(simulation.order.places)), dtype=bool)
    for span, part in simulation.stepper.remembering:
        if part.law.history:
            rows = part.history.numpy()
            least = [-np.inf if v.least is None else v.least for v in part.law.history for _ in v.values]
            without[span.start : span.stop] = ~np.isfinite(rows).all(axis=1)
            below[span.start : span.stop] = (rows < least).any(axis=1)
    return simulation.order.by_number(without), simulation.order.by_number(below)


def _middle(x: np.ndarray, which: np.ndarray) -> int:
    """Number of the particle among ``which``, (n,) bool, that is nearest to the mean of their places."""
    among = np.flatnonzero(which)
    return int(among[np.linalg.norm(x[among] - x[among].mean(axis=0), axis=1).argmin()])
