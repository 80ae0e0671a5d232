"""The snapshots of a run, in order."""

import json
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .atomic import replace_file
from .copies import Copies
from .directory import RunDirectory
from .fields import known_fields
from .manifest import Manifest, entry_of
from .recorded import Recorded
from .snapshot import Frame, checked_precision, collect, encode
from .temporal import write_index

# The index names every snapshot, so that making it costs more from frame to frame: half as many again are worth it.
_GROWTH = 1.5


class SnapshotWriter:
    """Writes ``snap/0000001200.vtkhdf`` for step 1200, its line in ``manifest.jsonl``, and the lists for ParaView.

    ``run.vtkhdf.series`` lists the snapshots with their times; ``run.vtkhdf`` is one file over all of them, renewed
    when half as many again have come and by ``finish``. A new writer starts a new run: what an older one left in the
    directory moves to ``abandoned/`` there.

    Attributes:
        manifest: of the snapshots written.
        last: path of the last snapshot written, None before the first.

    Args:
        directory: of the run; made if absent.
        fields: names of ``FIELDS`` (or ``TRANSPORT_FIELDS``); those by default if None.
        dtype: ``np.float32`` or ``np.float64`` of the stored reals.
        particles: numbers of those that snapshots hold, (k,), written as the field ``particle`` too; all if None.
        resume: go on after the snapshots that are there.

    Raises:
        ValueError: unknown field or dtype.
    """

    def __init__(
        self,
        directory: str | PathLike,
        fields: Iterable[str] | None = None,
        *,
        dtype: Any = np.float32,
        particles: np.ndarray | None = None,
        resume: bool = False,
    ):
        self.directory = Path(directory)
        self.fields, self.dtype = known_fields(fields), checked_precision(dtype)
        self.particles, self.manifest = particles, Manifest(self.directory)
        if particles is not None and self.fields is not None and "particle" not in self.fields:
            self.fields = (*self.fields, "particle")
        self._indexed = 0
        self._copies: Copies | None = None
        if not resume:
            RunDirectory(self.directory).abandon()
        (self.directory / "snap").mkdir(parents=True, exist_ok=True)
        if resume:
            damaged = self.manifest.load()
            RunDirectory(self.directory).set_aside(self.directory / name for name in damaged)
            self._indexed = len(self.manifest.entries)

    @property
    def last(self) -> Path | None:
        """Path of the last snapshot written, None before the first."""
        return self.directory / self.manifest.entries[-1].name if self.manifest.entries else None

    @property
    def series(self) -> Path:
        """The list for ParaView."""
        return self.directory / "run.vtkhdf.series"

    @property
    def index(self) -> Path:
        """The file over all snapshots, for ParaView."""
        return self.directory / "run.vtkhdf"

    def write(self, simulation: Recorded) -> Path:
        """Write the present state; the path of its file.

        Raises:
            OSError: the disk refused; the files written before are whole.
        """
        frame = self.collect(simulation)
        frame.wait()
        return self.commit(frame)

    def collect(self, simulation: Recorded) -> Frame:
        """The present state, for ``commit`` to write once its ``wait`` was called."""
        if self._copies is None or self._copies.device != simulation.device:
            self._copies = Copies(simulation.device)
        return collect(simulation, self.fields, self.particles, self._copies)

    def commit(self, frame: Frame) -> Path:
        """Write a frame collected before, and release it; the path of its file.

        Raises:
            OSError: the disk refused; the files written before are whole.
        """
        name, content = f"snap/{frame.step:010d}.vtkhdf", encode(frame, self.dtype)
        replace_file(self.directory / name, content)
        self.manifest.add(entry_of(name, frame.step, frame.time, len(frame.x), content))
        frame.release()
        self._write_series()
        if len(self.manifest.entries) > _GROWTH * self._indexed:
            self._write_index()
        return self.directory / name

    def finish(self) -> None:
        """Bring the index up to date.

        Raises:
            OSError: the disk refused; the snapshots are whole.
        """
        if len(self.manifest.entries) != self._indexed:
            self._write_index()

    def derive(self) -> None:
        """Write the lists anew from the manifest, or remove them when there are no snapshots.

        Raises:
            OSError: the disk refused; the snapshots are whole.
        """
        if self.manifest.entries:
            self._write_series()
            self._write_index()
        else:
            for path in (self.series, self.index):
                path.unlink(missing_ok=True)

    def _write_series(self) -> None:
        files = [{"name": entry.name, "time": entry.time} for entry in self.manifest.entries]
        listing = {"file-series-version": "1.0", "files": files}
        replace_file(self.series, (json.dumps(listing, indent=1) + "\n").encode())

    def _write_index(self) -> None:
        write_index(self.index, self.manifest.entries)
        self._indexed = len(self.manifest.entries)
