"""The snapshots of a run, in order."""

import json
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..simulation import Simulation
from .atomic import replace_file
from .snapshot import chosen_fields, write_snapshot


class SnapshotWriter:
    """Writes ``snap/0000001200.vtkhdf`` for step 1200 and keeps ``run.vtkhdf.series`` listing them with their times.

    Open the ``.series`` file in ParaView to see the run. A new writer starts a new list; snapshots that an older run
    left in the directory are replaced when their step comes round again, and not listed.

    Attributes:
        last: path of the last snapshot written, None before the first.

    Args:
        directory: of the run; made if absent.
        fields: names of ``snapshot.FIELDS``; all if None.
        dtype: ``np.float32`` or ``np.float64`` of the stored reals.

    Raises:
        ValueError: unknown field.
    """

    def __init__(self, directory: str | PathLike, fields: Iterable[str] | None = None, *, dtype: Any = np.float32):
        self.directory = Path(directory)
        self.fields, self.dtype = chosen_fields(fields), dtype
        self.frames: list[tuple[str, float]] = []
        self.last: Path | None = None
        (self.directory / "snap").mkdir(parents=True, exist_ok=True)

    @property
    def series(self) -> Path:
        """The list for ParaView."""
        return self.directory / "run.vtkhdf.series"

    def write(self, simulation: Simulation) -> Path:
        """Write the present state; the path of its file.

        Raises:
            OSError: the disk refused; the files written before are whole.
        """
        name = f"snap/{simulation.steps:010d}.vtkhdf"
        write_snapshot(self.directory / name, simulation, self.fields, dtype=self.dtype)
        if not self.frames or self.frames[-1][0] != name:  # a frame written twice is listed once
            self.frames.append((name, simulation.t))
        listing = {"file-series-version": "1.0", "files": [{"name": f, "time": t} for f, t in self.frames]}
        replace_file(self.series, lambda temporary: _write_text(temporary, json.dumps(listing, indent=1) + "\n"))
        self.last = self.directory / name
        return self.last


def _write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
