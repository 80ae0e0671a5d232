"""Taylor–Green vortices at Re 100: a viscous liquid that flows past itself for good.

    python examples/taylor_green.py
    python examples/taylor_green.py -n 32

Prints the decay beside the exact solution of the incompressible equations and how evenly particles lie; draws them,
coloured by speed (``taylor_green.png``).
"""

import argparse
from pathlib import Path

import numpy as np

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.materials import Newtonian
from warp_eulsph.output import SnapshotWriter
from warp_eulsph.validation import Figure, table
from warp_eulsph.validation.cases.taylor_green import END, errors, exact

LIQUID = es.TaitLiquid(density=1.0, sound_speed=10.0, viscosity=Newtonian(viscosity=0.01))


def build(n: int) -> es.Simulation:
    """n × n particles in a periodic square, shifted as they go; the weight does not let them pair up."""
    x, volume = box((0.0, 0.0), (1.0, 1.0), 1.0 / n)
    body = es.Body(x=x, volume=volume, material=LIQUID, velocity=exact(x, 0.0), surface=0.0)
    scheme = es.Verlet(dissipation=es.Upwind(epsilon=0.5), shifting=es.Shifting())
    return es.Simulation(body, periodic=(1.0, 1.0), scheme=scheme, weight=es.WendlandC2(), dilation=1.8)


def draw(simulation: es.Simulation, path: Path) -> None:
    """Particles, coloured by speed."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 5), constrained_layout=True)
    x, speed = simulation.x % 1.0, np.linalg.norm(simulation.v, axis=1)
    dots = axes.scatter(x[:, 0], x[:, 1], c=speed, s=12, cmap="viridis")
    figure.colorbar(dots, label="speed [m/s]")
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title=f"{simulation.t:g} s")
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Run, print, draw; the checked figures by name."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=48, help="particles along a side")
    parser.add_argument("--output", type=Path, default=Path("runs/taylor_green"))
    args = parser.parse_args(argv)
    simulation, writer = build(args.n), SnapshotWriter(args.output)
    start = simulation.energy()["kinetic"]
    simulation.run(END, every=END / 10, output=writer)
    writer.derive()
    draw(simulation, args.output / "taylor_green.png")
    now, energy = errors(simulation), simulation.energy()
    checked = [
        Figure("relative error of the velocity", now["amplitude"], -0.02, 0.02, 0.0),
        Figure("relative error of the field (L2)", now["field"], 0.0, 0.04, 0.0),
        Figure("nearest neighbours / spacing", now["nearest"], 0.4, 1.0, 1.0),
        Figure("viscous work / energy", -energy["material"] / start, 0.7, 0.82, 1.0 - float(np.exp(-0.16 * np.pi**2))),
        Figure("dissipation (M9) / energy", -energy["dissipation"] / start, 0.0, 0.1, 0.0),
    ]
    print(table(checked))
    print(f"picture {args.output / 'taylor_green.png'}, snapshots {writer.series}")
    outside = [figure.name for figure in checked if not figure.accepted]
    if outside:
        raise SystemExit(f"outside the accepted band: {outside}")
    return {figure.name: figure.value for figure in checked}


if __name__ == "__main__":
    main()
