"""The run that is kept: steps, what is written on the way, and how it is taken up again."""

import hashlib
import logging
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..schedule import Schedule, next_target
from ..scheme.health import UnstableError
from ..settling import check_damped
from .atomic import replace_file
from .checkpoint import Checkpoint, Checkpoints, take
from .description import describe, differences, plain
from .directory import RunDirectory
from .environment import environment
from .fields import chosen_fields
from .log import append, look
from .probes import Measure
from .recorded import Recorded, solids
from .recording import Recording
from .sealed import DamagedError, read_lines, sealed_line
from .series import SnapshotWriter
from .snapshot import Frame
from .stopping import Stop
from .tables import Table
from .worker import Worker

log = logging.getLogger(__name__)

# Lines of the log and rows of tables wait in memory this long [s], and rows until there are so many.
_PATIENCE, _ROWS = 1.0, 10_000


class ChangedCaseError(ValueError):
    """A run is to be resumed with another simulation or recording than it was begun with."""


@dataclass(frozen=True)
class Outcome:
    """How a call of ``record`` ended.

    Attributes:
        time: [s]. step: steps taken.
        stopped: why it stopped before its end; None if it is done.
    """

    time: float
    step: int
    stopped: str | None = None


def record(
    simulation: Recorded,
    directory: str | PathLike,
    until: float,
    recording: Recording = Recording(),
    *,
    resume: bool = False,
    force: bool = False,
    replace: bool = False,
    case: Mapping[str, Any] | None = None,
    files: Mapping[str, str] = {},
    stop: Stop | None = None,
    watch: Callable[[Any], object] | None = None,
) -> Outcome:
    """Run to ``until`` [s], hit exactly, and keep in ``directory`` what ``recording`` asks for.

    A resumed run takes bit by bit the steps that it would have taken without the interruption, on the same machine with
    the same versions.

    Args:
        simulation: a ``Simulation`` or a ``Transport`` at its start, also to resume: it is put where the run was.
        directory: of the run, made if absent.
        until: end time [s].
        recording: what is kept.
        resume: go on from the last whole checkpoint; from the start if there is none yet.
        force: resume although the case has changed.
        replace: move a run that is there to ``abandoned/`` in the directory.
        case: how the simulation was built, for ``run.json``.
        files: what builds it again, text by name: ``case.toml`` or ``case.py``.
        stop: asked after each step whether to stop; None never stops.
        watch: called after each step, to show progress.

    Raises:
        BusyError: another run writes into the directory.
        FileExistsError: a run is there, and neither ``resume`` nor ``replace`` is set; or other files.
        ChangedCaseError: the case has changed since the checkpoint; it names the changes.
        DamagedError: no checkpoint is whole.
        BrokenError: the simulation was left in the middle of a step, and is not put where a checkpoint was.
        UnstableError: see ``Simulation.run`` and ``Transport.advance``; the last checkpoint and snapshot stay.
        OSError: the disk refused; all that was written before is whole, and the run can be resumed.
        ValueError: ``until`` is before the present time, a probe looks at what is not there, or a wrong region.
    """
    home = RunDirectory(directory)
    with home.locked():
        checkpoint = Checkpoints(home.checkpoints).newest() if resume else None
        if checkpoint is None:
            simulation.whole.check()  # before anything moves
        present = simulation.t if checkpoint is None else checkpoint.time
        if not (math.isfinite(until) and until >= present):
            raise ValueError(f"until must be finite and not before the present time {present} s, got {until}")
        recording.schedule.check(present, until)
        # What is wrong with fields, probes and region is told before files move
        chosen_fields(recording.fields, simulation)
        if recording.settle is not None:
            check_damped(simulation)
        measures = _measures(simulation, recording)
        particles = recording.particles(simulation)
        description = _description(simulation, recording, particles)
        if resume and checkpoint is None and home.holds_a_run:
            log.warning("%s has no checkpoint: the run starts anew, what is there moves to abandoned", home.path)
        digests = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in files.items()}
        content = {"until": until, "case": dict(case or {}), "files": digests, **description}
        if checkpoint is None:
            _begin(home, simulation, content, replace=replace or resume)
        else:
            _go_on(home, simulation, description, checkpoint, force=force)
            home.write(home.description, content)
        for name, text in files.items():
            home.keep(name, text)
        snapshots = SnapshotWriter(home.path, recording.fields, dtype=recording.dtype, particles=particles, resume=True)
        recorder = _Recorder(
            home, simulation, recording, measures, snapshots, description, resumed=checkpoint is not None
        )
        return recorder.run(until, stop, watch)


def _measures(simulation: Recorded, recording: Recording) -> list[Measure]:
    """What the probes measure."""
    if solids(simulation):
        return [probe.bind(simulation) for probe in recording.probes]
    if recording.probes:
        raise ValueError(f"probes look at solids, got {recording.probes[0].name!r} for a transported quantity")
    return []


def _begin(home: RunDirectory, simulation: Recorded, content: dict[str, Any], *, replace: bool) -> None:
    """Make room for a new run."""
    if home.holds_a_run and not replace:
        raise FileExistsError(f"{home.path} holds a run; resume it, choose another directory, or replace it")
    home.abandon()
    home.write(home.description, content)  # first, for it says whose all else is
    home.write(home.environment, {"sessions": [environment(simulation)]})


def _go_on(
    home: RunDirectory, simulation: Recorded, description: Mapping[str, Any], checkpoint: Checkpoint, *, force: bool
) -> None:
    """Put the simulation where the run was, and set aside what the run has of later steps."""
    _compare(checkpoint, simulation, description, force)
    simulation.restore(checkpoint.arrays, checkpoint.counters)
    home.set_aside_misfits()
    home.rewind(checkpoint.step)
    for listing in (home.log, home.pieces):
        _cut(home, listing, checkpoint.step)
    sessions = home.salvage(home.environment).get("sessions")
    before = sessions if isinstance(sessions, list) else []
    home.write(home.environment, {"sessions": [*before, environment(simulation)]})
    log.info("resumed at step %d, t = %.8g s", checkpoint.step, checkpoint.time)


def _cut(home: RunDirectory, listing: Path, step: int) -> None:
    """Drop the lines of steps after ``step``; a file with damaged lines is set aside too, as it was."""
    try:
        lines = read_lines(listing)
    except DamagedError as error:
        log.warning("%s is set aside: %s", listing, error)
        home.set_aside([listing])
        return
    if lines.damaged:
        log.warning("%s: lines %s are damaged and left out; the file as it was is set aside", listing, lines.damaged)
        home.set_aside([listing])
    if listing.exists() or lines.damaged:
        kept = (f"{sealed_line(line)}\n" for line in lines.whole if line["step"] <= step)
        replace_file(listing, "".join(kept).encode())


def _description(simulation: Recorded, recording: Recording, particles: np.ndarray | None) -> dict[str, Any]:
    kept = {**plain(recording), "particles": plain(particles)}
    del kept["checkpoint"]  # wall time, which changes no step
    return {"simulation": describe(simulation), "recording": kept}


def _compare(checkpoint: Checkpoint, simulation: Recorded, description: Mapping[str, Any], force: bool) -> None:
    """Raise, or with ``force`` warn, when the case has changed; warn when the machine has."""
    changes = differences(checkpoint.description, description)
    if changes and not force:
        listed = "\n  ".join(changes)
        raise ChangedCaseError(
            f"the case has changed since the checkpoint of step {checkpoint.step}:\n  {listed}\n"
            "undo the changes, run it in another directory, or go on all the same with --force (force=True)"
        )
    for change in changes:
        log.warning("resuming a changed case: %s", change)
    for change in differences(checkpoint.environment, environment(simulation)):
        log.warning("resuming elsewhere, so the bits may differ: %s", change)


def _is_due(schedule: Schedule, before: float, t: float, step: int) -> bool:
    """Whether something is due at time ``t`` [s] after ``step`` steps, the last look having been ``before``."""
    return schedule.due(t, step) or schedule.covered(before, t)


class _Recorder:
    """Writes what is due, in the background."""

    def __init__(
        self,
        home: RunDirectory,
        simulation: Recorded,
        recording: Recording,
        measures: Sequence[Measure],
        snapshots: SnapshotWriter,
        description: dict[str, Any],
        *,
        resumed: bool,
    ):
        self.home, self.simulation, self.recording, self.resumed = home, simulation, recording, resumed
        self.schedule = recording.schedule
        tables = [Table(home.probes / probe.name, probe.units_in(simulation)) for probe in recording.probes]
        self.probes = list(zip(recording.probes, measures, tables, strict=True))
        self.snapshots = snapshots
        self.snapshots.derive()
        self.checkpoints = Checkpoints(home.checkpoints)
        self.description, self.environment = description, environment(simulation)
        self.lines: list[dict[str, Any]] = []
        self.coming: Frame | None = None  # on its way from the device
        self.looked = simulation.t  # when it was last looked what is due; checkpoints are taken after a look
        self.worker = Worker()
        self.flushed = self.checked = time.monotonic()

    @property
    def last(self) -> Any:
        """Path of the last snapshot, for the message of a run that fails."""
        self._forward()
        self.worker.drain()
        return self.snapshots.last

    def run(self, until: float, stop: Stop | None, watch: Callable[[Any], object] | None) -> Outcome:
        simulation, before = self.simulation, self.simulation.output
        simulation.output = self
        self._note_status("running", until)
        state, reason = "failed", None
        try:
            if not self.resumed:
                self.keep(everything=True)
                self.checkpoint()
            settled = False
            while simulation.t < until and reason is None and not settled:
                self._advance(until)
                self.worker.check()
                settled = self.recording.settled(simulation)
                self.keep(everything=settled or simulation.t >= until)
                reason = stop.reason() if stop is not None else None
                if watch is not None:
                    watch(simulation)
            self.checkpoint()
            self.worker.drain()
            self.worker.check()
            self.snapshots.finish()
            state = "done" if reason is None or settled or simulation.t >= until else "stopped"
            if settled:
                log.info("in equilibrium: residual at most %g at t = %.6g s", self.recording.settle, simulation.t)
        except UnstableError as error:
            state, reason = "unstable", str(error)
            self._flush_lines()  # what came before the failure tells most about it
            self._flush_tables(1)
            raise
        except BaseException as error:
            reason = f"{type(error).__name__}: {error}"
            raise
        finally:
            self.worker.close()
            simulation.output = before
            self._note_status(state, until, reason)
        return Outcome(simulation.t, simulation.steps, reason if state == "stopped" else None)

    def _advance(self, until: float) -> None:
        simulation, schedule = self.simulation, self.schedule
        target = next_target(schedule, simulation.t, until)
        simulation.advance(target, schedule.steps_left(simulation.steps), schedule.next_look(simulation.t))

    def keep(self, everything: bool) -> None:
        """Queue what is due now, or everything."""
        simulation, recording = self.simulation, self.recording
        t, step, now = simulation.t, simulation.steps, time.monotonic()
        before, self.looked = self.looked, t
        self._forward()
        if everything or _is_due(recording.snapshots, before, t, step):
            self.coming = self.snapshots.collect(simulation)
            if not self.coming.on_its_way:
                self._forward()
        if everything or _is_due(recording.log, before, t, step):
            self.lines.append(look(simulation))
        for probe, measure, table in self.probes:
            if everything or _is_due(probe.schedule, before, t, step):
                table.add(step, t, measure())
        if now - self.checked > recording.checkpoint:
            self.checkpoint()
        elif now - self.flushed > _PATIENCE:
            self._flush_lines()
            self._flush_tables(_ROWS)

    def checkpoint(self) -> None:
        """Queue all that waits, then a checkpoint: what it follows is on disk before it."""
        self._forward()
        self._flush_lines()
        self._flush_tables(1)
        taken = take(self.simulation, self.description, self.environment)
        self.worker.submit(lambda: self.checkpoints.write(taken))
        self.checked = time.monotonic()

    def _forward(self) -> None:
        """Queue the frame that was on its way while steps were taken."""
        frame, self.coming = self.coming, None
        if frame is not None:
            frame.wait()
            self.worker.submit(lambda: self.snapshots.commit(frame))

    def _flush_lines(self) -> None:
        lines, self.lines, self.flushed = self.lines, [], time.monotonic()
        if lines:
            self.worker.submit(lambda: append(self.home.log, lines))

    def _flush_tables(self, least: int) -> None:
        for _, _, table in self.probes:
            if len(table) >= least:
                self._submit_rows(table)

    def _submit_rows(self, table: Table) -> None:
        columns = table.take()
        self.worker.submit(lambda: table.write(columns))

    def _note_status(self, state: str, until: float, reason: str | None = None) -> None:
        simulation = self.simulation
        content: dict[str, Any] = {"state": state, "reason": reason, "until": until}
        content |= {"step": simulation.steps, "t": simulation.t}
        if solids(simulation) and any(simulation.runs.failures):
            content["ended"] = [str(error) for error in simulation.runs.failures if error is not None]
        try:
            self.home.write(self.home.status, content)
        except OSError as error:  # the run's own error matters more
            log.warning("cannot write %s: %s", self.home.status, error)
