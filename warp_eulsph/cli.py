"""The command ``warp-eulsph``: parses the command line and hands over to one function per subcommand."""

import argparse
from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """Run a subcommand; its exit status."""
    args = _parser().parse_args(argv)
    return args.run(args)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="warp-eulsph", description="Eulerian corrected SPH on NVIDIA Warp.")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    validate = commands.add_parser(
        "validate",
        help="run cases that have references and compare",
        description="Run cases that have references and compare. Exit status: 0 all figures lie in their bands, 1 some "
        "do not or a case failed, 2 unknown case.",
    )
    validate.add_argument("names", nargs="*", metavar="NAME", help="cases to run; all by default")
    validate.add_argument("--quick", action="store_true", help="coarse resolutions, minutes for all cases")
    validate.add_argument("--json", action="store_true", help="print a JSON list and nothing else")
    validate.add_argument("--list", action="store_true", help="print names, titles and sources of the cases, run none")
    validate.set_defaults(run=_validate)
    bench = commands.add_parser(
        "bench",
        help="time steps against the machine's own limits",
        description="Time steps against the machine's own limits. Exit status: 0 done, 2 no such case.",
    )
    bench.add_argument("-k", default="", metavar="NAME", help="cases whose name contains this; all by default")
    bench.add_argument("--json", action="store_true", help="print a JSON list and nothing else")
    bench.add_argument("--start-up", action="store_true", help="time the start of a process too, cold and warm")
    bench.set_defaults(run=_bench)
    return parser


# Each subcommand imports what it needs when it runs, so that asking for help is quick.


def _validate(args: argparse.Namespace) -> int:
    from .validation.command import validate

    return validate(args.names, quick=args.quick, as_json=args.json, listing=args.list)


def _bench(args: argparse.Namespace) -> int:
    from .bench.command import bench

    return bench(args.k, as_json=args.json, start_up=args.start_up)
