"""The directory of a run: what lies where, one writer at a time, and what makes room for another run.

::

    snap/0000001200.vtkhdf   snapshots, never changed once they are there
    manifest.jsonl           one line per snapshot: step, time, particles, bytes, SHA-256
    run.vtkhdf, .series      one file over all snapshots, and a list of them, for ParaView
    ckpt/0000001200.ckpt     the last two checkpoints
    log.jsonl                energies, momenta, extrema, one line per look
    probes/NAME/…h5          tables of the probes, never changed once they are there; probes.jsonl one line per piece
    run.json                 what is run, with all defaults; env.json versions and device; status.json how it ended
    case.toml, case.py       the case, to be run again
    abandoned/0001/          what an earlier run left, or steps that a resumed run takes again
"""

import contextlib
import json
import logging
import os
from collections.abc import Iterable, Iterator
from os import PathLike
from pathlib import Path
from typing import Any

from ..checks import instance
from .atomic import left_behind, move, replace_file
from .sealed import DamagedError, read_text, seal, unseal

log = logging.getLogger(__name__)

#: The list of all pieces of tables.
PIECES = "probes.jsonl"
# In the order in which they move away: as long as something is left, snapshots or run.json say whose it is.
_TOP = (
    "manifest.jsonl",
    "run.vtkhdf",
    "run.vtkhdf.series",
    "ckpt",
    "log.jsonl",
    "probes",
    PIECES,
    "case.toml",
    "case.py",
    "env.json",
    "status.json",
    "snap",
    "run.json",
)


# Those who only look whether somebody writes here hold the lock for a moment [s].
_LOOK = 0.2


def numbered(folder: Path, ending: str) -> list[Path]:
    """Files of a folder that are named by a step, by that number; others are nobody's business here."""
    if not folder.is_dir():
        return []
    found = [path for path in folder.iterdir() if path.suffix == ending and _is_number(path.stem) and path.is_file()]
    return sorted(found, key=lambda path: (int(path.stem), path.name))


def _is_number(text: str) -> bool:
    return text.isascii() and text.isdecimal() and len(text) < 20


class BusyError(RuntimeError):
    """Another process, or another run of this one, writes into the directory."""


class RunDirectory:
    """Paths of a run's directory; making one touches nothing.

    Args:
        path: of the directory.
    """

    def __init__(self, path: str | PathLike):
        self.path = Path(instance(path, (str, PathLike), "directory", "'runs/column'"))
        self.snapshots, self.checkpoints, self.probes = (self.path / name for name in ("snap", "ckpt", "probes"))
        self.log, self.pieces, self.description = (self.path / name for name in ("log.jsonl", PIECES, "run.json"))
        self.environment, self.status = self.path / "env.json", self.path / "status.json"
        self.stop = self.path / "stop"  # made by a user who wants the run to stop

    @property
    def holds_a_run(self) -> bool:
        """Whether a run has begun here."""
        return self.description.is_file() or bool(numbered(self.snapshots, ".vtkhdf"))

    @property
    def without_a_run(self) -> str:
        """That no run is here, and why, in words."""
        if self.path.is_file():
            return f"no run in {self.path}, which is a file: cases are run by warp-eulsph run, into directories"
        return f"no run in {self.path}: run.json is not there"

    def check_own(self) -> None:
        """Refuse to begin a run where files of its names are somebody else's.

        Raises:
            FileExistsError: it names them; nothing was touched.
        """
        there = [name for name in (*_TOP, self.stop.name) if os.path.lexists(self.path / name)]
        if self.description.is_file():
            try:
                content, sealed = unseal(read_text(self.description))
                foreign = not sealed and not {"simulation", "recording"} <= content.keys()
            except DamagedError:
                foreign = False  # as of a run that was damaged, which moves to abandoned
        else:
            foreign = bool(there) and not self.holds_a_run
        if foreign:
            raise FileExistsError(
                f"{self.path} holds {', '.join(there)}, which no run left there; choose a directory of the run's own"
            )

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep all others from writing here; the lock goes with the process, however that ends.

        Raises:
            BusyError: somebody else writes here.
        """
        from filelock import FileLock, Timeout

        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise type(error)(
                f"a run must have a directory that can be made, got {self.path} ({error.strerror}); choose another"
            ) from error
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
            FileExistsError: what is here is somebody else's.
            OSError: a move was refused; every file is in one of the two places.
        """
        self.check_own()
        there = [self.path / name for name in _TOP if os.path.lexists(self.path / name)]
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
        for folder in (self.path, self.snapshots, self.checkpoints, *self.tables):
            for left in left_behind(folder):
                left.unlink()  # of a file that a killed run was writing
        files = numbered(self.snapshots, ".vtkhdf") + numbered(self.checkpoints, ".ckpt")
        files += [path for folder in self.tables for path in numbered(folder, ".h5")]
        return self.set_aside(path for path in files if int(path.stem) > step)

    def set_aside_misfits(self) -> None:
        """Set aside folders where a run has files, and files where it has folders: nothing could be written there.

        Raises:
            OSError: a move was refused; every file is in one of the two places.
        """
        folders = {"snap", "ckpt", "probes"}
        there = [self.path / name for name in _TOP if os.path.lexists(self.path / name)]
        wrong = [path for path in there if (path.is_dir() if path.name not in folders else not path.is_dir())]
        for path in wrong:
            log.warning("%s is not what a run has there, and is set aside", path)
        self.set_aside(wrong)

    @property
    def tables(self) -> list[Path]:
        """Folders of the probes' tables."""
        there = sorted(self.probes.iterdir()) if self.probes.is_dir() else []
        return [path for path in there if path.is_dir() and not path.is_symlink()]

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
            DamagedError: not what was written.
            OSError: it cannot be read.
        """
        if not path.exists():
            return {}
        try:
            return unseal(read_text(path))[0]
        except DamagedError as error:
            raise DamagedError(f"{path} is damaged: {error}") from None

    def salvage(self, path: Path) -> dict[str, Any]:
        """``read``, but what is damaged is set aside with a warning, and counts as not there."""
        try:
            return self.read(path)
        except DamagedError as error:
            log.warning("%s; it is set aside, and the run goes on without it", error)
            self.set_aside([path])
            return {}

    def write(self, path: Path, content: dict[str, Any]) -> None:
        """Replace one of the JSON files.

        Raises:
            OSError: the disk refused; the file is as it was.
        """
        replace_file(path, (json.dumps(seal(content), indent=1) + "\n").encode())

    def keep(self, name: str, text: str) -> None:
        """Replace ``case.toml``, ``case.py`` or a module that the case names.

        Raises:
            OSError: the disk refused; the file is as it was.
        """
        replace_file(self.path / name, text.encode())

    def _abandoned(self) -> Path:
        folder = self.path / "abandoned"
        if os.path.lexists(folder) and not folder.is_dir():
            raise FileExistsError(f"{folder} is a file, where a run sets aside what it must not lose; move it away")
        taken = [int(path.name) for path in folder.iterdir() if _is_number(path.name)] if folder.is_dir() else []
        made = folder / f"{max(taken, default=0) + 1:04d}"
        os.makedirs(made)
        return made
