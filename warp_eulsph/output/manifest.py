"""The manifest: one line of JSON per snapshot, forced to disk before the run goes on."""

import hashlib
import logging
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from .atomic import append_line, replace_file
from .directory import numbered
from .sealed import DamagedError, read_lines, sealed_line

log = logging.getLogger(__name__)

_NAME = re.compile(r"snap/[0-9]+\.vtkhdf")


class Entry(NamedTuple):
    """One snapshot: path relative to the run, step, time [s], number of particles, size, SHA-256 of the file."""

    name: str
    step: int
    time: float
    particles: int
    bytes: int
    sha256: str

    @property
    def line(self) -> str:
        """As the manifest has it, the time exactly."""
        content = self._asdict() | {"time": self.time.hex()}
        return sealed_line({("N" if key == "particles" else key): value for key, value in content.items()})

    @classmethod
    def parse(cls, content: Mapping[str, Any]) -> "Entry":
        """The entry of a line's content.

        Raises:
            ValueError: not a line of a manifest.
        """
        try:
            time = float.fromhex(content["time"])
            entry = cls(content["name"], content["step"], time, content["N"], content["bytes"], content["sha256"])
        except (KeyError, TypeError, OverflowError) as error:
            raise ValueError(f"not a manifest line: {content!r}") from error
        numbers = (entry.step, entry.particles, entry.bytes)
        if not all(isinstance(number, int) and number >= 0 for number in numbers) or not _NAME.fullmatch(entry.name):
            raise ValueError(f"not a manifest line: {content!r}")
        return entry


class Manifest:
    """The snapshots of a run in order of their steps.

    Args:
        directory: of the run.
    """

    def __init__(self, directory: Path):
        self.directory, self.path = directory, directory / "manifest.jsonl"
        self.entries: list[Entry] = []

    def read(self) -> None:
        """Take the entries from the file, which may be absent; an unfinished last line is not one yet.

        Raises:
            DamagedError: lines are damaged, which are left out; ``rebuild`` reads their snapshots instead.
        """
        self.entries, damaged = self._lines()
        if damaged:
            raise DamagedError(f"{self.path.name}: lines {damaged} are damaged")

    def _lines(self) -> tuple[list[Entry], list[int]]:
        """The entries of whole lines, and the numbers of damaged ones; what is no file is one damaged line."""
        try:
            lines = read_lines(self.path, ("name", "step"))
        except (DamagedError, OSError) as error:
            log.warning("%s", error)
            return [], [1]
        entries, damaged = [], list(lines.damaged)
        for content in lines.whole:
            try:
                entries.append(Entry.parse(content))
            except ValueError as error:
                log.warning("%s: %s", self.path, error)
                damaged.append(0)
        return entries, damaged

    def load(self) -> list[str]:
        """``read``, or as ``rebuild`` where lines are damaged or do not name the snapshots that are there.

        Sizes of the snapshots are compared, ``rebuild`` compares digests. Names of snapshots that are not what was
        written, which are left out.

        Raises:
            OSError: the disk refused; the file is as it was.
        """
        there = {f"snap/{path.name}": path.stat().st_size for path in self._files()}
        self.entries, lines = self._lines()
        if not lines and {entry.name: entry.bytes for entry in self.entries} == there:
            if self.entries:
                self.replace(self.entries)  # without an unfinished line
            return []
        log.warning("%s does not name the snapshots that are there and is made anew", self.path)
        return self.rebuild(thorough=False)

    def add(self, entry: Entry) -> None:
        """Append an entry; one of the same name is there already when a frame is written twice.

        Raises:
            OSError: the disk refused; the file is as it was.
        """
        if self.entries and self.entries[-1].name == entry.name:
            self.replace([*self.entries[:-1], entry])
        else:
            append_line(self.path, entry.line)
            self.entries.append(entry)

    def replace(self, entries: list[Entry]) -> None:
        """Write the file anew.

        Raises:
            OSError: the disk refused; the file is as it was.
        """
        replace_file(self.path, "".join(f"{entry.line}\n" for entry in entries).encode())
        self.entries = list(entries)

    def rebuild(self, *, thorough: bool = True) -> list[str]:
        """As ``examine``, and write the file; names of snapshots that are not what was written.

        Raises:
            OSError: the disk refused; the file is as it was.
        """
        damaged = self.examine(thorough=thorough)
        self.replace(self.entries)
        return damaged

    def examine(self, *, thorough: bool = True) -> list[str]:
        """Take the entries from whole lines, and from the snapshots that none of these names.

        A snapshot that a line names must be what was written then, by its size and with ``thorough`` its digest; it
        never gets another digest. One that none names must be whole by the digests within it. The names of those that
        are not, which are left out.
        """
        listed = {entry.name: entry for entry in self._lines()[0]}
        found, damaged = [], []
        for path in self._files():
            name = f"snap/{path.name}"
            try:
                if name not in listed:
                    found.append(_examine(path))
                elif self._is_whole(listed[name], by_size=not thorough):
                    found.append(listed[name])
                else:
                    raise DamagedError("not what was written")
            except (OSError, ValueError, KeyError) as error:
                damaged.append(name)
                log.warning("snapshot %s is left out: %s", path, error)
        self.entries = found
        return damaged

    def _files(self) -> list[Path]:
        return numbered(self.directory / "snap", ".vtkhdf")

    def _is_whole(self, entry: Entry, *, by_size: bool = False) -> bool:
        path = self.directory / entry.name
        if not path.is_file() or path.stat().st_size != entry.bytes:
            return False
        return by_size or hashlib.sha256(path.read_bytes()).hexdigest() == entry.sha256

    def damaged(self) -> list[str]:
        """Names of snapshots that are missing or not what was written."""
        return [entry.name for entry in self.entries if not self._is_whole(entry)]


def entry_of(name: str, step: int, time: float, particles: int, content: bytes) -> Entry:
    """The entry of a snapshot with this content."""
    return Entry(name, step, time, particles, len(content), hashlib.sha256(content).hexdigest())


def _examine(path: Path) -> Entry:
    from .snapshot import read_snapshot

    snapshot = read_snapshot(path)
    name = f"{path.parent.name}/{path.name}"
    return entry_of(name, snapshot.step, snapshot.time, len(snapshot.x), path.read_bytes())
