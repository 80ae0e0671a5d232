"""Taylor's bar: a copper rod of 227 m/s strikes a rigid wall, 3-D, against published answers.

    python examples/taylor_bar.py            python examples/taylor_bar.py -n 6 --form anew

The rod yields at 0.4 GPa + 0.1 GPa α and mushrooms against the wall, which is a plane of symmetry. Prints length, radii
and the largest plastic strain after 80 µs, and where the energy went; draws the outline and the plastic strain
(``taylor_bar.png``). Published: length 21.4 to 21.7 mm, foot radius 6.9 to 7.25 mm, plastic strain 2.5 to 3.25.
"""

import argparse
from pathlib import Path

import numpy as np

import warp_eulsph as es
from warp_eulsph.geometry import cylinder
from warp_eulsph.materials import J2, LinearHardening
from warp_eulsph.output import SnapshotWriter
from warp_eulsph.validation import Figure, table
from warp_eulsph.validation.cases.taylor_bar import END, FORMS, measure

COPPER = J2(density=8930.0, young=117e9, poisson=0.35, hardening=LinearHardening(yield_stress=0.4e9, modulus=0.1e9))
RADIUS, LENGTH = 3.2e-3, 32.4e-3  # m


def build(n: int, arrangement: es.Current | es.Convected) -> es.Simulation:
    """The rod above the wall z = 0, n particles per radius; ghosts behind the wall, as deep as the rod is wide."""
    x, volume = cylinder((0.0, 0.0, 0.0), (0.0, 0.0, LENGTH), RADIUS, RADIUS / n)
    rod = es.Body(x=x, volume=volume, material=COPPER, velocity=[0.0, 0.0, -227.0], name="rod")
    rod, wall = es.mirror(rod, point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, -1.0), depth=2.0 * RADIUS)
    return es.Simulation(rod, boundaries=[wall], arrangement=arrangement)


def figures(found: dict[str, float]) -> list[Figure]:
    """The bands hold from 4 particles per radius on."""
    return [
        Figure("length [mm]", found["length"], 20.9, 22.2, 21.55),
        Figure("foot radius [mm]", found["foot"], 6.6, 7.8, 7.08),
        Figure("largest plastic strain", found["plastic_strain"], 1.0, 4.0, 2.9),
        *[Figure(f"radius at {h} mm [mm]", found[f"radius_at_{h}mm"]) for h in (2, 5, 10)],
        Figure("plastic work / energy", -found["material"], 0.9, 1.0),
        Figure("dissipation (M9) / energy", -found["dissipation"], 0.0, 0.09, 0.0),
        Figure("made by stepping / energy", found["stepping"], -0.005, 0.005, 0.0),
    ]


def draw(simulation: es.Simulation, path: Path) -> None:
    """The slice through the axis, coloured by plastic strain, and where the rod was."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    own = simulation.order.by_number(simulation.particles.share.numpy()) > 0.0
    x, spacing = 1e3 * simulation.x[own], 1e3 * simulation.bodies[0].spacing[0]
    shown = np.abs(simulation.X[own][:, 1]) < 1e-3 * spacing
    figure, axes = plt.subplots(figsize=(6, 7))
    axes.plot([-3.2, -3.2, 3.2, 3.2], [0.0, 32.4, 32.4, 0.0], "k:", lw=1)
    strain = simulation.history("plastic_strain")[own][shown]
    dots = axes.scatter(x[shown, 0], x[shown, 2], c=strain, s=30, cmap="inferno")
    figure.colorbar(dots, label="equivalent plastic strain")
    axes.set(aspect="equal", xlabel="x [mm]", ylabel="z [mm]", title=f"{1e6 * simulation.t:g} µs")
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Run, print, draw; the checked figures by name."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=5, help="particles per radius")
    parser.add_argument("--form", choices=FORMS, default="kept", help="neighbours")
    parser.add_argument("--output", type=Path, default=Path("runs/taylor_bar"))
    args = parser.parse_args(argv)
    simulation, writer = build(args.n, FORMS[args.form]), SnapshotWriter(args.output)
    simulation.run(END, every=10e-6, output=writer)
    writer.derive()
    draw(simulation, args.output / "taylor_bar.png")
    checked = figures(measure(simulation, args.n))
    print(table(checked))
    print(f"picture {args.output / 'taylor_bar.png'}, snapshots {writer.series}")
    outside = [figure.name for figure in checked if not figure.accepted]
    if outside:
        raise SystemExit(f"outside the accepted band: {outside}")
    return {figure.name: figure.value for figure in checked}


if __name__ == "__main__":
    main()
