"""The history of a probe beside a reference.

    warp-eulsph run examples/cases/spinning_plate.toml -o runs/plate
    python examples/analysis/probe_history.py runs/plate corner x --component length \\
        --reference warp_eulsph/validation/reference/spin2d105_2.csv --column Rcorner

Prints the rms error over the range of the reference, a column of a CSV file whose column ``t`` is the time [s], and
draws both (``probe_history.png``, in the run's directory).
"""

import argparse
from pathlib import Path

import numpy as np

from warp_eulsph.output import Run


def component(values: np.ndarray, name: str, from_start: bool) -> np.ndarray:
    """One number per time: a component or the length of the rows, less the first row if ``from_start``."""
    rows = values.reshape(len(values), -1)
    rows = rows - rows[0] if from_start else rows
    return np.linalg.norm(rows, axis=1) if name == "length" else rows[:, "xyz".index(name)]


def draw(t: np.ndarray, found: np.ndarray, expected: np.ndarray, label: str, path: Path) -> None:
    """Both histories."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 5))
    axes.plot(t, found, label="run")
    axes.plot(t, expected, "k--", lw=1, label="reference")
    axes.set(xlabel="time [s]", ylabel=label)
    axes.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(argv: list[str] | None = None) -> float:
    """Print and draw; the rms error over the reference's range."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, help="directory of a run")
    parser.add_argument("probe", help="name of the probe")
    parser.add_argument("quantity", help="column of its table, such as x or force")
    parser.add_argument("--component", choices=("x", "y", "z", "length"), default="x")
    parser.add_argument("--from-start", action="store_true", help="less the first value, as for a displacement")
    parser.add_argument("--reference", required=True, type=Path, help="CSV file")
    parser.add_argument("--column", required=True, help="column of the CSV file, in the probe's unit")
    args = parser.parse_args(argv)
    table = Run(args.run).probes[args.probe]
    found = component(table[args.quantity], args.component, args.from_start)
    reference = np.genfromtxt(args.reference, delimiter=",", names=True)
    expected = np.interp(table["t"], reference["t"], reference[args.column])
    error = float(np.sqrt(np.mean((found - expected) ** 2)) / np.ptp(expected))
    print(f"rms error over the reference's range: {error:.4f}")
    label = f"{args.probe}: {args.quantity}, {args.component}{' from the start' if args.from_start else ''}"
    draw(table["t"], found, expected, label, args.run / "probe_history.png")
    print(f"picture {args.run / 'probe_history.png'}")
    return error


if __name__ == "__main__":
    main()
