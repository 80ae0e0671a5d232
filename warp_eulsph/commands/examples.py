"""``warp-eulsph examples``: the cases that come with the package."""

import argparse


def add(commands: argparse._SubParsersAction) -> None:
    """Describe the subcommand."""
    parser = commands.add_parser(
        "examples",
        help="list the cases that come with the package, or print one to start from",
        description="List the cases that come with the package, or print one, such as: warp-eulsph examples punch > "
        "mine.toml. Exit status: 0 printed, 2 no such example.",
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="print the case file of this example")
    parser.set_defaults(run_command=run)


def run(arguments: argparse.Namespace) -> int:
    """Print; 0, or 2 where no such example is."""
    from ..cases import read_case
    from .frames import complain
    from .loading import EXAMPLE, example_path, examples

    if arguments.name is None:
        for name, path in examples().items():
            print(f"{name:18} {read_case(path).title}")
        return 0
    try:
        print(example_path(arguments.name.removeprefix(EXAMPLE)).read_text(encoding="utf-8"), end="")
    except ValueError as error:
        return complain(error)
    return 0
