"""``warp-eulsph curve``: figures of a run over time, or over each other, as a picture or a table."""

import argparse
from pathlib import Path

from .frames import complain


def add(commands: argparse._SubParsersAction) -> None:
    """Describe the subcommand."""
    parser = commands.add_parser(
        "curve",
        help="draw energies and probes over time, or over each other: PNG or CSV",
        description="Draw figures of a run's log and probes, such as log.kinetic, grip.force.x, or tip.u.y, how far "
        "the point of a PointProbe has moved. Without a name list those that there are. "
        "Exit status: 0 done, 2 wrong input or a library that is missing.",
    )
    parser.add_argument("directory", metavar="RUN", help="directory of a run")
    parser.add_argument("names", metavar="NAME", nargs="*", help="what is drawn upwards")
    parser.add_argument("--over", metavar="NAME", help="what is drawn to the right; default time")
    parser.add_argument("-o", "--output", metavar="FILE", default="curve.png", help=".png or .csv; default %(default)s")
    parser.set_defaults(run_command=run)


def run(arguments: argparse.Namespace) -> int:
    """Draw, write or list; 0, or 2 when it cannot be."""
    import numpy as np

    from ..output import Run
    from ..output.history import history, names

    try:
        found, path = Run(arguments.directory), Path(arguments.output)
        if not arguments.names:
            print("\n".join(names(found)))
            return 0
        curves = [history(found, name) for name in arguments.names]
        over = None if arguments.over is None else history(found, arguments.over)
        # Tables of their own times: those of the first name are taken, what lies between two rows is on a line
        t = curves[0].t
        right = ("t [s]", t) if over is None else (over.label, np.interp(t, over.t, over.values))
        columns = [right, *[(curve.label, np.interp(t, curve.t, curve.values)) for curve in curves]]
        if path.suffix == ".csv":
            header = ",".join(label for label, _ in columns)
            np.savetxt(
                path, np.stack([values for _, values in columns], axis=1), "%.17g", ",", header=header, comments=""
            )
        elif path.suffix == ".png":
            from ..pictures.plane import draw_curves

            draw_curves(columns, path, found.title)
        else:
            raise ValueError(f"the ending must be .png or .csv, got {arguments.output!r}")
    except (ValueError, OSError, ModuleNotFoundError) as error:
        return complain(error)
    print(path)
    return 0
