"""The log of a run: energies, momenta and extrema, or amounts of a transported quantity; a line of JSON per look."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..simulation import Simulation
from .atomic import append_line, replace_file
from .fields import Recorded


def look(simulation: Recorded) -> dict[str, Any]:
    """What a line of the log holds of the present state; SI units."""
    line = {"step": simulation.steps, "t": simulation.t, "dt": simulation.dt}
    return line | (_solids(simulation) if isinstance(simulation, Simulation) else simulation.amounts())


def _solids(simulation: Simulation) -> dict[str, Any]:
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
        append_line(path, "\n".join(json.dumps(line) for line in lines))


def read_lines(path: Path) -> list[dict[str, Any]]:
    """The lines of a log; one that was cut short, and what follows it, is left out."""
    lines = []
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        try:
            lines.append(json.loads(line))
        except ValueError:
            break
    return lines


def cut(path: Path, step: int) -> None:
    """Drop the lines of steps after ``step``, and what is damaged.

    Raises:
        OSError: the disk refused; the file is as it was.
    """
    if path.exists():
        kept = [json.dumps(line) + "\n" for line in read_lines(path) if line["step"] <= step]
        replace_file(path, "".join(kept).encode())


def read_log(path: Path) -> dict[str, np.ndarray]:
    """The columns of a log, (lines,) each, momenta (lines, components)."""
    lines = read_lines(path)
    return {name: np.array([line[name] for line in lines]) for name in (lines[0] if lines else {})}
