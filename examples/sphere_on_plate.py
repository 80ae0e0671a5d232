"""A rigid sphere falls onto a rubber plate that lies on two rigid cylinders, 3-D.

    python examples/sphere_on_plate.py            python examples/sphere_on_plate.py -n 6

The sphere, of 0.1 m radius, is free: it gives the plate all of its momentum, and the plate bounces on its supports.
Prints what they exchange: momentum to round-off, energy by the ledger, and the largest force over that of a mass on a
massless beam on two supports, which the plate's own mass multiplies; draws the middle of the plate where the sphere is
deepest, and the forces (``sphere_on_plate.png``).
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.interactions import Cylinder, Free, RigidBody, Sphere
from warp_eulsph.output import SnapshotWriter
from warp_eulsph.validation import Figure, table

RUBBER = es.NeoHookean(density=1100.0, young=5e6, poisson=0.4)
LENGTH, WIDTH, HEIGHT, SPAN = 1.0, 0.3, 0.1, 0.8  # m
RADIUS, MASS, SPEED = 0.1, 10.0, 3.0  # of the sphere: m, kg, m/s
END = 0.1  # s


def build(n: int) -> es.Simulation:
    """The plate, n particles through its height; the sphere a millimetre above it."""
    lower, upper = (-LENGTH / 2, -WIDTH / 2, 0.0), (LENGTH / 2, WIDTH / 2, HEIGHT)
    x, volume = box(lower=lower, upper=upper, spacing=HEIGHT / n)
    plate = es.Body(x=x, volume=volume, material=RUBBER, name="plate")
    sphere = RigidBody(
        Sphere(RADIUS),
        centre=(0.0, 0.0, HEIGHT + RADIUS + 2e-4),
        motion=Free(mass=MASS, velocity=(0.0, 0.0, -SPEED)),
        name="sphere",
    )
    rod = Cylinder(0.05, 0.4, axis=(0.0, 1.0, 0.0))
    supports = [
        RigidBody(rod, centre=(side * SPAN / 2, 0.0, -0.05), name=name) for side, name in ((-1, "left"), (1, "right"))
    ]
    return es.Simulation(plate, interactions=[sphere, *supports])


def largest_force() -> float:
    """Of a mass on a massless beam that rests on two supports [N]: v √(k m), k = 48 E I/L³."""
    stiffness = 48.0 * 5e6 * WIDTH * HEIGHT**3 / 12.0 / SPAN**3
    return SPEED * (stiffness * MASS) ** 0.5


def measure(simulation: es.Simulation, writer: SnapshotWriter | None = None) -> dict[str, Any]:
    """Vertical forces [N] on sphere and supports, speed of the sphere [m/s], over time; where it was deepest."""
    sphere, *supports = simulation.bound_interactions
    rows, deepest, impulse = [], None, np.zeros(3)
    frames = np.linspace(0.0, END, 51)
    for k, time in enumerate(frames[1:]):
        while simulation.t < time:
            simulation.advance(time, 1)
            impulse -= simulation.dt * sum(each.force for each in supports)
            pushed = -sum(each.force[2] for each in supports)
            rows.append((simulation.t, sphere.force[2], pushed, sphere.v[2], sphere.x[2]))
        if deepest is None or sphere.x[2] < deepest[1][2]:
            deepest = simulation.x, sphere.x
        if writer is not None and k % 5 == 4:
            writer.write(simulation)
    names = ("t", "sphere", "supports", "v", "z")
    return dict(zip(names, np.array(rows).T, strict=True)) | {"deepest": deepest, "impulse": impulse}


def figures(simulation: es.Simulation, found: dict[str, Any]) -> list[Figure]:
    """The beam's force is that of a static shape: the plate's own mass makes the first blow harder."""
    sphere = simulation.bound_interactions[0]
    energy, start = simulation.energy(), 0.5 * MASS * SPEED**2
    momentum = simulation.momentum() + MASS * (sphere.v - np.array([0.0, 0.0, -SPEED])) - found["impulse"]
    force, beam = found["sphere"].max(), largest_force()
    return [
        Figure(
            "momentum that is missing / that of the sphere", np.abs(momentum).max() / (MASS * SPEED), 0.0, 1e-10, 0.0
        ),
        Figure("largest force on the sphere / beam's", force / beam, 1.0, 4.0),
        Figure("speed of the sphere at last [m/s]", found["v"][-1], -SPEED, SPEED),
        Figure("deepest [m]", HEIGHT + RADIUS - found["z"].min()),
        Figure("energy of contacts and sphere / start", energy["held"] / start),
        Figure("error of contacts / energy", energy["interaction"] / start, -0.02, 0.005, 0.0),
        Figure("dissipation (M9) / energy", -energy["dissipation"] / start, 0.0, 0.3),
        Figure("ledger residual / energy", abs(energy["residual"]) / start, 0.0, 1e-12, 0.0),
    ]


def draw(simulation: es.Simulation, found: dict[str, Any], path: Path) -> None:
    """The middle of the plate where the sphere is deepest, and the forces."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    x, centre = found["deepest"]
    X, spacing = simulation.X, simulation.bodies[0].spacing[0]
    shown = np.abs(X[:, 1]) < 0.6 * spacing
    figure, (above, below) = plt.subplots(2, 1, figsize=(8, 7))
    above.scatter(x[shown, 0], x[shown, 2], c=X[shown, 2], s=18, cmap="viridis")
    rounds = [(centre[0], centre[2], RADIUS), *[(side * SPAN / 2, -0.05, 0.05) for side in (-1, 1)]]
    for a, b, radius in rounds:
        above.add_patch(plt.Circle((a, b), radius, color="0.6"))
    above.set(aspect="equal", xlabel="x [m]", ylabel="z [m]", title="where the sphere is deepest")
    below.plot(1e3 * found["t"], 1e-3 * found["sphere"], label="on the sphere")
    below.plot(1e3 * found["t"], 1e-3 * found["supports"], label="of the supports")
    below.set(xlabel="t [ms]", ylabel="force upwards [kN]")
    below.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Run, print, draw; the checked figures by name."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=5, help="particles through the plate's height")
    parser.add_argument("--output", type=Path, default=Path("runs/sphere_on_plate"))
    args = parser.parse_args(argv)
    simulation, writer = build(args.n), SnapshotWriter(args.output)
    found = measure(simulation, writer)
    writer.finish()
    draw(simulation, found, args.output / "sphere_on_plate.png")
    checked = figures(simulation, found)
    print(table(checked))
    print(f"picture {args.output / 'sphere_on_plate.png'}, snapshots {writer.series}")
    outside = [figure.name for figure in checked if not figure.accepted]
    if outside:
        raise SystemExit(f"outside the accepted band: {outside}")
    return {figure.name: figure.value for figure in checked}


if __name__ == "__main__":
    main()
