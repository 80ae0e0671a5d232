"""Twisting rubber column, 3-D, against an independent spectral-element solution.

    python examples/twisting_column.py            python examples/twisting_column.py -n 8

A 1 m × 6 m × 1 m column on a clamped base starts with the spin 105 sin(π y/12) rad/s about its axis and turns its top
by almost a full revolution. Prints the largest rotation of the top corner and its time, the largest strain energy and
the energy kept against the reference (twist_2.csv); draws the rotation over time and the twisted column
(``twisting_column.png``). 6 particles across turn 1.4 % too far.
"""

import argparse
from pathlib import Path

import numpy as np

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.output import SnapshotWriter, read_snapshot
from warp_eulsph.validation import Figure, table
from warp_eulsph.validation.cases.twisting_column import END_TIME, measure, reference_history
from warp_eulsph.validation.history import History
from warp_eulsph.validation.solids import FORMS

RUBBER = es.NeoHookean(density=1100.0, young=17e6, poisson=0.45)
HEIGHT = 6.0  # m


def build(n: int, reference: es.ReferencePolicy) -> es.Simulation:
    """The column, n particles across; clamped at its base, the spin grows from none there to 105 rad/s."""
    x, volume = box(lower=(-0.5, 0.0, -0.5), upper=(0.5, HEIGHT, 0.5), spacing=1.0 / n)
    spin = 105.0 * np.sin(np.pi * x[:, 1] / (2.0 * HEIGHT))
    velocity = np.stack([spin * x[:, 2], np.zeros(len(x)), -spin * x[:, 0]], axis=1)
    column = es.Body(x=x, volume=volume, material=RUBBER, velocity=velocity)
    base = es.Clamped(point=(0.0, 0.0, 0.0), normal=(0.0, -1.0, 0.0))
    return es.Simulation(column, boundaries=[base], reference=reference)


def figures(n: int, history: History, residual: float, reference: History) -> list[Figure]:
    """The bands are measured ones: an error that falls with the spacing, and the energy lost by a coarse column."""
    rotation = reference["rotation"]
    top, top_reference = history["rotation"].argmax(), rotation.argmax()
    energy = history["energy"] / history["energy"][0]
    error = history["rotation"][top] / rotation[top_reference] - 1.0
    return [
        Figure("largest rotation [degrees]", history["rotation"][top], reference=rotation[top_reference]),
        Figure("its relative error", error, -0.01, 0.03 * 6 / n, 0.0),
        Figure("its time [s]", history["t"][top], 0.08, 0.11, reference["t"][top_reference]),
        Figure("largest strain energy [J]", history["stored"].max(), reference=reference["stored"].max()),
        Figure("energy kept", energy[-1], 0.9, 1.0 + 1e-4, 1.0),
        Figure("largest energy / first", energy.max(), 0.0, 1.0 + 1e-4, 1.0),
        Figure("ledger residual / energy", abs(residual) / history["energy"][0], 0.0, 1e-10, 0.0),
    ]


def draw(history: History, reference: History, writer: SnapshotWriter, path: Path) -> None:
    """Rotation over time, and the twisted column."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(11, 5))
    left, right = figure.add_subplot(1, 2, 1), figure.add_subplot(1, 2, 2, projection="3d")
    left.plot(1e3 * history["t"], history["rotation"], label="particles")
    shown = reference["t"] < END_TIME
    left.plot(1e3 * reference["t"][shown], reference["rotation"][shown], "k--", lw=1, label="reference")
    left.set(xlabel="time [ms]", ylabel="rotation of the top corner [degrees]")
    left.legend()
    last = read_snapshot(writer.last)
    x, y, z = last.x.T
    dots = right.scatter(x, z, y, c=1e-6 * last.fields["pressure"], s=8, cmap="coolwarm")
    figure.colorbar(dots, label="pressure [MPa]")
    right.set(
        title=f"{1e3 * last.time:g} ms", box_aspect=(1, 1, 4), xlim=(-0.8, 0.8), ylim=(-0.8, 0.8), xticks=(), yticks=()
    )
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Run, print, draw; the checked figures by name."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=6, help="particles across")
    parser.add_argument("--reference", choices=FORMS, default="eulerian")
    parser.add_argument("--output", type=Path, default=Path("runs/twisting_column"))
    args = parser.parse_args(argv)
    reference = reference_history()
    simulation, writer = build(args.n, FORMS[args.reference]), SnapshotWriter(args.output)
    history = measure(simulation, writer)
    draw(history, reference, writer, args.output / "twisting_column.png")
    checked = figures(args.n, history, simulation.energy()["residual"], reference)
    print(table(checked))
    print(f"picture {args.output / 'twisting_column.png'}, snapshots {writer.series}")
    outside = [figure.name for figure in checked if not figure.accepted]
    if outside:
        raise SystemExit(f"outside the accepted band: {outside}")
    return {figure.name: figure.value for figure in checked}


if __name__ == "__main__":
    main()
