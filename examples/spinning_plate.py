"""Spinning rubber plate, 2-D plane strain, against an independent spectral-element solution.

    python examples/spinning_plate.py            python examples/spinning_plate.py -n 32 --reference total

A free 1 m × 1 m plate set off at 105 rad/s stretches and pulsates. Prints rms errors of the corner radius and of the
strain energy over 20 ms against the reference (spin2d105_2.csv), energy and momenta kept; draws the corner radius and
the stressed plate (``spinning_plate.png``). Expect errors that fall with ``-n``.
"""

import argparse
from pathlib import Path

import numpy as np

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.output import SnapshotWriter, read_snapshot
from warp_eulsph.validation import Figure, table
from warp_eulsph.validation.cases.spinning_plate import SERIES, measure
from warp_eulsph.validation.history import History, at, series
from warp_eulsph.validation.solids import FORMS

RUBBER = es.NeoHookean(density=1100.0, young=17e6, poisson=0.45)
SPIN = 105.0  # rad/s


def build(n: int, reference: es.ReferencePolicy) -> es.Simulation:
    """The plate as n × n particles, free all round; at the start it turns as if it were rigid."""
    x, volume = box(lower=(-0.5, -0.5), upper=(0.5, 0.5), spacing=1.0 / n)
    velocity = SPIN * np.stack([-x[:, 1], x[:, 0]], axis=1)
    plate = es.Body(x=x, volume=volume, material=RUBBER, velocity=velocity)
    return es.Simulation(plate, reference=reference)


def figures(n: int, history: History, simulation: es.Simulation, reference: History) -> list[Figure]:
    """Errors over the whole history. The bands are measured ones (about twice the error), falling at first order."""
    radius = at(reference, "Rcorner", history["t"])
    stored = at(reference, "W", history["t"])
    radius_error = np.sqrt(np.mean((history["radius"] - radius) ** 2)) / np.ptp(radius)
    stored_error = np.sqrt(np.mean((history["stored"] - stored) ** 2)) / stored.max()
    energy = history["energy"] / history["energy"][0]
    momentum = np.abs(simulation.momentum()).max() / (RUBBER.density * SPIN)
    return [
        Figure("corner radius, rms error / range", radius_error, 0.0, 0.2 * 16 / n, 0.0),
        Figure("strain energy, rms error / largest", stored_error, 0.0, 0.2 * 16 / n, 0.0),
        Figure("energy kept", energy[-1], 1.0 - 0.03 * 16 / n, 1.0, 1.0),
        Figure("largest energy / first", energy.max(), 0.0, 1.0 + 1e-4, 1.0),
        Figure("angular momentum kept", history["spin"][-1] / history["spin"][0], 0.99, 1.01, 1.0),
        Figure("linear momentum / (mass ω 1 m)", momentum, 0.0, 1e-10, 0.0),
        Figure(
            "ledger residual / energy", abs(simulation.energy()["residual"]) / history["energy"][0], 0.0, 1e-10, 0.0
        ),
    ]


def draw(history: History, reference: History, writer: SnapshotWriter, path: Path) -> None:
    """Corner radius over time, and the pressure at the end."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5))
    left.plot(1e3 * history["t"], history["radius"], label="particles")
    shown = reference["t"] <= history["t"][-1]
    left.plot(1e3 * reference["t"][shown], reference["Rcorner"][shown], "k--", lw=1, label="reference")
    left.set(xlabel="time [ms]", ylabel="corner radius [m]")
    left.legend()
    last = read_snapshot(writer.last)
    dots = right.scatter(*last.x.T, c=1e-6 * last.fields["pressure"], s=2e4 / len(last.x), cmap="coolwarm")
    figure.colorbar(dots, label="pressure [MPa]")
    right.set(aspect="equal", title=f"{1e3 * last.time:g} ms")
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Run, print, draw; the checked figures by name."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=16, help="particles along a side")
    parser.add_argument("--reference", choices=FORMS, default="eulerian")
    parser.add_argument("--until", type=float, default=0.02, help="end time [s], at most 0.15; the bands are for 0.02")
    parser.add_argument("--output", type=Path, default=Path("runs/spinning_plate"))
    args = parser.parse_args(argv)
    reference = series(SERIES)
    simulation, writer = build(args.n, FORMS[args.reference]), SnapshotWriter(args.output)
    history = measure(simulation, args.until, writer)
    draw(history, reference, writer, args.output / "spinning_plate.png")
    checked = figures(args.n, history, simulation, reference)
    print(table(checked))
    print(f"picture {args.output / 'spinning_plate.png'}, snapshots {writer.series}")
    outside = [figure.name for figure in checked if not figure.accepted]
    if outside:
        raise SystemExit(f"outside the accepted band: {outside}")
    return {figure.name: figure.value for figure in checked}


if __name__ == "__main__":
    main()
