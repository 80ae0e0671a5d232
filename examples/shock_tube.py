"""Sod's shock tube: an ideal gas, the wall between high and low pressure taken away.

    python examples/shock_tube.py
    python examples/shock_tube.py -n 100

Prints the states between shock, contact and fan beside the exact solution of the Riemann problem, and draws density,
velocity and pressure (``shock_tube.png``). What dissipation takes at the shock heats the gas: without that heat the
shock would be too slow.
"""

import argparse
from pathlib import Path

import numpy as np

import warp_eulsph as es
from warp_eulsph.materials import IdealGas
from warp_eulsph.output import SnapshotWriter
from warp_eulsph.validation import Figure, table
from warp_eulsph.validation.cases.shock_tube import TUBES, errors, fields
from warp_eulsph.validation.riemann import solve

HIGH, LOW = IdealGas(density=1.0, pressure=1.0), IdealGas(density=0.125, pressure=0.1)
# Where the velocity is not smooth nothing is reconstructed: the shock stays without overshoot
SHOCKS = es.Verlet(dissipation=es.Upwind(epsilon=2.0, sensor=es.DimensionlessSensor()))
END = 0.2


def build(n: int) -> es.Simulation:
    """The tube as n particles of one spacing: one body of gas in two states, its ends held."""
    x = (np.arange(n) + 0.5)[:, None] / n
    left = es.Body(x=x[: n // 2], volume=1.0 / n, material=HIGH, name="left")
    right = es.Body(x=x[n // 2 :], volume=1.0 / n, material=LOW, name="right", bonded="left")
    ends = es.Fixed(lambda X: (X[:, 0] < 6 / n) | (X[:, 0] > 1.0 - 6 / n))
    return es.Simulation([left, right], boundaries=[ends], scheme=SHOCKS)


def draw(simulation: es.Simulation, path: Path) -> None:
    """Particles over the exact solution."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    fine, tube = np.linspace(0.0, 1.0, 2001), TUBES["sod"]
    exact = solve(tube.left, tube.right, (fine - tube.wall) / simulation.t)
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.6), constrained_layout=True)
    for axis, (name, values) in zip(axes, fields(simulation).items(), strict=True):
        axis.plot(fine, exact[name], "k-", lw=0.8)
        axis.plot(simulation.x[:, 0], values, ".", ms=3)
        axis.set(title=name, xlabel="x")
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Run, print, draw; the checked figures by name."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=400, help="particles")
    parser.add_argument("--output", type=Path, default=Path("runs/shock_tube"))
    args = parser.parse_args(argv)
    simulation, writer = build(args.n), SnapshotWriter(args.output)
    simulation.run(END, every=END / 10, output=writer)
    writer.derive()
    draw(simulation, args.output / "shock_tube.png")
    band = 0.01 if args.n >= 400 else 0.025
    checked = []
    for name, error in errors(simulation, TUBES["sod"]).items():
        limit = 6.0 / args.n if "mean" in name else 1.5 if "place" in name else max(band, 0.02)
        checked.append(Figure(name.replace("_", " "), error, -limit, limit, 0.0))
    energy = simulation.energy()
    checked.append(Figure("heat / dissipation", -energy["material"] / energy["dissipation"], 0.999, 1.001, 1.0))
    print(table(checked))
    print(f"picture {args.output / 'shock_tube.png'}, snapshots {writer.series}")
    outside = [figure.name for figure in checked if not figure.accepted]
    if outside:
        raise SystemExit(f"outside the accepted band: {outside}")
    return {figure.name: figure.value for figure in checked}


if __name__ == "__main__":
    main()
