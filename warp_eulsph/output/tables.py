"""Tables of probes: rows gathered in memory, written as immutable pieces, one after the other."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .atomic import replace_file


class Table:
    """Rows of one probe that wait to be written.

    Args:
        folder: of its pieces, ``0000000001.h5`` for those from step 1 on.
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
                file[name].attrs["unit"] = {"step": "-", "t": "s"}.get(name) or self.units[name]
        self.folder.mkdir(parents=True, exist_ok=True)
        replace_file(self.folder / f"{columns['step'][0]:010d}.h5", memory.getvalue())


def read_table(folder: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """All rows of a probe: its columns, (rows, …), and their units.

    Raises:
        FileNotFoundError: no such table.
    """
    import h5py

    pieces: list[dict[str, np.ndarray]] = []
    units: dict[str, str] = {}
    for path in sorted(folder.glob("*.h5")):
        with h5py.File(path, "r") as file:
            pieces.append({name: dataset[()] for name, dataset in file.items()})
            units = {name: str(dataset.attrs["unit"]) for name, dataset in file.items()}
    if not pieces:
        raise FileNotFoundError(f"no table in {folder}")
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}, units
