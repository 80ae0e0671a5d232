"""A run read back: ``Run("runs/column")[-1].F``."""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from .. import weights
from .derived import DERIVED, Derived
from .directory import RunDirectory, numbered
from .log import read_log
from .manifest import Entry, Manifest
from .sealed import DamagedError
from .shape_functions import shape_functions
from .snapshot import read_field, read_units
from .tables import read_table

if TYPE_CHECKING:
    import xarray

log = logging.getLogger(__name__)

#: What ``RunFrame.interpolate`` needs of the snapshots besides the field itself.
INTERPOLATION = ("volume", "smoothing_length", "body")
# Points whose neighbours are in memory at once, some hundred each.
_BLOCK = 20_000


def points_on_line(start: Sequence[float], end: Sequence[float], count: int) -> np.ndarray:
    """``count`` points from ``start`` to ``end`` [m], both among them, evenly spaced: (count, dim)."""
    return np.linspace(np.asarray(start, dtype=float), np.asarray(end, dtype=float), count)


@dataclass(frozen=True)
class Smoothing:
    """How the particles of a run see each other.

    Attributes:
        weight: SPH weight. box: lengths [m] of the periodic box, 0 where it is open; all open if empty.
    """

    weight: weights.Weight = weights.CubicSpline()
    box: tuple[float, ...] = ()


class RunFrame(Derived):
    """One snapshot; fields are read when they are asked for, and kept.

    Attributes:
        path: of the file. time: [s]. step: steps taken before it. N: number of particles.
    """

    def __init__(self, directory: Path, entry: Entry, smoothing: Callable[[], Smoothing] = Smoothing):
        self.path, self._smoothing = directory / entry.name, smoothing  # asked only when values at points are
        self.time, self.step, self.N = entry.time, entry.step, entry.particles
        self._fields: dict[str, np.ndarray] = {}

    def __repr__(self) -> str:
        return f"<frame of step {self.step}, t = {self.time:.8g} s, {self.N} particles>"

    def __getitem__(self, name: str) -> np.ndarray:
        """A field of the file by its name, ``x`` the positions [m]: (N,), (N, dim) or (N, dim, dim).

        Values are read-only, and compared with their digest.

        Raises:
            KeyError: the file has no such field.
            DamagedError: it is not what was written.
        """
        if name not in self._fields:
            values = read_field(self.path, name)
            values.setflags(write=False)  # it is kept, and read again
            self._fields[name] = values
        return self._fields[name]

    @property
    def x(self) -> np.ndarray:
        """Positions [m], (N, dim)."""
        return self["x"]

    @property
    def v(self) -> np.ndarray:
        """Velocities [m/s], (N, dim)."""
        return self["velocity"]

    @property
    def F(self) -> np.ndarray:
        """Deformation gradients [-], (N, dim, dim)."""
        return self["deformation_gradient"]

    @property
    def J(self) -> np.ndarray:
        """Volume ratios det F [-], (N,)."""
        return self["J"] if "J" in self.units else np.linalg.det(self.F)

    @property
    def cauchy_stress(self) -> np.ndarray:
        """Cauchy stresses [Pa], (N, 3, 3)."""
        return self["cauchy_stress"]

    @property
    def pressure(self) -> np.ndarray:
        """Minus a third of the trace of the stress [Pa], (N,)."""
        return self["pressure"] if "pressure" in self.units else -np.trace(self.cauchy_stress.T) / 3.0

    @property
    def particles(self) -> np.ndarray:
        """Numbers of the particles in the simulation, (N,): all, unless a region was recorded."""
        return self["particle"] if "particle" in self.units else np.arange(self.N)

    @cached_property
    def units(self) -> dict[str, str]:
        """SI units of the fields in the file, by name."""
        return {"x": "m", **read_units(self.path)}

    def field(self, name: str) -> np.ndarray:
        """A field by its name, one of the file or one of those derived: (N, …).

        Raises:
            KeyError: the file has no such field, or not what it derives from.
        """
        return getattr(self, name) if name in DERIVED and name not in self.units else self[name]

    def interpolate(self, points: np.ndarray, name: str) -> np.ndarray:
        """A field at points of space: corrected SPH sums, exact for fields that are linear in the present positions.

        They extrapolate up to a smoothing length beyond the outermost particles, which the surface is within. Where
        bodies touch, only the body with the nearest particle counts. The weight is the run's, or the cubic spline
        where that is none of the package's.

        Args:
            points: [m], (m, dim), such as those of ``points_on_line``; in 1-D also (m,).
            name: of a field, derived ones too.

        Returns:
            (m, …), not-a-number at points outside: no particle is nearer than its smoothing length, or those within
            reach do not span the space, as where matter is drawn out to several times its length.

        Raises:
            ValueError: points of another shape or not finite, or snapshots without ``INTERPOLATION``.
            KeyError: no such field.
        """
        missing = [need for need in INTERPOLATION if need not in self.units]
        if missing:
            raise ValueError(
                f"{self.path} must hold {', '.join(INTERPOLATION)} for values at points, it lacks {missing}; write "
                "snapshots with these fields"
            )
        places, dim = np.array(points, dtype=float), self.x.shape[1]
        if places.ndim == 1 and dim == 1:
            places = places[:, None]
        if places.ndim != 2 or places.shape[1] != dim or not np.isfinite(places).all():
            raise ValueError(f"points must be (m, {dim}) finite numbers [m], got shape {np.shape(points)}: {points}")
        values, (volume, h, body) = self.field(name), (self[need] for need in INTERPOLATION)
        by, found = self._smoothing(), []
        for block in np.split(places, range(_BLOCK, len(places), _BLOCK)):
            functions = shape_functions(block, self.x, volume, h, by.weight, body=body, box=by.box)
            found.append(functions.apply(values))
        return np.concatenate(found)


@dataclass(frozen=True)
class Comparison:
    """How far two runs are apart at the times both have.

    Attributes:
        times: [s], (k,).
        rms, largest: by field, root mean square over the particles and largest length of the difference, (k,) each.
    """

    times: np.ndarray
    rms: dict[str, np.ndarray]
    largest: dict[str, np.ndarray]


class ProbeTable(dict[str, np.ndarray]):
    """Columns of a probe by name, (rows, …) each, ``step`` and ``t`` [s] among them.

    Attributes:
        units: SI units of the columns, by name.
    """

    def __init__(self, columns: Mapping[str, np.ndarray], units: Mapping[str, str]):
        super().__init__(columns)
        self.units = dict(units)


class Run(Sequence[RunFrame]):
    """The directory of a run, read lazily; it may still be running.

    Args:
        path: of the directory.

    Raises:
        FileNotFoundError: there is no run.
    """

    def __init__(self, path: str | PathLike):
        self.directory = RunDirectory(path)
        if not self.directory.holds_a_run:
            raise FileNotFoundError(self.directory.without_a_run)
        manifest = Manifest(self.directory.path)
        try:
            manifest.read()
        except DamagedError as error:
            log.warning("%s; the snapshots are read instead", error)
            manifest.examine(thorough=False)
        if not manifest.entries:
            manifest.examine(thorough=False)
        self._entries = manifest.entries

    def __repr__(self) -> str:
        return f"<run in {self.directory.path}: {len(self)} frames>"

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[RunFrame]:
        return (self[k] for k in range(len(self)))

    @overload
    def __getitem__(self, index: int) -> RunFrame: ...

    @overload
    def __getitem__(self, index: slice) -> list[RunFrame]: ...

    def __getitem__(self, index: int | slice) -> RunFrame | list[RunFrame]:
        if isinstance(index, slice):
            return [RunFrame(self.directory.path, entry, self._smoothing) for entry in self._entries[index]]
        return RunFrame(self.directory.path, self._entries[index], self._smoothing)

    def _smoothing(self) -> Smoothing:
        simulation = self.description.get("simulation", {})
        named = simulation.get("weight")
        weight = getattr(weights, named, None) if isinstance(named, str) else None
        known = isinstance(weight, type) and issubclass(weight, weights.Weight) and weight is not weights.Weight
        return Smoothing(weight() if known else weights.CubicSpline(), tuple(simulation.get("periodic", ())))  # type: ignore[misc]

    def at(self, time: float) -> RunFrame:
        """The frame nearest to ``time`` [s]."""
        return self[int(np.abs(self.times - time).argmin())]

    @property
    def times(self) -> np.ndarray:
        """Times of the frames [s], (frames,)."""
        return np.array([entry.time for entry in self._entries])

    @property
    def steps(self) -> np.ndarray:
        """Steps taken before the frames, (frames,)."""
        return np.array([entry.step for entry in self._entries], dtype=int)

    @property
    def fields(self) -> list[str]:
        """Names of the fields in the first snapshot, and of those derived from them."""
        held = list(self[0].units) if len(self) else []
        needs = {name: {"cauchy_stress" if unit == "Pa" else "deformation_gradient"} for name, unit in DERIVED.items()}
        needs["first_piola"] = {"cauchy_stress", "deformation_gradient"}
        return held + [name for name, need in needs.items() if need <= set(held) and name not in held]

    @property
    def units(self) -> dict[str, str]:
        """SI units of the fields, by name."""
        held = self[0].units if len(self) else {}
        return {name: held.get(name) or DERIVED[name] for name in self.fields}

    def displacement(self, index: int) -> np.ndarray:
        """Displacements of frame ``index`` since the first one [m], (N, dim).

        Raises:
            ValueError: the frame has other particles than the first.
        """
        first, frame = self[0], self[index]
        if not np.array_equal(first.particles, frame.particles):
            raise ValueError(f"frame {index} must have the particles of the first, got {frame.N} and {first.N}")
        return frame.x - first.x

    @cached_property
    def log(self) -> dict[str, np.ndarray]:
        """Columns of the log: ``t`` [s], ``total`` and other energies [J], ``momentum`` [kg m/s] …, (lines, …) each."""
        return read_log(self.directory.log)

    @cached_property
    def probes(self) -> dict[str, ProbeTable]:
        """The table of each probe, by its name."""
        return {name: ProbeTable(*read_table(self.directory.probes / name)) for name in self.probe_names}

    @property
    def probe_names(self) -> list[str]:
        """Names of the probes that have tables."""
        return [path.name for path in self.directory.tables if numbered(path, ".h5")]

    @property
    def description(self) -> dict[str, Any]:
        """What was run: ``simulation``, ``recording``, ``until`` [s], ``case``."""
        return self.directory.read(self.directory.description)

    @property
    def title(self) -> str:
        """Of the case file that was run; empty if there is none."""
        return str(self.description.get("case", {}).get("settings", {}).get("title", ""))

    @property
    def environment(self) -> dict[str, Any]:
        """Versions and device of each session of the run."""
        return self.directory.read(self.directory.environment)

    @property
    def status(self) -> Mapping[str, Any]:
        """How the run ended, or that it is running."""
        return self.directory.read(self.directory.status)

    @property
    def state(self) -> str:
        """``done``, ``stopped``, ``unstable``, ``failed``, ``running``, or ``killed``: it was running and is not."""
        state = self.status.get("state", "unknown")
        return "killed" if state == "running" and not self.directory.busy else state

    def to_xarray(self, fields: Sequence[str] | None = None) -> "xarray.Dataset":
        """All frames as a data set; values are read from the snapshots when they are looked at, and not kept.

        Dimensions are ``time`` [s] and ``particle``, by its number in the simulation, for vectors ``axis`` and for
        tensors ``axis_2`` too, both by their letters. Those of the stress, which has nine components in any dimension,
        are ``stress_axis`` and ``stress_axis_2``. Principal values have a dimension of their own, least first. SI units
        are the attribute ``units``.

        Args:
            fields: names, derived ones too; by default all that the snapshots hold.

        Raises:
            ModuleNotFoundError: xarray is not installed.
            ValueError: unknown fields, no snapshots, or numbers of particles that change.
        """
        try:
            from .labelled import dataset
        except ModuleNotFoundError:
            raise ModuleNotFoundError("data sets need xarray: pip install 'warp_eulsph[xarray]'") from None
        return dataset(self, fields)

    def compare(self, other: "Run", fields: Sequence[str] = ("x",)) -> Comparison:
        """Differences of the same particles in both runs, at the times that both have.

        Raises:
            ValueError: no common times, or different particles.
        """
        _, mine, theirs = np.intersect1d(self.times, other.times, return_indices=True)
        if not len(mine):
            raise ValueError(
                f"the runs have no time in common: {self.times[:3]} ... and {other.times[:3]} ... s; write their "
                "snapshots at the same times"
            )
        rms: dict[str, list[float]] = {name: [] for name in fields}
        largest: dict[str, list[float]] = {name: [] for name in fields}
        for i, j in zip(mine.tolist(), theirs.tolist(), strict=True):
            first, second = self[i], other[j]
            if not np.array_equal(first.particles, second.particles):
                raise ValueError(f"the runs must have the same particles, got {first.N} and {second.N}, or other ones")
            for name in fields:
                a, b = (frame.field(name).astype(float).reshape(first.N, -1) for frame in (first, second))
                apart = np.linalg.norm(a - b, axis=1)
                rms[name].append(float(np.sqrt(np.mean(apart**2))))
                largest[name].append(float(apart.max()))
        as_arrays = [{name: np.array(values) for name, values in found.items()} for found in (rms, largest)]
        return Comparison(self.times[mine], *as_arrays)
