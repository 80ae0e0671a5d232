"""One frame, one immutable file: plain HDF5 that is a static VTKHDF PolyData too (ParaView, VTK, PyVista, h5py)."""

import contextlib
import functools
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from ..fields import STATE
from .atomic import replace_file
from .copies import Copies, Copy
from .fields import SnapshotField, chosen_fields, source
from .hdf5 import DIGEST, check_layout, digest_of_layout, member, names, opened, read, seal
from .recorded import Recorded
from .sealed import DamagedError
from .tensors import padded

# The key of the positions among the datasets of a snapshot; no field can have it.
_POINTS = "/Points"


@dataclass(frozen=True)
class Snapshot:
    """A frame read back.

    Attributes:
        time: [s], float64 as the run had it.
        step: steps taken before it.
        x: positions [m], (n, dim).
        fields: name -> values in their natural shape: (n,), (n, dim), (n, dim, dim); stress (n, 3, 3).
        units: name -> SI unit.
    """

    time: float
    step: int
    x: np.ndarray
    fields: dict[str, np.ndarray]
    units: dict[str, str]


@dataclass(frozen=True)
class Frame:
    """A state on the host or on its way there, to be written while the simulation goes on.

    Attributes:
        time: [s]. step: steps taken. dim: dimension.
        fields: to write, by name. copies: what they are made of, (n, …) each, with the positions ``x`` [m].
    """

    time: float
    step: int
    dim: int
    fields: Mapping[str, SnapshotField]
    copies: Mapping[str, Copy]

    @property
    def on_its_way(self) -> bool:
        """Whether ``wait`` has yet to be called."""
        return any(copy.on_its_way for copy in self.copies.values())

    def wait(self) -> None:
        """Wait until all of it is on the host."""
        for copy in self.copies.values():
            copy.wait()

    def release(self) -> None:
        """Leave the memory to later frames."""
        for copy in self.copies.values():
            copy.release()

    @functools.cached_property
    def sources(self) -> dict[str, np.ndarray]:
        """What the fields are made of, (n, …) each."""
        return {name: copy.values for name, copy in self.copies.items()}

    @property
    def x(self) -> np.ndarray:
        """Positions [m], (n, dim)."""
        return self.sources["x"]

    def values(self) -> dict[str, np.ndarray]:
        """The fields by name, in their natural shape."""
        held = self.sources
        return {name: field.values(*(held[source] for source in field.sources)) for name, field in self.fields.items()}


def collect(
    simulation: Recorded, names: Iterable[str] | None, particles: np.ndarray | None = None, copies: Copies | None = None
) -> Frame:
    """What the fields of these ``names`` are made of in the present state.

    Args:
        names: of fields; those by default if None.
        particles: numbers of those asked for, (k,); all if None.
        copies: makes the copies, which may be on their way then; if None all is there.
    """
    simulation.whole.check()
    fields, places = chosen_fields(names, simulation), simulation.order.places
    numbers = np.arange(len(places)) if particles is None else particles
    chosen = places if particles is None else places[particles]
    needed = dict.fromkeys(["x", *(name for field in fields.values() for name in field.sources)])
    taken = Copies(simulation.device) if copies is None else copies
    sources = {}
    for name in needed:
        made = source(name, simulation)
        sources[name] = taken.take(made, chosen if isinstance(made, wp.array) else numbers)
    frame = Frame(simulation.t, simulation.steps, simulation.space.dim, fields, sources)
    if copies is None:
        frame.wait()
    return frame


def checked_precision(dtype: Any) -> np.dtype:
    """The dtype that reals are stored in.

    Raises:
        ValueError: neither ``np.float32`` nor ``np.float64``.
    """
    if np.dtype(dtype) not in (np.dtype(np.float32), np.dtype(np.float64)):
        raise ValueError(f"dtype must be numpy.float32 or numpy.float64, got {dtype}")
    return np.dtype(dtype)


def write_snapshot(
    path: str | PathLike, simulation: Recorded, fields: Iterable[str] | None = None, *, dtype: Any = np.float32
) -> None:
    """Write the present state to ``path``, which appears whole or not at all.

    Args:
        path: file to make or replace, by custom ``*.vtkhdf``.
        simulation: its state.
        fields: names of ``FIELDS`` (or ``TRANSPORT_FIELDS``); those by default if None. Positions are always there.
        dtype: ``np.float32`` or ``np.float64`` for positions and real fields; time is float64 always.

    Raises:
        ValueError: unknown field or dtype.
        OSError: nothing was written; what ``path`` held before is still there.
    """
    precision = checked_precision(dtype)
    replace_file(Path(path), encode(collect(simulation, fields), precision))


def encode(frame: Frame, dtype: np.dtype) -> bytes:
    """The file of a frame, made in memory: HDF5 itself leaves wrecks on a full disk, and errors that come too late."""
    import h5py

    dim, n, values = frame.dim, len(frame.x), frame.values()
    # VTK's HDF5 is older than h5py's: newer file formats than 1.10's do not open there.
    with h5py.File("frame", "w", driver="core", backing_store=False, libver=("earliest", "v110")) as file:
        file.attrs["time"], file.attrs["time_unit"] = np.float64(frame.time), "s"
        file.attrs["step"], file.attrs["dimension"] = np.int64(frame.step), np.int64(dim)
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 2], dtype=np.int64)
        root.attrs["Type"] = np.bytes_("PolyData")  # fixed-length ASCII; VTK reads no other kind
        root["NumberOfPoints"] = np.array([n], dtype=np.int64)
        points = np.zeros((n, 3), dtype=dtype)
        points[:, :dim] = frame.x
        root["Points"] = points
        root["Points"].attrs["unit"] = STATE["x"].unit
        seal(root["Points"], points)
        _write_cells(root, n)
        data = root.create_group("PointData")
        for name, value in values.items():
            _write_field(data, name, frame.fields[name], value, dim, dtype)
        _mark_active(data, values)
        root["FieldData/TimeValue"] = np.array([frame.time])  # the name VTK gives to a data set's time
        root["FieldData/Step"] = np.array([frame.step], dtype=np.int64)
        datasets = {**{name: data[name] for name in values}, _POINTS: root["Points"]}
        file.attrs[DIGEST] = digest_of_layout(file, datasets)
        file.flush()
        image: bytes = file.id.get_file_image()
        return image


def _write_cells(root: Any, n: int) -> None:
    """One vertex cell per particle; the other kinds of cells must be there and are empty."""
    for kind, cells in (("Vertices", n), ("Lines", 0), ("Polygons", 0), ("Strips", 0)):
        group = root.create_group(kind)
        group["NumberOfCells"] = np.array([cells], dtype=np.int64)
        group["NumberOfConnectivityIds"] = np.array([cells], dtype=np.int64)
        for name, size in (("Connectivity", cells), ("Offsets", cells + 1)):
            if size < 2:
                group[name] = np.arange(size, dtype=np.int64)
                continue
            filters = {"chunks": (size,), "shuffle": True, "compression": "gzip", "compression_opts": 1}
            group.create_dataset(name, (size,), "<i8", **filters).id.write_direct_chunk((0,), _ids(size))


@functools.lru_cache(maxsize=2)
def _ids(size: int) -> bytes:
    """0, 1, … ``size`` − 1 as HDF5 shuffles and deflates them: the same in each frame, so that none pays for them."""
    ids = np.arange(size, dtype="<i8")
    return zlib.compress(ids.view(np.uint8).reshape(size, 8).T.tobytes(), 1)


def _write_field(data: Any, name: str, field: SnapshotField, value: np.ndarray, dim: int, dtype: np.dtype) -> None:
    shape = field.shape(dim)
    stored = value if value.dtype.kind == "i" else value.astype(dtype)
    if len(shape) == 1:
        stored = np.pad(stored, ((0, 0), (0, 3 - dim)))
    elif len(shape) == 2:
        stored = padded(stored, 1.0).reshape(len(stored), 9)  # row by row; VTK reads no (n, 3, 3)
    dataset = data.create_dataset(name, data=stored)
    dataset.attrs["unit"], dataset.attrs["meaning"] = field.unit, field.meaning
    dataset.attrs["shape"] = np.array(shape, dtype=np.int64)
    seal(dataset, stored)


def _mark_active(data: Any, values: dict[str, np.ndarray]) -> None:
    """Mark the first vector and the first tensor field; VTK's reader drops all but the last of two so marked."""
    for rank, attribute in ((2, "Vectors"), (3, "Tensors")):
        first = next((name for name, value in values.items() if value.ndim == rank), None)
        if first is not None:
            data[first].attrs["Attribute"] = np.bytes_(attribute)


def read_snapshot(path: str | PathLike) -> Snapshot:
    """Read a file of ``write_snapshot``.

    Raises:
        OSError: no such file, or not HDF5.
        ValueError: HDF5, but not such a file.
        DamagedError: not what was written.
    """
    with open_snapshot(path) as (file, data):
        fields = {name: _natural(dataset) for name, dataset in data.items()}
        units = {name: str(dataset.attrs["unit"]) for name, dataset in data.items()}
        return Snapshot(float(file.attrs["time"]), int(file.attrs["step"]), _positions(file), fields, units)


def read_moment(path: str | PathLike) -> tuple[int, float, int]:
    """Step, time [s] and number of particles of a snapshot; raises like ``read_snapshot``."""
    with open_snapshot(path) as (file, _):
        return int(file.attrs["step"]), float(file.attrs["time"]), len(file["VTKHDF/Points"])


def read_units(path: str | PathLike) -> dict[str, str]:
    """Fields of a snapshot besides the positions, with their units; raises like ``read_snapshot``."""
    with open_snapshot(path) as (_, data):
        return {name: str(dataset.attrs["unit"]) for name, dataset in data.items()}


def read_field(path: str | PathLike, name: str) -> np.ndarray:
    """One field of a snapshot in its natural shape, ``x`` the positions; raises like ``read_snapshot``.

    Raises:
        KeyError: the snapshot has no such field.
    """
    with open_snapshot(path) as (file, data):
        if name == "x":
            return _positions(file)
        if name not in data:
            raise KeyError(f"{path} holds no {name!r}, only {['x', *data]}")
        return _natural(data[name])


@contextlib.contextmanager
def open_snapshot(path: str | PathLike) -> Iterator[tuple[Any, dict[str, Any]]]:
    """The open file and the datasets of its fields by name; raises like ``read_snapshot``."""
    with opened(path) as file:
        yield file, _fields(path, file)


def _fields(path: str | PathLike, file: Any) -> dict[str, Any]:
    """Datasets of the fields by name, of a file whose layout is what was written."""
    missing = [key for key in ("time", "step", "dimension") if key not in file.attrs]
    if missing or "VTKHDF/PointData" not in file:
        raise ValueError(f"{path} is not a snapshot of this package: missing {missing or 'VTKHDF/PointData'}")
    group, points = member(file, "VTKHDF/PointData"), member(file, "VTKHDF/Points")
    data = {name: member(group, name) for name in names(group)}
    check_layout(file, {**data, _POINTS: points})
    dim = file.attrs["dimension"]
    whole = len(points.shape) == 2 and points.shape[1] == 3 and dim in (1, 2, 3)
    for dataset in data.values():
        shape = np.asarray(dataset.attrs.get("shape"))
        whole &= dataset.shape[:1] == points.shape[:1] and shape.dtype.kind == "i" and shape.ndim == 1
        whole &= "unit" in dataset.attrs and len(shape) <= 2 and dataset.shape[1:] == ((), (3,), (9,))[len(shape)]
    if not whole:
        raise DamagedError(f"{path}: shapes of the fields are not those of a snapshot")
    return data


def _positions(file: Any) -> np.ndarray:
    return read(member(file, "VTKHDF/Points"))[:, : int(file.attrs["dimension"])]


def _natural(dataset: Any) -> np.ndarray:
    """Stored rows without the padding."""
    stored, shape = read(dataset), tuple(int(i) for i in dataset.attrs["shape"])
    if len(shape) == 1:
        return stored[:, : shape[0]]
    if len(shape) == 2:
        return stored.reshape(-1, 3, 3)[:, : shape[0], : shape[1]]
    return stored
