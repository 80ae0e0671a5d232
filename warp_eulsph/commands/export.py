"""``warp-eulsph export``: a run as one file for other programs."""

import argparse

from .frames import chosen, complain


def add(commands: argparse._SubParsersAction) -> None:
    """Describe the subcommand."""
    parser = commands.add_parser(
        "export",
        help="write a run as one VTKHDF, XDMF, VTU, PVD, CSV or NPZ file",
        description="Write a run as one file, in the format of its ending: .vtkhdf holds all times, .xdmf refers to "
        "the snapshots, .vtu holds one frame, .pvd a .vtu for each, .csv has a row per particle and time, .npz numpy "
        "arrays. Exit status: 0 written, 2 bad input.",
    )
    parser.add_argument("directory", metavar="RUN", help="directory of a run")
    parser.add_argument("output", metavar="FILE", help="file to write: .vtkhdf, .xdmf, .vtu, .pvd, .csv or .npz")
    parser.add_argument("-f", "--fields", metavar="NAMES", help="fields with commas between them; default all")
    parser.add_argument("--frames", default=":", metavar="WHICH", help="such as -1, 0,5,10 or ::2; default all")
    parser.set_defaults(run_command=run)


def run(arguments: argparse.Namespace) -> int:
    """Export; 0, or 2 when it cannot be."""
    from ..output import Run
    from ..output.export import export

    try:
        found = Run(arguments.directory)
        frames = [found[k] for k in chosen(len(found), arguments.frames)]
        fields = None if arguments.fields is None else [name.strip() for name in arguments.fields.split(",")]
        path = export(frames, arguments.output, fields)
    except (ValueError, OSError, KeyError, ModuleNotFoundError) as error:
        return complain(error)
    print(path)
    return 0
