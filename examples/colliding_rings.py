"""Two rubber rings that fly at each other, touch, are pressed flat and bounce off.

    python examples/colliding_rings.py            python examples/colliding_rings.py -n 8 --speed 0.3 --central

Rings of 0.7 to 1 m, 2-D plane strain, each at a share of the speed of its pressure waves, a little off centre. Prints
what the contact may not change: momenta, and energy beside that which dissipation takes (its share falls with ``-n``);
angular momentum is exact with ``--central``, dissipation through stress too (``Upwind(stress=True)``);
draws the rings when they are pressed most and at the end, and the energies (``colliding_rings.png``).
"""

import argparse
from pathlib import Path

import numpy as np

import warp_eulsph as es
from warp_eulsph.geometry import annulus
from warp_eulsph.output import SnapshotWriter
from warp_eulsph.validation import Figure, table
from warp_eulsph.validation.history import History, record

RUBBER = es.NeoHookean(density=1000.0, young=1e6, poisson=0.3)
WAVE_SPEED = float(np.sqrt(1e6 * 0.7 / (1.3 * 0.4) / 1000.0))  # m/s
FRAMES = 60


def build(n: int, speed: float, central: bool = False) -> es.Simulation:
    """The rings as n circles of particles each, ``speed`` over that of pressure waves."""
    x, volume = annulus(centre=(0.0, 0.0), inner=0.7, outer=1.0, rings=n)
    v = speed * WAVE_SPEED
    left = es.Body(x=x - np.array([1.1, 0.1]), volume=volume, material=RUBBER, velocity=(v, 0.0), name="left")
    right = es.Body(x=x + np.array([1.1, 0.1]), volume=volume, material=RUBBER, velocity=(-v, 0.0), name="right")
    scheme = es.Verlet(dissipation=es.Upwind(stress=central))
    return es.Simulation([left, right], interactions=[es.Contact()], scheme=scheme)


def measure(simulation: es.Simulation, speed: float, writer: SnapshotWriter) -> tuple[History, list[np.ndarray]]:
    """Energies and momenta until the rings have flown 1.5 m apart again, and where all was at every look."""
    half, places = len(simulation.x) // 2, []

    def observe() -> dict[str, float]:
        places.append(simulation.x)
        energy = simulation.energy()
        return {
            **{name: energy[name] for name in ("kinetic", "stored", "held", "dissipation", "interaction", "total")},
            "left": simulation.v[:half, 0].mean(),
            "force": np.linalg.norm(simulation.interaction_force[:half].sum(axis=0)),
            "momentum": np.abs(simulation.momentum()).max(),
            "spin": simulation.angular_momentum()[0],
        }

    times = np.linspace(0.0, 3.0 / (speed * WAVE_SPEED), FRAMES + 1)
    return record(simulation, times, observe, writer=writer, stride=6), places


def figures(history: History, simulation: es.Simulation, speed: float) -> list[Figure]:
    """Momentum to round-off; the contact's account, the error of the steps; spin, which dissipation takes some of."""
    start, v = history["total"][0], speed * WAVE_SPEED
    scale = v * simulation.particles.mass.numpy().sum()
    turned = np.abs(history["spin"] - history["spin"][0]).max() / (0.1 * scale)
    return [
        Figure("velocity of the left one, end / start", history["left"][-1] / v, -1.0, 0.0),
        Figure("kinetic and stored energy, end / start", history["total"][-1] / start, 0.4, 1.0, 1.0),
        Figure("taken by the contact / energy", history["interaction"][-1] / start, -0.01, 0.002, 0.0),
        Figure("momentum / (mass speed)", history["momentum"].max() / scale, 0.0, 1e-12, 0.0),
        Figure("angular momentum, change / start", turned, 0.0, 0.02, 0.0),
        Figure("ledger residual / energy", abs(simulation.energy()["residual"]) / start, 0.0, 1e-11, 0.0),
    ]


def draw(history: History, places: list[np.ndarray], path: Path) -> None:
    """The rings when they are pressed most and at the end, and the energies."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(14, 4.5))
    half, pressed = len(places[0]) // 2, int(np.argmax(history["stored"]))
    for axis, k in zip(axes, (pressed, len(places) - 1), strict=False):
        for own in (slice(0, half), slice(half, None)):
            axis.scatter(*places[k][own].T, s=3e3 / half**0.9)
        axis.set(aspect="equal", title=f"{1e3 * history['t'][k]:.3g} ms", xlabel="x [m]", ylabel="y [m]")
    lost = -history["dissipation"] - history["dissipation"][0]
    for name, values in (("kinetic", history["kinetic"]), ("stored", history["stored"]), ("dissipated", lost)):
        axes[2].plot(1e3 * history["t"], 1e-3 * values, label=name)
    axes[2].plot(1e3 * history["t"], 1e-3 * history["held"], label="held by the contact")
    axes[2].set(xlabel="time [ms]", ylabel="energy [kJ/m]")
    axes[2].legend()
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Run, print, draw; the checked figures by name."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=6, help="circles of particles in a ring")
    parser.add_argument("--speed", type=float, default=0.15, help="of each ring, over that of pressure waves")
    parser.add_argument("--central", action="store_true", help="dissipation that keeps angular momentum")
    parser.add_argument("--output", type=Path, default=Path("runs/colliding_rings"))
    args = parser.parse_args(argv)
    simulation, writer = build(args.n, args.speed, args.central), SnapshotWriter(args.output)
    history, places = measure(simulation, args.speed, writer)
    draw(history, places, args.output / "colliding_rings.png")
    checked = figures(history, simulation, args.speed)
    print(table(checked))
    print(f"picture {args.output / 'colliding_rings.png'}, snapshots {writer.series}")
    outside = [figure.name for figure in checked if not figure.accepted]
    if outside:
        raise SystemExit(f"outside the accepted band: {outside}")
    return {figure.name: figure.value for figure in checked}


if __name__ == "__main__":
    main()
