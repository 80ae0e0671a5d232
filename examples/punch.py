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

import numpy as np
import warp as wp

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.output import Figure, SnapshotWriter, read_snapshot, table

END_TIME, FRAMES = 0.03, 300
CORNER = np.array([1.0, 1.0])
REFERENCES = {"total": es.Never(), "updated": es.Every(5), "eulerian": es.Always()}
SERIES = Path(__file__).parents[1] / "warp_eulsph" / "validation" / "reference" / "punch_16_3.csv"
# (time [s], least and largest reaction [MN/m] of the reference's refinement levels)
REACTIONS = ((0.005, 1.257, 1.270), (0.010, 3.13, 3.17), (0.015, 3.55, 3.73))


@wp.func
def punch_velocity(x: wp.vec2d, t: wp.float64):
    """−10 m/s, reached smoothly in 2 ms."""
    s = wp.min(t / wp.float64(2.0e-3), wp.float64(1.0))
    return wp.vec2d(wp.float64(0.0), wp.float64(-10.0) * s * s * (wp.float64(3.0) - wp.float64(2.0) * s))


def build(n: int, reference: es.ReferencePolicy) -> tuple[es.Simulation, es.Velocity]:
    """The block as n × n particles, and the condition of the punch."""
    dx = 1.0 / n
    x, volume = box((0.0, 0.0), (1.0, 1.0), dx)
    rubber = es.NeoHookean(density=1100.0, young=17e6, poisson=0.45)
    punch = es.Velocity(lambda X: (X[:, 1] > 1.0 - dx) & (X[:, 0] < 0.5), punch_velocity, axes=(1,))
    rollers = [
        es.Fixed(lambda X: (X[:, 0] < dx) | (X[:, 0] > 1.0 - dx), axes=(0,)),
        es.Fixed(lambda X: X[:, 1] < dx, axes=(1,)),
    ]
    block = es.Body(x=x, volume=volume, material=rubber)
    return es.Simulation(block, boundaries=[*rollers, punch], reference=reference), punch


def run(simulation: es.Simulation, punch: es.Velocity, writer: SnapshotWriter) -> dict[str, np.ndarray]:
    """Histories of time, reaction [MN/m], rise of the free corner, energy, work, and range of J."""
    X, rows = simulation.x, []
    a = np.argmin(np.linalg.norm(X - CORNER, axis=1))
    for k, t in enumerate(simulation.frames(np.linspace(0.0, END_TIME, FRAMES + 1))):
        rise = (simulation.x[a] + simulation.F[a] @ (CORNER - X[a]) - CORNER)[1]
        energy, J = simulation.energy(), simulation.J
        reaction = -1e-6 * simulation.reaction(punch)[1]
        rows.append([t, reaction, rise, energy["total"], energy["constraint"], J.min(), J.max()])
        if k % 30 == 0:
            writer.write(simulation)
    names = ("t", "reaction", "rise", "energy", "work", "J_min", "J_max")
    return dict(zip(names, np.array(rows).T, strict=True))


def near(history: dict[str, np.ndarray], name: str, time: float) -> float:
    """Mean over 0.5 ms about a time: single steps ring."""
    return float(history[name][np.abs(history["t"] - time) < 0.26e-3].mean())


def figures(history: dict[str, np.ndarray], residual: float, series: np.ndarray) -> list[Figure]:
    """Bands: 10 % about the reference's range, for coarse particles; the balance of work is a measured one."""
    checked = []
    for time, low, high in REACTIONS:
        name = f"reaction at {1e3 * time:g} ms [MN/m]"
        checked.append(Figure(name, near(history, "reaction", time), 0.9 * low, 1.1 * high, 0.5 * (low + high)))
    for time, _, _ in REACTIONS[1:]:
        rise = np.interp(time, series["t"], series["uy11"])
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


def draw(history: dict[str, np.ndarray], series: np.ndarray, writer: SnapshotWriter, path: Path) -> None:
    """Reaction over time, and the deformed block."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5))
    left.plot(1e3 * history["t"], history["reaction"], label="particles")
    left.plot(1e3 * series["t"], 1e-6 * series["Fpunch"], "k--", lw=1, label="reference")
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
    parser.add_argument("--reference", choices=REFERENCES, default="eulerian")
    parser.add_argument("--output", type=Path, default=Path("runs/punch"))
    args = parser.parse_args(argv)
    wp.config.log_level = wp.LOG_WARNING
    series = np.genfromtxt(SERIES, delimiter=",", names=True)
    simulation, punch = build(args.n, REFERENCES[args.reference])
    writer = SnapshotWriter(args.output)
    history = run(simulation, punch, writer)
    draw(history, series, writer, args.output / "punch.png")
    checked = figures(history, simulation.energy()["residual"], series)
    print(table(checked))
    print(f"picture {args.output / 'punch.png'}, snapshots {writer.series}")
    outside = [figure.name for figure in checked if not figure.accepted]
    if outside:
        raise SystemExit(f"outside the accepted band: {outside}")
    return {figure.name: figure.value for figure in checked}


if __name__ == "__main__":
    main()
