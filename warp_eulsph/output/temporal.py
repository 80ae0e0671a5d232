"""The index of a run: one temporal VTKHDF file of virtual datasets over all snapshots, with relative paths."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .atomic import replace_file
from .hdf5 import DIGEST, member, opened, read
from .manifest import Entry
from .snapshot import open_snapshot

_KINDS = ("Vertices", "Lines", "Polygons", "Strips")


def write_index(path: Path, entries: Sequence[Entry]) -> None:
    """Write ``path``, an index of the snapshots ``entries`` beside it, for ParaView (5.12 or newer) and VTK (9.3).

    Fields are those of the last snapshot; where one has no such field, or is lost later, it reads as not-a-number.

    Args:
        path: of the index, in the run's directory.
        entries: one or more snapshots, in order.

    Raises:
        OSError: a snapshot is not there, or the disk refused; what ``path`` held before is still there.
    """
    replace_file(path, _encode(path.parent, entries))


def read_times(path: Path) -> list[float]:
    """Times [s] of an index.

    Raises:
        OSError: no such file, or not HDF5.
        DamagedError: not an index.
    """
    with opened(path) as file:
        return read(member(file, "VTKHDF/Steps/Values")).tolist()


def _encode(directory: Path, entries: Sequence[Entry]) -> bytes:
    import h5py

    memory = io.BytesIO()
    counts = np.array([entry.particles for entry in entries], dtype=np.int64)
    firsts = np.cumsum([0, *counts[:-1]]).astype(np.int64)
    newest = directory / entries[-1].name
    with h5py.File(memory, "w", libver=("earliest", "v110")) as file, open_snapshot(newest) as (last, source):
        times, steps = [entry.time for entry in entries], [entry.step for entry in entries]
        root = write_layout(file, counts, times, steps, list(source))
        _virtual(root, "Points", last["VTKHDF/Points"], entries, firsts)
        for name in source:
            _virtual(root["PointData"], name, source[name], entries, firsts)
    return memory.getvalue()


def write_layout(file: Any, counts: np.ndarray, times: Sequence[float], steps: Sequence[int], names: list[str]) -> Any:
    """All of a temporal file but ``Points`` and the arrays ``names`` in ``PointData``; the group ``VTKHDF``.

    Args:
        file: open HDF5 file.
        counts: numbers of particles, times [s], steps: one per frame.
        names: fields, whose rows follow each other frame by frame.
    """
    frames, firsts = len(counts), np.cumsum([0, *counts[:-1]]).astype(np.int64)
    # VTK 9.3 counts one entry of Offsets more for each part before a frame's, so all frames share the first part where
    # they can, and have parts of their own where numbers of particles change.
    shared = bool((counts == counts[0]).all())
    parts, part = (counts[:1], np.zeros(frames, dtype=np.int64)) if shared else (counts, np.arange(frames))
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = np.array([2, 2], dtype=np.int64)
    root.attrs["Type"] = np.bytes_("PolyData")
    root["NumberOfPoints"] = parts
    _write_cells(root, parts)
    table = root.create_group("Steps")
    table.attrs["NSteps"] = np.int64(frames)
    table["Values"] = np.array(times)
    table["PartOffsets"] = part
    table["NumberOfParts"] = np.ones(frames, dtype=np.int64)
    table["PointOffsets"] = firsts
    first_cells = np.zeros((frames, len(_KINDS)), dtype=np.int64)
    first_cells[:, 0] = 0 if shared else firsts
    table["CellOffsets"] = table["ConnectivityIdOffsets"] = first_cells
    root.create_group("FieldData")["Step"] = np.array(steps, dtype=np.int64)
    _write_offsets(table, "FieldDataOffsets", ["Step"], np.arange(frames, dtype=np.int64))
    root.create_group("PointData")
    _write_offsets(table, "PointDataOffsets", names, firsts)
    return root


def _write_cells(root: Any, parts: np.ndarray) -> None:
    """The particles of each part as vertices 0, 1, 2, …, and no other cells."""
    for kind in _KINDS:
        group, cells = root.create_group(kind), parts if kind == "Vertices" else np.zeros_like(parts)
        group["NumberOfCells"], group["NumberOfConnectivityIds"] = cells, cells
        for name, more in (("Connectivity", 0), ("Offsets", 1)):
            ids = np.concatenate([np.arange(count + more, dtype=np.int64) for count in cells])
            group.create_dataset(name, data=ids, compression="gzip" if ids.any() else None)


def _write_offsets(steps: Any, group: str, names: Sequence[str], offsets: np.ndarray) -> None:
    made = steps.create_group(group)
    for name in names:
        made[name] = offsets


def _virtual(group: Any, name: str, source: Any, entries: Sequence[Entry], firsts: np.ndarray) -> None:
    """Dataset ``name``: that of every snapshot, one after the other."""
    import h5py

    total = sum(entry.particles for entry in entries)
    layout = h5py.VirtualLayout((total, *source.shape[1:]), source.dtype)
    for entry, first in zip(entries, firsts, strict=True):
        rows = (entry.particles, *source.shape[1:])
        layout[first : first + entry.particles] = h5py.VirtualSource(entry.name, source.name, rows, source.dtype)
    made = group.create_virtual_dataset(name, layout, fillvalue=np.nan if source.dtype.kind == "f" else -1)
    for key, value in source.attrs.items():
        if key != DIGEST:  # which is of one frame
            made.attrs[key] = value
