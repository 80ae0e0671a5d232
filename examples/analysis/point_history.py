"""The path of a material point over time, beside a reference.

    python examples/analysis/point_history.py examples/cases/spinning_plate.toml --point 0.5,0.5 \\
        --column Rcorner --reference warp_eulsph/validation/reference/spin2d105_2.csv

Runs the case, follows the point, and compares its distance from the origin (or with ``--axis`` one displacement) with a
column of a CSV file whose column ``t`` is the time [s]. Prints rms error over the reference's range, and draws both
(``point_history.png``).
"""

import argparse
from pathlib import Path

import numpy as np
import warp as wp

from warp_eulsph.cases import read_case
from warp_eulsph.validation.history import record
from warp_eulsph.validation.solids import MaterialPoint


def draw(t: np.ndarray, found: np.ndarray, expected: np.ndarray, label: str, path: Path) -> None:
    """Both histories."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 5))
    axes.plot(t, found, label="particles")
    axes.plot(t, expected, "k--", lw=1, label="reference")
    axes.set(xlabel="time [s]", ylabel=label)
    axes.legend()
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(argv: list[str] | None = None) -> float:
    """Run, print, draw; the rms error over the reference's range."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("case", help="case file")
    parser.add_argument("-s", "--set", action="append", default=[], metavar="KEY=VALUE", help="change an entry")
    parser.add_argument("--point", required=True, help="initial position [m], such as 0.5,0.5")
    parser.add_argument("--axis", choices="xyz", help="displacement along an axis instead of the radius")
    parser.add_argument("--reference", required=True, type=Path, help="CSV file")
    parser.add_argument("--column", required=True, help="column of the CSV file [m]")
    parser.add_argument("--output", type=Path, default=Path("runs/point_history"))
    args = parser.parse_args(argv)
    wp.config.log_level = wp.LOG_WARNING
    case = read_case(args.case, args.set)
    simulation = case.build()
    X = np.array([float(part) for part in args.point.split(",")])
    point = MaterialPoint(simulation, X)
    label = f"displacement along {args.axis} [m]" if args.axis else "distance from the origin [m]"

    def observe() -> dict[str, float]:
        x = point.x
        return {"value": float((x - X)["xyz".index(args.axis)] if args.axis else np.linalg.norm(x))}

    history = record(simulation, np.linspace(0.0, case.until, 101), observe)
    reference = np.genfromtxt(args.reference, delimiter=",", names=True)
    expected = np.interp(history["t"], reference["t"], reference[args.column])
    error = float(np.sqrt(np.mean((history["value"] - expected) ** 2)) / np.ptp(expected))
    print(f"rms error over the reference's range: {error:.4f}")
    draw(history["t"], history["value"], expected, label, args.output / "point_history.png")
    print(f"picture {args.output / 'point_history.png'}")
    return error


if __name__ == "__main__":
    main()
