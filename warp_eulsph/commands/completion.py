"""``warp-eulsph completion``: what a shell needs to complete this command."""

import argparse
import sys

# What shtab calls files and folders, by shell
FILES = {"bash": "_shtab_compgen_files", "zsh": "_files", "tcsh": "f"}
FOLDERS = {"bash": "_shtab_compgen_dirs", "zsh": "_files -/", "tcsh": "d"}
KINDS = {"CASE": FILES, "FILE": FILES, "DIR": FOLDERS, "RUN": FOLDERS}

DESCRIPTION = """Print the completion of this command for a shell. For bash:
  warp-eulsph completion bash > ~/.local/share/bash-completion/completions/warp-eulsph
for zsh, in a folder of $fpath:
  warp-eulsph completion zsh > _warp-eulsph
Exit status: 0 printed, 2 shtab is missing."""


def add(commands: argparse._SubParsersAction) -> None:
    """Describe the subcommand."""
    parser = commands.add_parser(
        "completion",
        help="completion for bash, zsh and tcsh",
        description=DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("shell", choices=("bash", "zsh", "tcsh"))
    parser.set_defaults(run_command=run)


def run(arguments: argparse.Namespace) -> int:
    """Print; 0, or 2 without shtab."""
    try:
        import shtab
    except ModuleNotFoundError:
        print("warp-eulsph: completion needs shtab: pip install 'warp_eulsph[completion]'", file=sys.stderr)
        return 2
    _note_files(arguments.whole)
    print(shtab.complete(arguments.whole, arguments.shell))
    return 0


def _note_files(parser: argparse.ArgumentParser) -> None:
    """Say which arguments are files and folders, by what the help calls them."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                _note_files(below)
        elif action.metavar in KINDS:
            action.complete = KINDS[action.metavar]  # type: ignore[index,attr-defined]
