"""``warp-eulsph validate``: cases that have references."""

import argparse


def add(commands: argparse._SubParsersAction) -> None:
    """Describe the subcommand."""
    parser = commands.add_parser(
        "validate",
        help="run cases that have references and compare",
        description="Run cases that have references and compare. Exit status: 0 all figures lie in their bands, 1 some "
        "do not or a case failed, 2 unknown case.",
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="cases to run; all by default")
    parser.add_argument("--quick", action="store_true", help="coarse resolutions, minutes for all cases")
    parser.add_argument("--json", action="store_true", help="print a JSON list and nothing else")
    parser.add_argument("--list", action="store_true", help="print names, titles and sources of the cases, run none")
    parser.set_defaults(run_command=run)


def run(arguments: argparse.Namespace) -> int:
    """Validate; the exit status."""
    from ..validation.command import validate

    return validate(arguments.names, quick=arguments.quick, as_json=arguments.json, listing=arguments.list)
