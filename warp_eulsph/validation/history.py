"""Histories: of a run, sampled at given times, and of the references that came with the package."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..output import SnapshotWriter
from ..simulation import Simulation

#: Columns by name, each of shape (number of times,); ``t`` [s] is the time.
History = dict[str, np.ndarray]


def record(
    simulation: Simulation,
    times: np.ndarray,
    observe: Callable[[], dict[str, float]],
    *,
    writer: SnapshotWriter | None = None,
    stride: int = 10,
) -> History:
    """What ``observe`` gives at increasing ``times``, which are hit exactly.

    Args:
        simulation: what is run.
        times: when to look [s], (k,), from the present time on.
        observe: figures of the present state, the same names every time.
        writer: writes a snapshot every ``stride`` looks; None writes nothing.
        stride: looks between two snapshots.
    """
    rows = []
    for k, t in enumerate(simulation.frames(times.tolist())):
        rows.append({"t": t, **observe()})
        if writer is not None and k % stride == 0:
            writer.write(simulation)
    if writer is not None:
        writer.finish()
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def series(name: str) -> History:
    """A reference: the columns of ``warp_eulsph/validation/reference/<name>.csv``, SI units."""
    path = Path(__file__).parent / "reference" / f"{name}.csv"
    table = np.genfromtxt(path, delimiter=",", names=True)
    return {column: table[column] for column in table.dtype.names or ()}


def at(history: History, name: str, t: Any) -> Any:
    """A column at time ``t`` [s], interpolated linearly."""
    return np.interp(t, history["t"], history[name])
