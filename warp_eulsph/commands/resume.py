"""``warp-eulsph resume``: a run that was stopped or killed, from its last checkpoint."""

import argparse
import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .options import STATUS, add_options

if TYPE_CHECKING:
    from ..output import RunDirectory

log = logging.getLogger(__name__)


def add(commands: argparse._SubParsersAction) -> None:
    """Describe the subcommand."""
    parser = commands.add_parser(
        "resume",
        help="go on with a run that was stopped or killed",
        description="Go on with a run from its last whole checkpoint, bit for bit as if it had not been stopped; a "
        f"finished one goes on to a later --until. {STATUS}",
    )
    parser.add_argument("directory", metavar="DIR", type=Path, help="directory of the run")
    parser.add_argument("--force", action="store_true", help="go on although the case has changed")
    add_options(parser)
    parser.set_defaults(run_command=run)


def run(arguments: argparse.Namespace) -> int:
    """Resume; the exit status."""
    from ..output import RunDirectory
    from .loading import load_case
    from .session import BAD_INPUT, carry_out, complain, start_logging

    start_logging()
    home = RunDirectory(arguments.directory)
    try:
        kept = home.read(home.description) if not home.path.is_file() else None
        if not kept:
            raise ValueError(home.without_a_run)
        origin = kept.get("case")
        if not origin:
            raise ValueError(
                f"the run in {home.path} was made by a program, not by this command; resume it there with "
                "record(simulation, directory, until, recording, resume=True)"
            )
        source, overrides, named = _source(home, origin)
        if source.endswith(".py") and not arguments.trust:
            raise ValueError(
                f"to resume {home.path} means to run the program {source}, which its run.json names; look at it, and "
                "say --trust if it is yours"
            )
        device = named if arguments.device is None else arguments.device
        case = load_case(source, overrides, device, arguments.trust)
        until = kept.get("until") if arguments.until is None else arguments.until
        if isinstance(until, bool) or not isinstance(until, int | float):
            raise ValueError(f"run.json must have the end time as a number, got {until!r}; give it as --until")
    except (ValueError, OSError) as error:
        return complain(error, BAD_INPUT)
    return carry_out(case, home.path, until, arguments.max_wall, resume=True, force=arguments.force, replace=False)


def _source(home: "RunDirectory", origin: Any) -> tuple[str, list[str], str | None]:
    """The case, its settings and its device: the case from where it came, or the copy that the run kept of it.

    Raises:
        ValueError: run.json does not say.
    """
    from .loading import EXAMPLE

    source = origin.get("source") if isinstance(origin, dict) else None
    overrides, device = (origin.get("overrides", []), origin.get("device")) if source else ([], None)
    of_text = isinstance(overrides, list) and all(isinstance(override, str) for override in overrides)
    if not isinstance(source, str) or not of_text or not isinstance(device, str | None):
        raise ValueError(f"{home.description} must say where the case came from, got {origin!r}")
    if source.startswith(EXAMPLE) or Path(source).is_file():
        return source, overrides, device
    copy = home.path / f"case{Path(source).suffix}"
    log.warning("%s is gone; using %s", source, copy)
    return str(copy), [] if copy.suffix == ".toml" else overrides, device  # which has them in it
