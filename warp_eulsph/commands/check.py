"""``warp-eulsph check``: every file of a run against its digest."""

import argparse
import sys


def add(commands: argparse._SubParsersAction) -> None:
    """Describe the subcommand."""
    parser = commands.add_parser(
        "check",
        help="compare every file of a run with its digest",
        description="Compare every file of a run with its digest. Exit status: 0 all is well, 2 damage or no run.",
    )
    parser.add_argument("directory", metavar="DIR", help="directory of the run")
    parser.add_argument(
        "--recover",
        action="store_true",
        help="first make the manifest and the lists for ParaView anew from the snapshots that open",
    )
    parser.set_defaults(run_command=run)


def run(arguments: argparse.Namespace) -> int:
    """Check; 0, or 2 where something is wrong."""
    from ..output import BusyError, RunDirectory, check, recover

    try:
        if not (home := RunDirectory(arguments.directory)).holds_a_run:
            raise FileNotFoundError(home.without_a_run)
        if arguments.recover:
            for line in recover(arguments.directory):
                print(line)
        found = check(arguments.directory)
    except (BusyError, ValueError, OSError) as error:
        print(f"warp-eulsph: {error}", file=sys.stderr)
        return 2
    for problem in found.problems:
        print(problem)
    print(f"whole: {found.snapshots} snapshots, {found.checkpoints} checkpoints, {found.tables} tables of probes")
    return 2 if found.problems else 0
