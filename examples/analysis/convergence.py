"""How a figure of a case converges with resolution: a table over several runs.

    python examples/analysis/convergence.py examples/cases/spinning_plate.toml --levels 8,16,32

Runs the case with ``parameters.n`` at each level and prints the figure at the end, its difference from the level
before, and the order that three levels show: log of the ratio of differences over log of the ratio of levels, which is
meant for levels in a constant ratio.
"""

import argparse
import math

import numpy as np
import warp as wp

from warp_eulsph.cases import read_case
from warp_eulsph.simulation import Simulation


def gyration(simulation: Simulation) -> float:
    """Radius of gyration about the centre of mass [m]."""
    mass, x = simulation.particles.mass.numpy(), simulation.x
    return float(np.sqrt(np.average(np.square(x - np.average(x, axis=0, weights=mass)).sum(axis=1), weights=mass)))


#: Name -> figure of a finished run.
FIGURES = {
    "stored": lambda simulation: simulation.energy()["stored"],
    "kinetic": lambda simulation: simulation.energy()["kinetic"],
    "total": lambda simulation: simulation.energy()["total"],
    "largest_J": lambda simulation: simulation.extrema()["largest J"],
    "gyration": gyration,
}


def orders(levels: list[int], values: list[float]) -> list[float]:
    """The order shown by each three successive levels; nan where the differences change their sign."""
    found = []
    for k in range(2, len(values)):
        before, after = values[k - 1] - values[k - 2], values[k] - values[k - 1]
        ratio = before / after if after else math.nan
        found.append(math.log(ratio) / math.log(levels[k] / levels[k - 1]) if ratio > 0.0 else math.nan)
    return found


def main(argv: list[str] | None = None) -> dict[int, float]:
    """Run all levels and print the table; the figure by level."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("case", help="case file with a parameter n")
    parser.add_argument("-s", "--set", action="append", default=[], metavar="KEY=VALUE", help="change an entry")
    parser.add_argument("--levels", default="8,16,32", help="values of parameters.n")
    parser.add_argument("--figure", choices=FIGURES, default="gyration")
    args = parser.parse_args(argv)
    wp.config.log_level = wp.LOG_WARNING
    levels = [int(part) for part in args.levels.split(",")]
    values: list[float] = []
    print(f"{'n':>6} {'particles':>10} {args.figure:>14} {'difference':>12} {'order':>6}")
    for n in levels:
        case = read_case(args.case, [*args.set, f"parameters.n={n}"])
        simulation: Simulation = case.build()
        simulation.run(case.until)
        values.append(FIGURES[args.figure](simulation))
        difference = f"{values[-1] - values[-2]:12.4e}" if len(values) > 1 else ""
        order = f"{orders(levels, values)[-1]:6.2f}" if len(values) > 2 else ""
        print(f"{n:6d} {len(simulation.x):10d} {values[-1]:14.8g} {difference:>12} {order:>6}")
    return dict(zip(levels, values, strict=True))


if __name__ == "__main__":
    main()
