"""How figures of a case converge with resolution: a table over several runs.

    for n in 8 16 32; do warp-eulsph run examples/cases/spinning_plate.toml -s parameters.n=$n -o runs/plate_$n; done
    python examples/analysis/convergence.py runs/plate_8 runs/plate_16 runs/plate_32

Prints for each run its number of particles and a figure of its last frame, the difference from the run before, and the
order that three runs show: log of the ratio of differences over log of the ratio of spacings, which is meant for
spacings in a constant ratio.
"""

import argparse
import itertools
import math
from pathlib import Path

import numpy as np

from warp_eulsph.output import Run


def gyration(run: Run) -> float:
    """Radius of gyration of the particles about their centre [m], for bodies of equal masses."""
    x = run[-1].x.astype(float)
    return float(np.sqrt(np.square(x - x.mean(axis=0)).sum(axis=1).mean()))


#: Name -> figure of a run.
FIGURES = {
    "gyration": gyration,
    "stored": lambda run: float(run.log["stored"][-1]),
    "kinetic": lambda run: float(run.log["kinetic"][-1]),
    "total": lambda run: float(run.log["total"][-1]),
}


def orders(refinements: list[float], values: list[float]) -> list[float]:
    """The order shown by each three successive values; nan where their differences change sign.

    ``refinements`` are the ratios of successive spacings, larger than 1.
    """
    found = []
    for k in range(2, len(values)):
        before, after = values[k - 1] - values[k - 2], values[k] - values[k - 1]
        ratio = before / after if after else math.nan
        found.append(math.log(ratio) / math.log(refinements[k - 1]) if ratio > 0.0 else math.nan)
    return found


def main(argv: list[str] | None = None) -> list[float]:
    """Print the table; the orders."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="directories of runs, coarsest first")
    parser.add_argument("--figure", choices=FIGURES, default="gyration")
    args = parser.parse_args(argv)
    runs = [Run(path) for path in args.runs]
    dim = runs[0][0].x.shape[1]
    counts = [run[-1].N for run in runs]
    refinements = [(b / a) ** (1.0 / dim) for a, b in itertools.pairwise(counts)]
    values = [FIGURES[args.figure](run) for run in runs]
    shown = [math.nan, math.nan, *orders(refinements, values)]
    differences = [math.nan, *np.diff(values)]
    print(f"{'particles':>10} {args.figure:>14} {'difference':>12} {'order':>6}")
    for count, value, difference, order in zip(counts, values, differences, shown, strict=False):
        print(f"{count:10d} {value:14.8g} {difference:12.4e} {order:6.2f}")
    return shown[2:]


if __name__ == "__main__":
    main()
