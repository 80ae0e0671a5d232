"""Histories of a run by name: columns of its log and of its probes' tables, one component each."""

import difflib
import itertools
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from .reader import Run

AXES = "xyz"
#: What is not to be drawn over time but is time itself, or counts.
_CLOCKS = ("t", "step")


class History(NamedTuple):
    """A figure over time.

    Attributes:
        label: name, and unit if it is known.
        t: times [s], (k,), increasing.
        values: (k,).
    """

    label: str
    t: np.ndarray
    values: np.ndarray


def history(run: Run, name: str) -> History:
    """A figure by its name: ``log.kinetic``, ``tip.x.y`` for the column x of the probe tip, ``tip.u.y`` for how much it
    has changed since the first row, ``middle.cauchy_stress.xy``.

    Raises:
        ValueError: the run has no such figure; it names those that there are.
    """
    table, _, rest = name.partition(".")
    column, _, component = rest.partition(".")
    known = names(run)
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise ValueError(f"{run.directory.path} has no history {name!r}; {hint}there are {', '.join(known)}")
    columns = _tables(run)[table]
    values = np.asarray(columns["x"] - columns["x"][:1] if column == "u" else columns[column], dtype=float)
    index = tuple(AXES.index(letter) for letter in component)
    flat = np.ravel_multi_index(index, values.shape[1:]) if index else 0
    units = getattr(columns, "units", {})
    unit = units.get("x" if column == "u" else column)
    label = f"{name} [{unit}]" if unit else name
    return History(label, np.asarray(columns["t"], dtype=float), values.reshape(len(values), -1)[:, flat])


def names(run: Run) -> list[str]:
    """Every name that ``history`` takes."""
    return [f"{table}.{figure}" for table, columns in _tables(run).items() for figure in _figures(columns)]


def _tables(run: Run) -> dict[str, Mapping[str, np.ndarray]]:
    return {"log": run.log, **run.probes}


def _figures(columns: Mapping[str, np.ndarray]) -> Iterator[str]:
    """Columns with their components; ``u``, the change of positions ``x``, where there are such."""
    shapes = {name: np.shape(values)[1:] for name, values in columns.items() if name not in _CLOCKS}
    if "x" in shapes:
        shapes["u"] = shapes["x"]
    for name, shape in shapes.items():
        if np.prod(shape, dtype=int) == 1:
            yield name
        else:
            components = itertools.product(*[AXES[:size] for size in shape])
            yield from (f"{name}.{''.join(letters)}" for letters in components)
