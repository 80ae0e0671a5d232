"""What many cases are judged by: energy, order of convergence, agreement of two forms."""

from collections.abc import Sequence

import numpy as np

from .history import History
from .report import Figure


def energy_figures(
    history: History, residual: float, *, suffix: str = "", loss: float = float("inf"), gain: float = 1e-6
) -> list[Figure]:
    """Drift and largest gain of the column ``energy``, and the residual of its books, over the energy at the start.

    Energy may be lost to dissipation, which is reported; a gain is a fault, beyond the errors of time integration.

    Args:
        history: of the run.
        residual: of the books [J].
        suffix: of the figures' names.
        loss: largest loss accepted, relative.
        gain: largest gain accepted, relative; the time integration's falls at second order with the step.
    """
    energy = history["energy"] / history["energy"][0]
    return [
        Figure(f"energy_drift{suffix}", energy[-1] - 1.0, low=-loss, reference=0.0),
        Figure(f"energy_gain{suffix}", energy.max() - 1.0, high=gain, reference=0.0),
        Figure(f"ledger_residual{suffix}", abs(residual) / history["energy"][0], 0.0, 1e-10, 0.0),
    ]


def order(levels: Sequence[float], errors: Sequence[float]) -> float:
    """Observed order of convergence: least-squares slope of log error over log resolution (particles per length)."""
    return float(-np.polyfit(np.log(levels), np.log(np.abs(errors)), 1)[0])


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def difference(one: np.ndarray, other: np.ndarray) -> float:
    """Relative difference of two fields or histories: rms of the difference over rms of the second."""
    return rms(np.asarray(one) - other) / rms(other)
