"""The command ``warp-eulsph``: parses the command line and hands over to the module of the subcommand."""

import argparse
from collections.abc import Sequence

from .commands import (
    bench,
    check,
    completion,
    curve,
    doctor,
    examples,
    export,
    info,
    plot,
    resume,
    run,
    schema,
    validate,
)

# Each imports what it needs when it runs, so that asking for help is quick.
COMMANDS = (run, resume, info, check, plot, curve, export, examples, schema, validate, bench, doctor, completion)


def parser() -> argparse.ArgumentParser:
    """Of the command with all its subcommands."""
    whole = argparse.ArgumentParser(
        prog="warp-eulsph",
        description="Eulerian corrected SPH on NVIDIA Warp. Each command has a --help of its own.",
        epilog="To begin with: warp-eulsph examples; warp-eulsph run example:punch; warp-eulsph plot runs/punch.",
    )
    whole.add_argument("--version", action="store_true", help="print versions and end")
    commands = whole.add_subparsers(title="commands", metavar="COMMAND")
    for command in COMMANDS:
        command.add(commands)
    whole.set_defaults(whole=whole)  # of which completion tells a shell
    return whole


def main(argv: Sequence[str] | None = None) -> int:
    """Run a subcommand; its exit status."""
    whole = parser()
    arguments = whole.parse_args(argv)
    if arguments.version:
        from importlib import metadata

        print(" ".join(f"{name} {metadata.version(name)}" for name in ("warp-eulsph", "warp-lang")))
        return 0
    if not hasattr(arguments, "run_command"):
        whole.print_help()
        return 2
    return arguments.run_command(arguments)
