"""Options that ``run`` and ``resume`` share."""

import argparse
import math
import re

STATUS = (
    "Exit status: 0 done, 1 the disk refused, 2 wrong input, 3 unstable or not finite, 75 stopped by a signal, the "
    "wall limit or a file named stop in the directory; resume goes on from there."
)
TRUST = "run what the case names: modules with materials or conditions of your own; to resume also its case.py"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of both subcommands."""
    parser.add_argument("--device", help="Warp device such as cuda:0; Warp's default otherwise")
    parser.add_argument("--trust", action="store_true", help=TRUST)
    parser.add_argument("--until", type=float, metavar="TIME", help="end time [s] instead of the case's")
    parser.add_argument(
        "--max-wall",
        type=duration,
        default=math.inf,
        metavar="TIME",
        help="stop after this wall time, such as 90s, 30m or 3h; the run can be resumed",
    )


def duration(text: str) -> float:
    """Seconds from ``90``, ``90s``, ``30m``, ``3h``, ``2d``."""
    match = re.fullmatch(r"(\d+(?:\.\d*)?)([smhd]?)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"must be a number and s, m, h or d, got {text!r}")
    return float(match[1]) * {"": 1.0, "s": 1.0, "m": 60.0, "h": 3600.0, "d": 86400.0}[match[2]]
