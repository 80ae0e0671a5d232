"""``warp-eulsph bench``: time steps against the machine's own limits."""

import argparse


def add(commands: argparse._SubParsersAction) -> None:
    """Describe the subcommand."""
    parser = commands.add_parser(
        "bench",
        help="time steps against the machine's own limits",
        description="Time steps against the machine's own limits. Exit status: 0 done, 2 no such case.",
    )
    parser.add_argument("-k", default="", metavar="NAME", help="cases whose name contains this; all by default")
    parser.add_argument("--json", action="store_true", help="print a JSON list and nothing else")
    parser.add_argument("--start-up", action="store_true", help="time the start of a process too, cold and warm")
    parser.set_defaults(run_command=run)


def run(arguments: argparse.Namespace) -> int:
    """Time; the exit status."""
    from ..bench.command import bench

    return bench(arguments.k, as_json=arguments.json, start_up=arguments.start_up)
