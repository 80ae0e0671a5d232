"""What ``run`` and ``resume`` share: a case recorded into a directory, and what became of it as an exit status."""

import logging
import sys
from pathlib import Path

from ..output import BusyError, Recording, RunDirectory, Stop, record
from ..scheme.health import UnstableError
from .loading import LoadedCase
from .progress import Progress

log = logging.getLogger(__name__)

DONE, FAILED, BAD_INPUT, UNSTABLE, STOPPED = 0, 1, 2, 3, 75


def start_logging() -> None:
    """Messages of the package to standard error; of Warp only warnings, and the line that kernels are compiled."""
    logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stderr)


def carry_out(
    case: LoadedCase, directory: Path, until: float, wall: float, *, resume: bool, force: bool, replace: bool
) -> int:
    """Build, record, show progress; the exit status."""
    from tqdm.contrib.logging import logging_redirect_tqdm

    try:
        simulation = case.build()
        recording: Recording = case.recording(simulation)
        log.info("%s: %d particles on %s", case.name, len(simulation.particles.mass), simulation.device)
        home = RunDirectory(directory)
        before = _steps_before(home) if resume else None
        stop = Stop(wall=wall, file=home.stop)
        with stop, Progress(until) as progress, logging_redirect_tqdm():
            outcome = record(
                simulation,
                directory,
                until,
                recording,
                resume=resume,
                force=force,
                replace=replace,
                case=case.origin,
                files=case.files,
                stop=stop,
                watch=progress,
            )
    except UnstableError as error:
        return complain(error, UNSTABLE)
    except (FileExistsError, FileNotFoundError, ModuleNotFoundError, ValueError, BusyError, MemoryError) as error:
        return complain(error or "out of memory; use fewer particles", BAD_INPUT)
    except OSError as error:
        return complain(f"{error}; what was written before is whole, warp-eulsph resume {directory} goes on", FAILED)
    if outcome.stopped is not None:
        log.info(
            "stopped by %s at step %d, t = %.8g s; warp-eulsph resume %s goes on",
            outcome.stopped,
            outcome.step,
            outcome.time,
            directory,
        )
        return STOPPED
    if home.stop.is_file():
        home.stop.unlink(missing_ok=True)  # asked for too late
    log.info("done: step %d, t = %.8g s, in %s", outcome.step, outcome.time, directory)
    if outcome.step == before:
        log.info("there was nothing left to do; --until takes the run on to a later time")
    return DONE


def _steps_before(home: RunDirectory) -> int | None:
    """Steps that the run took before; None where status.json is damaged, which matters to nothing else."""
    try:
        return home.read(home.status).get("step")
    except (OSError, ValueError):
        return None


def complain(error: object, status: int) -> int:
    """Say what is wrong on standard error; the status."""
    print(f"warp-eulsph: {error}", file=sys.stderr)
    return status
