"""``warp-eulsph resume``: a run that was stopped or killed, from its last checkpoint."""

import argparse
import logging
from pathlib import Path
from typing import Any

from .options import STATUS, add_options

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
        kept = home.read(home.description)
        if not kept:
            raise ValueError(f"no run in {home.path}: run.json is not there")
        origin = kept["case"]
        if not origin:
            raise ValueError(
                f"the run in {home.path} was made by a program, not by this command; resume it there with "
                "record(simulation, directory, until, recording, resume=True)"
            )
        device = origin["device"] if arguments.device is None else arguments.device
        case = load_case(*_source(home.path, origin), device)
    except (ValueError, OSError) as error:
        return complain(error, BAD_INPUT)
    until = kept["until"] if arguments.until is None else arguments.until
    return carry_out(case, home.path, until, arguments.max_wall, resume=True, force=arguments.force, replace=False)


def _source(directory: Path, origin: dict[str, Any]) -> tuple[str, list[str]]:
    """The case and its settings: where they came from, or what the run kept of them when that is gone."""
    from .loading import EXAMPLE

    source = origin["source"]
    if source.startswith(EXAMPLE) or Path(source).exists():
        return source, origin["overrides"]
    copy = directory / f"case{Path(source).suffix}"
    log.warning("%s is gone; using %s", source, copy)
    return str(copy), [] if copy.suffix == ".toml" else origin["overrides"]  # which has them in it
