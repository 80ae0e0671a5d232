"""What a run's directory says about itself, checked against its files and made anew from them."""

from dataclasses import dataclass, field
from os import PathLike

from .checkpoint import Checkpoints, DamagedError, decode
from .directory import RunDirectory
from .log import read_lines
from .manifest import Manifest
from .series import SnapshotWriter
from .tables import read_table


@dataclass
class Findings:
    """What ``check`` found.

    Attributes:
        snapshots, checkpoints, tables: numbers of those that are whole.
        problems: one line each; none if all is well.
    """

    snapshots: int = 0
    checkpoints: int = 0
    tables: int = 0
    problems: list[str] = field(default_factory=list)


def recover(directory: str | PathLike) -> list[str]:
    """Make the manifest and the lists for ParaView anew from the snapshots; names of those that do not open.

    Those are set aside in ``abandoned/``.

    Raises:
        BusyError: a run writes into the directory.
        OSError: the disk refused; the snapshots are whole.
    """
    home = RunDirectory(directory)
    with home.locked():
        damaged = Manifest(home.path).rebuild()
        home.set_aside(home.path / name for name in damaged)
        writer = SnapshotWriter(home.path, resume=True)
        writer.derive()
    return damaged


def check(directory: str | PathLike) -> Findings:
    """Read every file of a run and compare it with its digest."""
    home, found = RunDirectory(directory), Findings()
    manifest = Manifest(home.path)
    try:
        manifest.read()
    except ValueError as error:
        found.problems.append(f"manifest.jsonl: {error}; recover makes it anew")
    wrong = manifest.damaged()
    found.problems += [f"{name}: missing, or not what was written" for name in wrong]
    found.snapshots = len(manifest.entries) - len(wrong)
    listed = {entry.name for entry in manifest.entries}
    there = sorted(f"snap/{path.name}" for path in home.snapshots.glob("*.vtkhdf"))
    found.problems += [f"{name}: not in manifest.jsonl; recover lists it" for name in there if name not in listed]
    for path in Checkpoints(home.checkpoints).paths():
        try:
            decode(path.read_bytes())
            found.checkpoints += 1
        except DamagedError as error:
            found.problems.append(f"{path.relative_to(home.path)}: {error}")
    for folder in sorted(path for path in home.probes.glob("*") if path.is_dir()):
        try:
            read_table(folder)
            found.tables += 1
        except (OSError, KeyError, ValueError) as error:
            found.problems.append(f"{folder.relative_to(home.path)}: {error}")
    if home.log.exists() and len(read_lines(home.log)) < len(home.log.read_text(encoding="utf-8").splitlines()):
        found.problems.append("log.jsonl: ends in a damaged line, which a resume takes away")
    return found
