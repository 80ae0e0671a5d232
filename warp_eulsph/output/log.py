"""The log of a run: energies, momenta and extrema, or amounts of a transported quantity; a line of JSON per look."""

import logging
from pathlib import Path
from typing import Any

import numpy as np

from .atomic import append_line
from .recorded import Recorded, RecordedSolids, solids, transport
from .sealed import read_lines, sealed_line

log = logging.getLogger(__name__)


def look(simulation: Recorded) -> dict[str, Any]:
    """What a line of the log holds of the present state; SI units."""
    line = {"step": simulation.steps, "t": simulation.t, "dt": simulation.dt}
    if transport(simulation):
        return line | simulation.amounts()
    return line | (_solids(simulation) if solids(simulation) else {})


def _solids(simulation: RecordedSolids) -> dict[str, Any]:
    return {
        **simulation.energy(),
        "momentum": simulation.momentum().tolist(),
        "angular_momentum": simulation.angular_momentum().tolist(),
        **{name.replace(" ", "_"): value for name, value in simulation.extrema().items()},
    }


def append(path: Path, lines: list[dict[str, Any]]) -> None:
    """Append lines and force them to disk.

    Raises:
        OSError: the disk refused; the file is as it was.
    """
    if lines:
        append_line(path, "\n".join(sealed_line(line) for line in lines))


def read_log(path: Path) -> dict[str, np.ndarray]:
    """The columns of a log, (lines,) each, momenta (lines, components); damaged lines are left out, with a warning."""
    lines = read_lines(path, ("step", "t"))
    if lines.damaged:
        log.warning("%s: lines %s are damaged and left out", path, lines.damaged)
    columns = lines.whole[0].keys() if lines.whole else ()
    alike = [line for line in lines.whole if line.keys() == columns]
    return {name: np.array([line[name] for line in alike]) for name in columns}
