"""``warp-eulsph schema``: the schema of case files, for editors."""

import argparse
import json


def add(commands: argparse._SubParsersAction) -> None:
    """Describe the subcommand."""
    parser = commands.add_parser(
        "schema",
        help="print the JSON Schema of case files, for editors",
        description="Print the JSON Schema of case files. An editor that knows TOML schemas then completes and checks: "
        "write it to case.schema.json and begin case files with '#:schema ./case.schema.json'.",
    )
    parser.set_defaults(run_command=run)


def run(arguments: argparse.Namespace) -> int:
    """Print; 0."""
    from ..cases import json_schema

    print(json.dumps(json_schema(), indent=1, ensure_ascii=False))
    return 0
