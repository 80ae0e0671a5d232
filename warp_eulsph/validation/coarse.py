"""What makes coarse bodies right: the twisting and the bending column with and without tilt and sharpening.

    python -m warp_eulsph.validation.coarse [--quick] [--output DIR]

Error of the largest rotation (twist) and of the first swing (bend) against the spectral-element solutions, and
processor time of the twist on one thread, with M4 and M5 as they are, tilted (M17), sharpened (M23) and both, the
default. Draws error over resolution and over time (``coarse.png``). What they say is in docs/coarse.md.
"""

import argparse
import time
from pathlib import Path

import warp as wp

from .. import execution
from ..scheme.policy import Never
from ..scheme.verlet import Verlet
from .cases import bending_column, twisting_column
from .history import History, series

FORMS = {
    "plain M4, M5": Verlet(tilt=None, sharpening=None),
    "tilted (M17)": Verlet(sharpening=None),
    "sharpened (M23)": Verlet(tilt=None),
    "both, the default": Verlet(),
}
Row = tuple[float, float, float]


def twist(n: int, scheme: Verlet) -> tuple[float, float]:
    """Relative error of the largest rotation, n particles across, and processor seconds without compiling."""
    twisting_column.build(n, Never(), scheme=scheme).step(2)
    simulation = twisting_column.build(n, Never(), scheme=scheme)
    start = time.process_time()
    found = twisting_column.measure(simulation)["rotation"].max()
    seconds = time.process_time() - start
    return found / twisting_column.reference_history()["rotation"].max() - 1.0, seconds


def bend(n: int, scheme: Verlet) -> float:
    """Relative error of the first swing's value, n particles across."""

    def first(history: History, name: str) -> float:
        return bending_column.extrema(history["t"], history[name])[0][1]

    until = bending_column.FIRST_SWING
    history = bending_column.measure(bending_column.build(3, n, Never(), scheme=scheme), until)
    return first(history, "tip") / first(series(bending_column.SERIES), "utx") - 1.0


def draw(found: dict[str, dict[int, Row]], path: Path) -> None:
    """Error of the twist over particles across, and over processor time."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), sharey=True, layout="constrained")
    for name, rows in found.items():
        errors = [100.0 * abs(row[0]) for row in rows.values()]
        left.loglog(list(rows), errors, "o-", label=name)
        right.loglog([row[1] for row in rows.values()], errors, "o-")
    across = list(next(iter(found.values())))
    left.set_xticks(across, [str(n) for n in across])
    left.minorticks_off()
    left.set(xlabel="particles across", ylabel="error of the largest rotation [%]", title="twisting column")
    right.set(xlabel="processor time [s]", title="the same, by what it costs")
    left.legend()
    for axes in (left, right):
        axes.grid(alpha=0.3)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(argv: list[str] | None = None) -> None:
    """Print the table and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="4 and 6 across only: half a minute")
    parser.add_argument("--output", type=Path, default=Path("runs/coarse"))
    args = parser.parse_args(argv)
    wp.config.log_level = wp.LOG_WARNING
    execution.set_threads(1)
    levels = (4, 6) if args.quick else (4, 6, 8, 12)
    found: dict[str, dict[int, Row]] = {}
    print("| form | across | twist [%] | bend [%] | seconds of the twist |")
    print("|---|---|---|---|---|")
    for name, scheme in FORMS.items():
        found[name] = {}
        for n in levels:
            row = (*twist(n, scheme), bend(n, scheme) if n < 12 else float("nan"))
            found[name][n] = row
            bent = f"{100.0 * row[2]:.1f}" if n < 12 else ""
            print(f"| {name} | {n} | {100.0 * row[0]:.1f} | {bent} | {row[1]:.2f} |", flush=True)
    draw(found, args.output / "coarse.png")
    print(f"picture {args.output / 'coarse.png'}")


if __name__ == "__main__":
    main()
