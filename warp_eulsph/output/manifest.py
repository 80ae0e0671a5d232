"""The manifest: one line of JSON per snapshot, forced to disk before the run goes on."""

import hashlib
import json
import logging
from pathlib import Path
from typing import NamedTuple

from .atomic import append_line, replace_file

log = logging.getLogger(__name__)


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
        return json.dumps({("N" if key == "particles" else key): value for key, value in content.items()})

    @classmethod
    def parse(cls, line: str) -> "Entry":
        """The entry of a line.

        Raises:
            ValueError: not a line of a manifest, such as one that was cut short.
        """
        try:
            content = json.loads(line)
            time = float.fromhex(content["time"])
            return cls(content["name"], content["step"], time, content["N"], content["bytes"], content["sha256"])
        except (KeyError, TypeError) as error:
            raise ValueError(f"not a manifest line: {line!r}") from error


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
            ValueError: a line is damaged; ``rebuild`` reads the snapshots instead.
        """
        text = self.path.read_text(encoding="utf-8") if self.path.exists() else ""
        self.entries = [Entry.parse(line) for line in text[: text.rfind("\n") + 1].splitlines()]

    def load(self) -> None:
        """``read``, or ``rebuild`` where the file is damaged or does not name the snapshots that are there.

        Raises:
            OSError: the disk refused; the file is as it was.
        """
        there = {f"snap/{path.name}": path.stat().st_size for path in (self.directory / "snap").glob("*.vtkhdf")}
        try:
            self.read()
        except ValueError as error:
            log.warning("%s is damaged and is made anew from the snapshots: %s", self.path, error)
            self.rebuild()
            return
        if {entry.name: entry.bytes for entry in self.entries} != there:
            log.warning("%s does not name the snapshots that are there and is made anew from them", self.path)
            self.rebuild()
        elif self.entries:
            self.replace(self.entries)  # without an unfinished line

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

    def rebuild(self) -> list[str]:
        """Derive the entries from the snapshots that are there; names of those that do not open, which are left out.

        Raises:
            OSError: the disk refused; the file is as it was.
        """
        damaged = self.examine()
        self.replace(self.entries)
        return damaged

    def examine(self) -> list[str]:
        """Take the entries from the snapshots themselves; names of those that do not open, which are left out."""
        found, damaged = [], []
        for path in sorted((self.directory / "snap").glob("*.vtkhdf")):
            try:
                found.append(_examine(path))
            except (OSError, ValueError, KeyError) as error:
                damaged.append(f"snap/{path.name}")
                log.warning("snapshot %s does not open and is left out: %s", path, error)
        self.entries = found
        return damaged

    def damaged(self) -> list[str]:
        """Names of snapshots that are missing or not what was written."""
        wrong = []
        for entry in self.entries:
            path = self.directory / entry.name
            if not path.exists() or hashlib.sha256(path.read_bytes()).hexdigest() != entry.sha256:
                wrong.append(entry.name)
        return wrong


def entry_of(name: str, step: int, time: float, particles: int, content: bytes) -> Entry:
    """The entry of a snapshot with this content."""
    return Entry(name, step, time, particles, len(content), hashlib.sha256(content).hexdigest())


def _examine(path: Path) -> Entry:
    from .snapshot import read_snapshot

    snapshot = read_snapshot(path)
    name = f"{path.parent.name}/{path.name}"
    return entry_of(name, snapshot.step, snapshot.time, len(snapshot.x), path.read_bytes())
