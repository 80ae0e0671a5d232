"""A run's snapshots as one file for other programs: VTKHDF, XDMF, VTU, CSV, NPZ."""

import itertools
import os
from collections.abc import Callable, Iterator, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, TextIO
from xml.etree import ElementTree

import numpy as np

from .atomic import temporary_beside
from .hdf5 import DIGEST, read
from .reader import RunFrame
from .snapshot import open_snapshot, read_snapshot
from .temporal import write_layout
from .vtu import write_pvd, write_vtu

AXES = "xyz"
_BLOCK = 10_000  # rows of a table that are made text at once


def export(frames: Sequence[RunFrame], target: str | PathLike, fields: Sequence[str] | None = None) -> Path:
    """Write ``target``, in the format that its ending says; the path of it. It appears whole or not at all.

    ``.vtkhdf``: one file with all times (ParaView 5.12, VTK 9.3). ``.xdmf``: a small file that refers to the snapshots,
    which must stay where they are. ``.vtu``: one frame, ``.pvd``: a ``.vtu`` for each in a folder beside it; both need
    PyVista. ``.csv``: a row per particle and time, a column per component. ``.npz``: numpy arrays ``time``, ``step``,
    ``x`` and the fields, the first axis the time.

    Args:
        frames: of a run, in order; of equal numbers of particles for ``.npz``.
        target: file to make or replace.
        fields: names of fields in the snapshots; all that the first one has if None.

    Raises:
        ValueError: unknown ending or field, or numbers of particles that change.
        ModuleNotFoundError: PyVista is not installed.
        OSError: a snapshot is not there, or the disk refused.
    """
    path = Path(target)
    if path.suffix not in FORMATS:
        raise ValueError(f"{path}: the ending must be one of {', '.join(FORMATS)}, got {path.suffix!r}")
    held = [name for name in frames[0].units if name != "x"]
    names = held if fields is None else list(fields)
    unknown = [name for name in names if name not in held]
    if unknown:
        raise ValueError(f"fields must be among {held}, got {unknown}")
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = temporary_beside(path)
    try:
        FORMATS[path.suffix](temporary, path, [frame.path for frame in frames], names)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    return path


def columns(name: str, values: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Name and values of each component: ``velocity_x``, ``cauchy_stress_xy``; a scalar keeps its name."""
    for column, index in enumerate(np.ndindex(values.shape[1:])):
        suffix = "".join(AXES[i] for i in index)
        yield f"{name}_{suffix}" if suffix else name, values.reshape(len(values), -1)[:, column]


def _write_csv(temporary: Path, target: Path, files: list[Path], names: list[str]) -> None:
    with temporary.open("w", newline="", encoding="utf-8") as file:
        for k, path in enumerate(files):
            snapshot = read_snapshot(path)
            count = len(snapshot.x)
            table = {"time": np.full(count, snapshot.time)}
            table["particle"] = snapshot.fields.get("particle", np.arange(count))
            table |= {AXES[i]: snapshot.x[:, i] for i in range(snapshot.x.shape[1])}
            for name in names:
                table |= dict(columns(name, snapshot.fields[name]))
            if k == 0:
                file.write(",".join(table) + "\r\n")
            _write_rows(file, list(table.values()))


def _write_rows(file: TextIO, table: list[np.ndarray]) -> None:
    """Rows of the columns, in digits that read back as the same numbers of the stored precision."""
    row = ",".join("%.9g" if column.dtype == np.float32 else "%r" for column in table) + "\r\n"
    for first in range(0, len(table[0]), _BLOCK):
        lists = [column[first : first + _BLOCK].tolist() for column in table]
        # One format of many rows at once: a call per number takes twice the time.
        file.write(row * len(lists[0]) % tuple(itertools.chain.from_iterable(zip(*lists, strict=True))))


def _write_npz(temporary: Path, target: Path, files: list[Path], names: list[str]) -> None:
    snapshots = [read_snapshot(path) for path in files]
    counts = {len(snapshot.x) for snapshot in snapshots}
    if len(counts) > 1:
        raise ValueError(f"{target}: arrays need the same number of particles at all times, got {sorted(counts)}")
    arrays: dict[str, Any] = {name: np.stack([snapshot.fields[name] for snapshot in snapshots]) for name in names}
    time = np.array([snapshot.time for snapshot in snapshots])
    step = np.array([snapshot.step for snapshot in snapshots])
    with temporary.open("wb") as file:
        np.savez(file, time=time, step=step, x=np.stack([snapshot.x for snapshot in snapshots]), **arrays)


def _write_xdmf(temporary: Path, target: Path, files: list[Path], names: list[str]) -> None:
    root = ElementTree.Element("Xdmf", Version="3.0")
    domain = ElementTree.SubElement(root, "Domain")
    series = ElementTree.SubElement(domain, "Grid", Name="particles", GridType="Collection", CollectionType="Temporal")
    for path in files:
        place = os.path.relpath(path.absolute(), target.parent.absolute())
        with open_snapshot(path) as (file, data):
            points = file["VTKHDF/Points"]
            grid = ElementTree.SubElement(series, "Grid", Name=f"step {int(file.attrs['step'])}", GridType="Uniform")
            ElementTree.SubElement(grid, "Time", Value=repr(float(file.attrs["time"])))
            count = str(len(points))
            ElementTree.SubElement(
                grid, "Topology", TopologyType="Polyvertex", NumberOfElements=count, NodesPerElement="1"
            )
            geometry = ElementTree.SubElement(grid, "Geometry", GeometryType="XYZ")
            _refer(geometry, points, place)
            for name in names:
                kind = {1: "Scalar", 2: "Vector"}[data[name].ndim]
                kind = "Tensor" if data[name].shape[1:] == (9,) else kind
                attribute = ElementTree.SubElement(grid, "Attribute", Name=name, AttributeType=kind, Center="Node")
                _refer(attribute, data[name], place)
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(temporary, encoding="utf-8", xml_declaration=True)


def _refer(parent: ElementTree.Element, dataset: Any, place: str) -> None:
    kind = "Int" if dataset.dtype.kind == "i" else "Float"
    item = ElementTree.SubElement(
        parent,
        "DataItem",
        Format="HDF",
        NumberType=kind,
        Precision=str(dataset.dtype.itemsize),
        Dimensions=" ".join(str(size) for size in dataset.shape),
    )
    item.text = f"{place}:{dataset.name}"


def _write_vtkhdf(temporary: Path, target: Path, files: list[Path], names: list[str]) -> None:
    import h5py

    counts, times, steps = [], [], []
    for path in files:
        with open_snapshot(path) as (file, _):
            counts.append(len(file["VTKHDF/Points"]))
            times.append(float(file.attrs["time"]))
            steps.append(int(file.attrs["step"]))
    with h5py.File(temporary, "w", libver=("earliest", "v110")) as out:
        root = write_layout(out, np.array(counts, dtype=np.int64), times, steps, names)
        for path in files:
            with open_snapshot(path) as (file, data):
                _append(root, "Points", file["VTKHDF/Points"])
                for name in names:
                    _append(root["PointData"], name, data[name])


def _append(group: Any, name: str, source: Any) -> None:
    """The rows of ``source`` to the end of dataset ``name``."""
    if name not in group:
        shape = (0, *source.shape[1:])
        chunks = (max(1, min(len(source), 65536)), *source.shape[1:])
        made = group.create_dataset(name, shape, source.dtype, maxshape=(None, *source.shape[1:]), chunks=chunks)
        for key, value in source.attrs.items():
            if key != DIGEST:  # which is of one frame
                made.attrs[key] = value
    rows = len(group[name])
    group[name].resize(rows + len(source), axis=0)
    group[name][rows:] = read(source)


Writer = Callable[[Path, Path, list[Path], list[str]], None]
#: Ending of a file -> what writes it.
FORMATS: dict[str, Writer] = {
    ".vtkhdf": _write_vtkhdf,
    ".xdmf": _write_xdmf,
    ".vtu": write_vtu,
    ".pvd": write_pvd,
    ".csv": _write_csv,
    ".npz": _write_npz,
}
