"""A dam breaks on a rubber gate, which the water bends out of its way: liquid, solid and rigid walls together.

    python examples/elastic_gate.py                          half a minute
    python examples/elastic_gate.py -n 4 --until 0.21        minutes

A column of water, 0.1 m wide and 0.14 m high, leans on a rubber gate 5 mm thick that is clamped at its top and
free at its bottom. Prints how far the gate's tip is and the books; draws the water at three times and the tip's way
beside the one that Antoci, Gallati & Sibilla measured (Computers & Structures 85, 2007) (``elastic_gate.png``).
"""

import argparse
from pathlib import Path

import numpy as np

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.interactions import Contact, Plane, RigidBody
from warp_eulsph.materials import NeoHookean
from warp_eulsph.output import SnapshotWriter
from warp_eulsph.validation import Figure, table
from warp_eulsph.validation.cases.elastic_gate import MEASURED, through, tip

WIDE, DEEP = 0.1, 0.14  # m, the water
FREE, TOP, THICK = 0.079, 0.16, 0.005  # m, of the gate: to its clamp, to its upper end, across
FRAMES = 24


def build(across: int) -> es.Simulation:
    """The gate, ``across`` particles thick, and water of particles twice as wide, each by what suits it."""
    dx = THICK / across
    rows = round(FREE / dx - 0.5)
    x, volume = box((0.0, 0.0), (THICK, round(TOP / dx) * dx), dx)
    rubber = NeoHookean(density=1100.0, young=12e6, poisson=0.4)
    gate = es.Body(x=x, volume=volume, material=rubber, spacing=dx, name="gate")
    x, volume = box((-WIDE, 0.0), (0.0, DEEP), 2.0 * dx)
    liquid = es.TaitLiquid(density=1000.0, sound_speed=10.0 * (2.0 * 9.81 * DEEP) ** 0.5, cavitation=0.0)
    water = es.Body(x=x, volume=volume, material=liquid, spacing=2.0 * dx, name="water")
    walls = [
        RigidBody(Plane((0.0, 1.0)), bodies=["water"], name="floor"),
        RigidBody(Plane((1.0, 0.0)), centre=(-WIDE, 0.0), bodies=["water"], name="back"),
    ]
    clamp = es.Fixed(lambda X: X[:, 1] > rows * dx, body="gate")
    touch = Contact(between=[("gate", "water")])
    return es.Simulation([gate, water], boundaries=[es.Gravity(), clamp], interactions=[*walls, touch])


def draw(simulation: es.Simulation, looks: list[tuple[float, np.ndarray, np.ndarray]], path: Path) -> None:
    """Water by its speed and the gate at three times; the way of the tip, and the measured one."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    gate, water = (slice(r.start, r.stop) for r in (simulation.ranges["gate"], simulation.ranges["water"]))
    figure, axes = plt.subplots(1, 4, figsize=(15, 4.2), layout="constrained", width_ratios=(2, 2, 2, 3))
    for axis, k in zip(axes[:3], (0, len(looks) // 2, len(looks) - 1), strict=True):
        time, x, speed = looks[k]
        axis.scatter(*x[gate].T, s=1, c="k")
        dots = axis.scatter(*x[water].T, s=3, c=speed[water], vmin=0.0, vmax=2.0, cmap="viridis")
        axis.set(xlim=(-0.105, 0.1), ylim=(-0.005, 0.165), aspect="equal", title=f"{1e3 * time:.0f} ms", xlabel="x [m]")
    figure.colorbar(dots, ax=axes[2], label="speed [m/s]")
    time, x = np.array([look[0] for look in looks]), np.array([look[1][gate] for look in looks])
    lowest = simulation.X[gate, 1] < 1.01 * simulation.X[gate, 1].min()
    way = (x[:, lowest] - x[0, lowest]).mean(axis=1)
    measured = MEASURED[MEASURED[:, 0] < 1.05 * time[-1]]
    for i, (name, colour) in enumerate((("aside", "tab:blue"), ("up", "tab:orange"))):
        axes[3].plot(1e3 * time, 1e3 * way[:, i], c=colour, label=name)
        axes[3].plot(1e3 * measured[:, 0], 1e3 * measured[:, 1 + i], "o", c=colour, label=f"{name}, measured")
    axes[3].set(xlabel="t [ms]", ylabel="way of the tip [mm]")
    axes[3].legend()
    figure.savefig(path, dpi=100)
    plt.close(figure)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Run, print, draw; the checked figures by name."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=3, help="particles across the gate")
    parser.add_argument("--until", type=float, default=0.0835, help="[s]; the tip was measured from 0.0436 on")
    parser.add_argument("--output", type=Path, default=Path("runs/elastic_gate"))
    args = parser.parse_args(argv)
    simulation, writer = build(args.n), SnapshotWriter(args.output)

    def look() -> tuple[float, np.ndarray, np.ndarray]:
        return simulation.t, simulation.x, np.linalg.norm(simulation.v, axis=1)

    looks = [look()]
    for k, _ in enumerate(simulation.frames(np.linspace(0.0, args.until, FRAMES + 1)[1:])):
        looks.append(look())
        if k % 4 == 3:
            writer.write(simulation)
    writer.finish()
    draw(simulation, looks, args.output / "elastic_gate.png")
    energy, aside = simulation.energy(), 1e3 * float(tip(simulation)[0])
    way = Figure("way of the tip [mm]", aside)
    if args.until >= MEASURED[0, 0]:
        then = 1e3 * float(np.interp(args.until, MEASURED[:, 0], MEASURED[:, 1]))
        way = Figure(way.name, aside, 0.75 * then, 1.36 * then, then)
    checked = [
        way,
        Figure("water through the gate", through(simulation), 0.0, 0.0, 0.0),
        Figure("account of the contacts / energy", energy["interaction"] / energy["total"], -1e-6, 1e-6, 0.0),
        Figure("ledger residual / energy", abs(energy["residual"]) / energy["total"], 0.0, 1e-10, 0.0),
    ]
    print(table(checked))
    print(f"picture {args.output / 'elastic_gate.png'}, snapshots {writer.series}")
    outside = [figure.name for figure in checked if not figure.accepted]
    if outside:
        raise SystemExit(f"outside the accepted band: {outside}")
    return {figure.name: figure.value for figure in checked}


if __name__ == "__main__":
    main()
