"""The directory of a run: what lies where, one writer at a time, and what makes room for another run.

::

    snap/0000001200.vtkhdf   snapshots, never changed once they are there
    manifest.jsonl           one line per snapshot: step, time, particles, bytes, SHA-256
    run.vtkhdf, .series      one file over all snapshots, and a list of them, for ParaView
    ckpt/0000001200.ckpt     the last two checkpoints
    log.jsonl                energies, momenta, extrema, one line per look
    probes/NAME/…h5          tables of the probes, never changed once they are there
    run.json                 what is run, with all defaults; env.json versions and device; status.json how it ended
    case.toml, case.py       the case, to be run again
    abandoned/0001/          what an earlier run left, or steps that a resumed run takes again
"""

import contextlib
import json
import os
from collections.abc import Iterable, Iterator
from os import PathLike
from pathlib import Path
from typing import Any

from .atomic import move, replace_file

_TOP = (
    "snap",
    "manifest.jsonl",
    "run.vtkhdf",
    "run.vtkhdf.series",
    "ckpt",
    "log.jsonl",
    "probes",
    "run.json",
    "case.toml",
    "case.py",
    "env.json",
    "status.json",
)


# Those who only look whether somebody writes here hold the lock for a moment [s].
_LOOK = 0.2


class BusyError(RuntimeError):
    """Another process, or another run of this one, writes into the directory."""


class RunDirectory:
    """Paths of a run's directory; making one touches nothing.

    Args:
        path: of the directory.
    """

    def __init__(self, path: str | PathLike):
        self.path = Path(path)
        self.snapshots, self.checkpoints, self.probes = (self.path / name for name in ("snap", "ckpt", "probes"))
        self.log, self.description = self.path / "log.jsonl", self.path / "run.json"
        self.environment, self.status = self.path / "env.json", self.path / "status.json"
        self.stop = self.path / "stop"  # made by a user who wants the run to stop

    @property
    def holds_a_run(self) -> bool:
        """Whether a run has begun here."""
        return self.description.exists() or any(self.snapshots.glob("*.vtkhdf"))

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep all others from writing here; the lock goes with the process, however that ends.

        Raises:
            BusyError: somebody else writes here.
        """
        from filelock import FileLock, Timeout

        self.path.mkdir(parents=True, exist_ok=True)
        lock = FileLock(self.path / "run.lock")
        try:
            lock.acquire(timeout=_LOOK)
        except Timeout:
            raise BusyError(f"another run writes into {self.path}; choose another directory, or wait for it") from None
        try:
            yield
        finally:
            lock.release()

    @property
    def busy(self) -> bool:
        """Whether somebody writes here now; also true where this cannot be found out, in a folder that is read only."""
        if not (self.path / "run.lock").exists():
            return False
        try:
            with self.locked():
                return False
        except (BusyError, OSError):
            return True

    def abandon(self) -> Path | None:
        """Move all that a run left here into a new folder of ``abandoned/``; the folder, None if there was nothing.

        Raises:
            OSError: a move was refused; every file is in one of the two places.
        """
        there = [self.path / name for name in _TOP if (self.path / name).exists()]
        if not there:
            return None
        folder = self._abandoned()
        for path in there:
            move(path, folder / path.name)
        return folder

    def rewind(self, step: int) -> Path | None:
        """Set aside snapshots, checkpoints and tables of steps after ``step``.

        Lists are left to be cut by those who keep them. The folder, None if there was nothing.

        Raises:
            OSError: a move was refused; every file is in one of the two places.
        """
        for left in [*self.path.glob("*.tmp"), *self.path.glob("*/*.tmp"), *self.probes.glob("*/*.tmp")]:
            left.unlink()  # of a file that a killed run was writing
        files = [*self.snapshots.glob("*.vtkhdf"), *self.checkpoints.glob("*.ckpt"), *self.probes.glob("*/*.h5")]
        return self.set_aside(path for path in files if int(path.stem) > step)

    def set_aside(self, files: Iterable[Path]) -> Path | None:
        """Move files of the run into a new folder of ``abandoned/``; the folder, None if there was nothing.

        Raises:
            OSError: a move was refused; every file is in one of the two places.
        """
        files = sorted(files)
        if not files:
            return None
        folder = self._abandoned()
        for path in files:
            move(path, folder / path.relative_to(self.path))
        return folder

    def read(self, path: Path) -> dict[str, Any]:
        """Content of one of the JSON files; empty if it is not there.

        Raises:
            ValueError: not JSON.
        """
        if not path.exists():
            return {}
        try:
            return json.loads(path.read_text(encoding="utf-8"))
        except ValueError as error:
            raise ValueError(f"{path} is damaged: {error}") from None

    def write(self, path: Path, content: dict[str, Any]) -> None:
        """Replace one of the JSON files.

        Raises:
            OSError: the disk refused; the file is as it was.
        """
        replace_file(path, (json.dumps(content, indent=1) + "\n").encode())

    def keep(self, name: str, text: str) -> None:
        """Replace ``case.toml`` or ``case.py``.

        Raises:
            OSError: the disk refused; the file is as it was.
        """
        replace_file(self.path / name, text.encode())

    def _abandoned(self) -> Path:
        folder = self.path / "abandoned"
        taken = [int(path.name) for path in folder.glob("[0-9]*")] if folder.exists() else []
        made = folder / f"{max(taken, default=0) + 1:04d}"
        os.makedirs(made)
        return made
