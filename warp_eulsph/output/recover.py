"""What a run's directory says about itself, checked against its files and made anew from them."""

import contextlib
import hashlib
import json
import os
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from .checkpoint import Checkpoints, decode
from .directory import PIECES, RunDirectory, numbered
from .manifest import Entry, Manifest
from .sealed import DamagedError, read_lines, read_text
from .series import SnapshotWriter
from .snapshot import read_moment
from .tables import examine, relist
from .temporal import read_times


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
    """Make the lists of snapshots and pieces of tables anew from those; what became of snapshots that are not whole.

    Snapshots that are not what was written are set aside in ``abandoned/``; none gets a digest that it did not have.

    Raises:
        BusyError: a run writes into the directory.
        OSError: the disk refused; the snapshots are whole.
    """
    home = RunDirectory(directory)
    with home.locked():
        manifest = Manifest(home.path)
        with contextlib.suppress(DamagedError):
            manifest.read()
        gone = [f"{entry.name}: missing, no longer listed" for entry in manifest.entries if _is_gone(home, entry.name)]
        home.set_aside_misfits()
        damaged = manifest.rebuild()
        home.set_aside(home.path / name for name in damaged)
        writer = SnapshotWriter(home.path, resume=True)
        writer.derive()
        if read_lines(home.pieces).damaged:
            home.set_aside([home.pieces])
        relist(home)
    return [*gone, *(f"{name}: not what was written, moved to abandoned" for name in damaged)]


def _is_gone(home: RunDirectory, name: str) -> bool:
    return not (home.path / name).exists()


def check(directory: str | PathLike) -> Findings:
    """Read every file of a run and compare it with its digest; it changes nothing."""
    home, found = RunDirectory(directory), Findings()
    for part in (_check_snapshots, _check_descriptions, _check_checkpoints, _check_tables, _check_log):
        try:
            part(home, found)
        except (OSError, ValueError, KeyError) as error:
            found.problems.append(str(error))
    return found


def _check_snapshots(home: RunDirectory, found: Findings) -> None:
    manifest = Manifest(home.path)
    try:
        manifest.read()
    except (OSError, ValueError) as error:
        found.problems.append(f"manifest.jsonl: {error}; recover makes it anew")
    wrong = manifest.damaged()
    found.problems += [f"{name}: missing, or not what was written" for name in wrong]
    found.snapshots = len(manifest.entries) - len(wrong)
    for entry in manifest.entries:
        if entry.name in wrong:
            continue
        try:
            step, time, particles = read_moment(home.path / entry.name)
        except (OSError, ValueError, KeyError) as error:
            found.problems.append(f"{entry.name}: {error}")
            continue
        if (step, time, particles) != (entry.step, entry.time, entry.particles):
            found.problems.append(f"manifest.jsonl: step, time or particles of {entry.name} are not those of the file")
    listed = {entry.name for entry in manifest.entries}
    there = [f"snap/{path.name}" for path in numbered(home.snapshots, ".vtkhdf")]
    found.problems += [f"{name}: not in manifest.jsonl; recover lists it" for name in there if name not in listed]
    _check_lists(home, manifest.entries, found)


def _check_lists(home: RunDirectory, entries: list[Entry], found: Findings) -> None:
    """The lists for ParaView, which may lag behind while the run goes on."""
    series, index = home.path / "run.vtkhdf.series", home.path / "run.vtkhdf"
    known = [(entry.name, entry.time) for entry in entries]
    if series.exists():
        try:
            told = [(file["name"], file["time"]) for file in json.loads(read_text(series))["files"]]
            wrong = told != known[: len(told)]
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            wrong = True
        if wrong:
            found.problems.append("run.vtkhdf.series: not the snapshots of manifest.jsonl; recover makes it anew")
    if index.exists():
        try:
            times = read_times(index)
            wrong = times != [time for _, time in known[: len(times)]]
        except (OSError, ValueError, KeyError, TypeError):
            wrong = True
        if wrong:
            found.problems.append("run.vtkhdf: not the times of manifest.jsonl; recover makes it anew")


def _check_descriptions(home: RunDirectory, found: Findings) -> None:
    files: Any = {}
    for path in (home.description, home.environment, home.status):
        try:
            content = home.read(path)
        except (OSError, ValueError) as error:
            found.problems.append(f"{path.name}: {error}")
            continue
        if path == home.description:
            files = content.get("files", {})
        elif not content and home.description.exists():
            found.problems.append(f"{path.name}: missing")
    for name, digest in files.items() if isinstance(files, dict) else ():
        path = home.path / Path(name).name
        if not path.is_file() or hashlib.sha256(path.read_bytes()).hexdigest() != digest:
            found.problems.append(f"{name}: missing, or not what was written")


def _check_checkpoints(home: RunDirectory, found: Findings) -> None:
    for path in Checkpoints(home.checkpoints).paths():
        try:
            decode(path.read_bytes())
            found.checkpoints += 1
        except (DamagedError, OSError) as error:
            found.problems.append(f"{path.relative_to(home.path)}: {error}")


def _check_tables(home: RunDirectory, found: Findings) -> None:
    lines = read_lines(home.pieces, ("step", "name", "sha256"))
    found.problems += [f"{home.pieces.name}: line {number} is damaged" for number in lines.damaged]
    listed = {str(line["name"]) for line in lines.whole}
    for name in sorted({path.name for path in home.tables} | {name.partition("/")[0] for name in listed}):
        pieces, problems = examine(home.probes / name)
        found.problems += [problem.removeprefix(f"{home.path}{os.sep}") for problem in problems]
        found.tables += bool(pieces) and not problems
        there = [f"{name}/{path.name}" for path in numbered(home.probes / name, ".h5")]
        if home.description.exists():
            found.problems += [f"probes/{one}: not in {PIECES}; recover lists it" for one in there if one not in listed]


def _check_log(home: RunDirectory, found: Findings) -> None:
    lines = read_lines(home.log)
    found.problems += [f"{home.log.name}: line {number} is damaged" for number in lines.damaged]
    if lines.torn:
        found.problems.append("log.jsonl: ends in a damaged line, which a resume takes away")
