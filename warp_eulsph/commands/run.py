"""``warp-eulsph run``: a case from its start."""

import argparse
from pathlib import Path

from .options import STATUS, add_options

SETTING = "change a setting, such as n=20, reference=Never or output.every=1e-3; may be given often"


def add(commands: argparse._SubParsersAction) -> None:
    """Describe the subcommand."""
    parser = commands.add_parser("run", help="run a case into a directory", description=f"Run a case. {STATUS}")
    parser.add_argument("case", metavar="CASE", help="case.toml, case.py, or example:NAME (see examples)")
    parser.add_argument("-s", "--set", action="append", default=[], metavar="KEY=VALUE", help=SETTING)
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help="directory of the run; default runs/NAME")
    parser.add_argument("--replace", action="store_true", help="move a run that is there to DIR/abandoned first")
    add_options(parser)
    parser.set_defaults(run_command=run)


def run(arguments: argparse.Namespace) -> int:
    """Run; the exit status."""
    from ..output import RunDirectory
    from .loading import load_case
    from .session import BAD_INPUT, carry_out, complain, start_logging

    start_logging()
    try:
        case = load_case(arguments.case, arguments.set, arguments.device, arguments.trust)
    except (ValueError, OSError) as error:
        return complain(error, BAD_INPUT)
    directory = arguments.output or Path("runs") / case.name
    try:
        RunDirectory(directory).check_own()
    except OSError as error:
        return complain(error, BAD_INPUT)
    if RunDirectory(directory).holds_a_run and not arguments.replace:  # before anything is built
        options = "choose another directory with -o, or begin anew with --replace"
        return complain(f"{directory} holds a run; go on with warp-eulsph resume {directory}, {options}", BAD_INPUT)
    until = case.until if arguments.until is None else arguments.until
    return carry_out(case, directory, until, arguments.max_wall, resume=False, force=False, replace=arguments.replace)
