"""The command ``warp-eulsph``: parses the command line and hands over to the module of the subcommand."""

import argparse
from collections.abc import Sequence

from .commands import bench, check, export, info, plot, resume, run, schema, validate

# Each imports what it needs when it runs, so that asking for help is quick.
COMMANDS = (run, resume, info, check, plot, export, schema, validate, bench)


def main(argv: Sequence[str] | None = None) -> int:
    """Run a subcommand; its exit status."""
    parser = argparse.ArgumentParser(prog="warp-eulsph", description="Eulerian corrected SPH on NVIDIA Warp.")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in COMMANDS:
        command.add(commands)
    arguments = parser.parse_args(argv)
    return arguments.run_command(arguments)
