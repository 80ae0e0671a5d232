"""Rubber block under a punch, 30 % deep, 2-D plane strain, against an independent spectral-element solution.

    python examples/punch.py            python examples/punch.py -n 40

The left half of the top of a 1 m × 1 m block is driven down at 10 m/s, without friction; sides and base are rollers.
Material flows round the punch's corner: the reference (punch_16_3.csv) inverts its elements at 19 ms, the Eulerian form
goes on to 30 ms. Prints the reaction at 5, 10 and 15 ms and the height of the free corner against the reference, the
volume ratios, and stored + kinetic energy over the punch's work; draws the reaction and the deformed block
(``punch.png``).
"""

import argparse
from pathlib import Path

import warp as wp

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.output import SnapshotWriter, read_snapshot
from warp_eulsph.validation import Figure, table
from warp_eulsph.validation.cases.punch import END_TIME, REACTIONS, SERIES, measure, near
from warp_eulsph.validation.history import History, at, series
from warp_eulsph.validation.solids import FORMS

RUBBER = es.NeoHookean(density=1100.0, young=17e6, poisson=0.45)


@wp.func  # compiled, so that steps need no Python; a Python function (x, t) -> velocities would do too
def punch_velocity(x: wp.vec2d, t: wp.float64):
    """−10 m/s, reached smoothly in 2 ms."""
    s = wp.min(t / wp.float64(2.0e-3), wp.float64(1.0))
    return wp.vec2d(wp.float64(0.0), wp.float64(-10.0) * s * s * (wp.float64(3.0) - wp.float64(2.0) * s))


def build(n: int, reference: es.ReferencePolicy) -> tuple[es.Simulation, es.Velocity]:
    """The block as n × n particles, and the condition of the punch, whose reaction is asked for."""
    dx = 1.0 / n
    x, volume = box(lower=(0.0, 0.0), upper=(1.0, 1.0), spacing=dx)
    block = es.Body(x=x, volume=volume, material=RUBBER)
    sides = es.Fixed(lambda X: (X[:, 0] < dx) | (X[:, 0] > 1.0 - dx), axes=(0,))
    base = es.Fixed(lambda X: X[:, 1] < dx, axes=(1,))
    punch = es.Velocity(lambda X: (X[:, 1] > 1.0 - dx) & (X[:, 0] < 0.5), punch_velocity, axes=(1,))
    return es.Simulation(block, boundaries=[sides, base, punch], reference=reference), punch


def figures(history: History, residual: float, reference: History) -> list[Figure]:
    """Bands: 10 % about the reference's range, for coarse particles; the balance of work is a measured one."""
    checked = []
    for time, (low, high) in REACTIONS.items():
        name = f"reaction at {1e3 * time:g} ms [MN/m]"
        checked.append(Figure(name, near(history, "reaction", time), 0.9 * low, 1.1 * high, 0.5 * (low + high)))
    for time in list(REACTIONS)[1:]:
        rise = at(reference, "uy11", time)
        value = near(history, "rise", time)
        checked.append(Figure(f"rise of the corner at {1e3 * time:g} ms [m]", value, 0.8 * rise, 1.2 * rise, rise))
    return [
        *checked,
        Figure("reaction at 30 ms [MN/m]", near(history, "reaction", END_TIME)),
        Figure("least volume ratio", history["J_min"].min(), low=0.01),
        Figure("largest volume ratio", history["J_max"].max(), high=2.0),
        Figure("energy / work at 30 ms", history["energy"][-1] / history["work"][-1], 0.8, 1.001, 1.0),
        Figure("ledger residual / work", abs(residual) / history["work"][-1], 0.0, 1e-10, 0.0),
    ]


def draw(history: History, reference: History, writer: SnapshotWriter, path: Path) -> None:
    """Reaction over time, and the deformed block."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5))
    left.plot(1e3 * history["t"], history["reaction"], label="particles")
    left.plot(1e3 * reference["t"], 1e-6 * reference["Fpunch"], "k--", lw=1, label="reference")
    left.set(xlabel="time [ms]", ylabel="reaction [MN/m]")
    left.legend()
    last = read_snapshot(writer.last)
    dots = right.scatter(*last.x.T, c=1e-6 * last.fields["pressure"], s=2e4 / len(last.x), cmap="viridis")
    figure.colorbar(dots, label="pressure [MPa]")
    right.set(aspect="equal", title=f"{1e3 * last.time:g} ms")
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Run, print, draw; the checked figures by name."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=20, help="particles along a side")
    parser.add_argument("--reference", choices=FORMS, default="eulerian")
    parser.add_argument("--output", type=Path, default=Path("runs/punch"))
    args = parser.parse_args(argv)
    reference = series(SERIES)
    simulation, punch = build(args.n, FORMS[args.reference])
    writer = SnapshotWriter(args.output)
    history = measure(simulation, punch, writer=writer)
    draw(history, reference, writer, args.output / "punch.png")
    checked = figures(history, simulation.energy()["residual"], reference)
    print(table(checked))
    print(f"picture {args.output / 'punch.png'}, snapshots {writer.series}")
    outside = [figure.name for figure in checked if not figure.accepted]
    if outside:
        raise SystemExit(f"outside the accepted band: {outside}")
    return {figure.name: figure.value for figure in checked}


if __name__ == "__main__":
    main()
