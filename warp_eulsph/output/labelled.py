"""A run as an ``xarray.Dataset``, whose fields are read from the snapshots when they are looked at."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray
from xarray.backends import BackendArray
from xarray.core import indexing

from .fields import KNOWN
from .reader import Run, RunFrame

AXES = "xyz"


class _Series(BackendArray):
    """One field at all times, (frames, N, …); a part of it reads only the snapshots that it needs."""

    def __init__(self, run: Run, name: str):
        first = run[0].field(name)
        self.run, self.name = run, name
        self.shape, self.dtype = (len(run), *first.shape), first.dtype

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._read)

    def _read(self, key: tuple[int | slice, ...]) -> np.ndarray:
        times, rest = key[0], key[1:]
        chosen = self.run[times]
        if isinstance(chosen, RunFrame):
            return chosen.field(self.name)[rest]
        if not chosen:
            return np.broadcast_to(np.zeros((), self.dtype), self.shape)[key]
        return np.stack([frame.field(self.name)[rest] for frame in chosen])


def dataset(run: Run, fields: Sequence[str] | None) -> xarray.Dataset:
    """See ``Run.to_xarray``."""
    if not len(run):
        raise ValueError(f"{run.directory.path} holds no snapshots yet")
    names, units = list(run[0].units) if fields is None else list(fields), run.units
    unknown = [name for name in names if name not in units]
    if unknown:
        raise ValueError(f"fields must be among {list(units)}, got {unknown}")
    counts = sorted({frame.N for frame in run})
    if len(counts) > 1:
        raise ValueError(f"a data set needs the same number of particles at all times, got {counts}")
    variables = {}
    for name in names:
        if name == "particle":  # a coordinate
            continue
        series, attributes = _Series(run, name), {"units": units[name]}
        if name in KNOWN:
            attributes["long_name"] = KNOWN[name].meaning
        dimensions = ("time", "particle", *_components(name, series.shape[2:]))
        variables[name] = (dimensions, indexing.LazilyIndexedArray(series), attributes)
    made = xarray.Dataset(variables)
    coordinates: dict[str, Any] = {
        "time": ("time", run.times, {"units": "s"}),
        "step": ("time", run.steps),
        "particle": ("particle", run[0].particles, {"long_name": KNOWN["particle"].meaning}),
        **{str(name): list(AXES[:size]) for name, size in made.sizes.items() if "axis" in str(name)},
    }
    return made.assign_coords(coordinates)


def _components(name: str, shape: tuple[int, ...]) -> tuple[str, ...]:
    """Names of the dimensions beside time and particle."""
    if name.startswith("principal"):
        return (f"{name}_order",)
    axis = "stress_axis" if name in ("cauchy_stress", "first_piola") else "axis"
    return (axis, f"{axis}_2")[: len(shape)]
