"""A case run and shown as an animated picture.

    python examples/analysis/animation.py examples/cases/twisting_column.toml -s parameters.n=6 --field von_mises

Runs the case with snapshots, then draws them all as an animated GIF (``animation.gif``) in the run's directory. For a
run that is there already, ``warp-eulsph plot RUN -o film.gif`` does the same.
"""

import argparse
from pathlib import Path

import warp as wp

from warp_eulsph.cases import read_case
from warp_eulsph.output import Run
from warp_eulsph.pictures import Picture, film


def main(argv: list[str] | None = None) -> Path:
    """Run and draw; the path of the film."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("case", help="case file")
    parser.add_argument("-s", "--set", action="append", default=[], metavar="KEY=VALUE", help="change an entry")
    parser.add_argument("--field", default="velocity", help="what colours the particles")
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--output", type=Path, default=Path("runs/animation"))
    args = parser.parse_args(argv)
    wp.config.log_level = wp.LOG_WARNING
    case = read_case(args.case, args.set)
    case.build().run(case.until, every=case.until / args.frames, output=args.output)
    path = film(Run(args.output), args.output / "animation.gif", Picture(field=args.field, size=(700, 500)))
    print(path)
    return path


if __name__ == "__main__":
    main()
