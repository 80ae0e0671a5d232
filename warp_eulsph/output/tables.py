"""Tables of probes: rows gathered in memory, written as immutable pieces, one after the other."""

import hashlib
import io
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .atomic import append_line, replace_file
from .directory import PIECES, RunDirectory, numbered
from .hdf5 import member, names, opened, read, seal
from .sealed import DamagedError, read_lines, sealed_line

log = logging.getLogger(__name__)


class Table:
    """Rows of one probe that wait to be written.

    Args:
        folder: of its pieces, ``0000000001.h5`` for those from step 1 on; two above it the list of all pieces of a run.
        units: SI units of the columns, by name.
    """

    def __init__(self, folder: Path, units: Mapping[str, str]):
        self.folder, self.units = folder, dict(units)
        self._rows: list[dict[str, Any]] = []

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, step: int, t: float, row: Mapping[str, Any]) -> None:
        """One row of the present state."""
        self._rows.append({"step": step, "t": t, **row})

    def take(self) -> dict[str, np.ndarray]:
        """The columns of the rows that wait, which wait no longer; empty if there are none."""
        rows, self._rows = self._rows, []
        return {name: np.array([row[name] for row in rows]) for name in (rows[0] if rows else {})}

    def write(self, columns: Mapping[str, np.ndarray]) -> None:
        """Write columns that were taken as one piece.

        Raises:
            OSError: the disk refused; the pieces written before are whole.
        """
        import h5py

        if not columns:
            return
        memory = io.BytesIO()
        with h5py.File(memory, "w") as file:
            for name, column in columns.items():
                file[name] = column
                seal(file[name], column)
                file[name].attrs["unit"] = {"step": "-", "t": "s"}.get(name) or self.units[name]
        self.folder.mkdir(parents=True, exist_ok=True)
        path, content = self.folder / f"{columns['step'][0]:010d}.h5", memory.getvalue()
        replace_file(path, content)
        append_line(self.folder.parent.parent / PIECES, sealed_line(_line(path, columns, content)))


def _line(path: Path, columns: Mapping[str, np.ndarray], content: bytes) -> dict[str, Any]:
    """What the list of pieces has of one."""
    return {
        "name": f"{path.parent.name}/{path.name}",
        "step": int(columns["step"][0]),
        "last": int(columns["step"][-1]),
        "bytes": len(content),
        "sha256": hashlib.sha256(content).hexdigest(),
    }


def relist(home: RunDirectory) -> None:
    """Add to the list the pieces that it does not name and that are whole by the digests within them.

    Raises:
        OSError: the disk refused; the list is as it was.
    """
    lines = read_lines(home.pieces, ("step", "name", "sha256")).whole if home.pieces.is_file() else []
    listed = {line["name"] for line in lines}
    for folder in home.tables:
        for path in numbered(folder, ".h5"):
            if f"{folder.name}/{path.name}" not in listed:
                try:
                    lines.append(_line(path, _read_piece(path)[0], path.read_bytes()))
                except (OSError, ValueError, KeyError, IndexError) as error:
                    log.warning("%s is left out: %s", path, error)
    if lines:
        replace_file(home.pieces, "".join(f"{sealed_line(line)}\n" for line in lines).encode())


def read_table(folder: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """All rows of a probe that are what was written: its columns, (rows, …), and their units.

    A warning names pieces that are missing or damaged.

    Raises:
        FileNotFoundError: no such table.
        DamagedError: no piece of it is whole.
    """
    there, problems = examine(folder)
    for problem in problems:
        log.warning("%s; its rows are left out", problem)
    if not there:
        if problems:
            raise DamagedError(f"no piece of the table is whole: {'; '.join(problems)}")
        raise FileNotFoundError(f"no table in {folder}")
    pieces, units = zip(*there, strict=True)
    held = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
    return held, units[0]


def examine(folder: Path) -> tuple[list[tuple[dict[str, np.ndarray], dict[str, str]]], list[str]]:
    """The whole pieces of a table, columns and units each, and a line for each that is missing or damaged."""
    listing = folder.parent.parent / PIECES
    listed = {
        line["name"]: line["sha256"]
        for line in read_lines(listing, ("step", "name", "sha256")).whole
        if str(line["name"]).startswith(f"{folder.name}/")
    }
    there = {f"{folder.name}/{path.name}": path for path in numbered(folder, ".h5")}
    pieces: list[tuple[dict[str, np.ndarray], dict[str, str]]] = []
    problems = [f"{folder.parent / name}: missing" for name in listed if name not in there]
    for name, path in there.items():
        try:
            content = path.read_bytes()
            if name in listed and hashlib.sha256(content).hexdigest() != listed[name]:
                raise DamagedError("not what was written")
            piece = _read_piece(path)
            if pieces and (piece[0].keys() != pieces[0][0].keys() or piece[1] != pieces[0][1]):
                raise DamagedError("its columns are others than those of the first piece")
            pieces.append(piece)
        except (OSError, ValueError, KeyError) as error:
            problems.append(f"{path}: {error}")
    return pieces, problems


def _read_piece(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    with opened(path) as file:
        columns = {name: read(member(file, name)) for name in names(file)}
        lengths = {column.shape[:1] for column in columns.values()}
        if len(lengths) != 1 or () in lengths or "step" not in columns:
            raise DamagedError("not a piece of a table")
        return columns, {name: str(file[name].attrs["unit"]) for name in columns}
