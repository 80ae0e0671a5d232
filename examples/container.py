"""A steel container filled with water hits a rigid wall, yields and bursts: the case that the paper begins with.

    python examples/container.py --speed 300            python examples/container.py --speed 200 -n 40 --film
    python examples/container.py -d 3                   in 3-D: minutes

A box of 0.2 m, its walls 20 mm thick, flies at 100, 200 or 300 m/s flat against a wall; the steel yields at 350 MPa,
tears at a plastic strain of 0.2, and water (Tait's law, no tension) leaves by openings. Prints what the wall took
of the momentum, beside what the bodies lost, and the books; draws it at four times (``container.png``), and with
``--film`` all the way (``container.gif``).
"""

import argparse
from pathlib import Path

import numpy as np

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.interactions import Plane, RigidBody
from warp_eulsph.materials import J2, Failing, LinearHardening, PlasticStrain
from warp_eulsph.output import SnapshotWriter
from warp_eulsph.validation import Figure, table
from warp_eulsph.validation.cases.container import follow, measure

SIDE, WALL = 0.2, 0.02  # m
STEEL = Failing(
    material=J2(density=7850.0, young=206e9, poisson=0.3, hardening=LinearHardening(yield_stress=350e6, modulus=1e9)),
    failure=PlasticStrain(energy=2e5, strain=0.2),
)
WATER = es.TaitLiquid(density=1000.0, sound_speed=1480.0, cavitation=0.0)
# Not the options of liquids at rest: walls of two particles are thinner than the reach of their weight.
SHORT = {"scheme": es.Verlet(dissipation=es.Upwind(volume=True)), "weight": es.CubicSpline(), "dilation": 1.3}
FRAMES = 40


def build(n: int, speed: float, dim: int = 2) -> es.Simulation:
    """The container at the wall x = 0, n particles along a side: its own walls are n/10 thick, at least two."""
    half = [SIDE / 2] * (dim - 1)
    x, volume = box(lower=(0.0, *[-h for h in half]), upper=(SIDE, *half), spacing=SIDE / n)
    inside = (np.abs(x - np.array([SIDE / 2, *[0.0] * (dim - 1)])) < SIDE / 2 - WALL).all(axis=1)
    velocity = (-speed, *[0.0] * (dim - 1))
    steel = es.Body(x=x[~inside], volume=volume, material=STEEL, velocity=velocity, name="container")
    water = es.Body(x=x[inside], volume=volume, material=WATER, velocity=velocity, name="water", **SHORT)
    wall = RigidBody(Plane((1.0, *[0.0] * (dim - 1))), name="wall")
    return es.Simulation([steel, water], interactions=[wall, es.Contact()])


def figures(found: dict[str, float]) -> list[Figure]:
    """Momentum to round-off; the contact's account, the error of its steps and of surfaces that tear."""
    return [
        Figure("momentum that the wall took / start", found["momentum"], 0.7, 1.2),
        Figure("momentum that is missing / start", found["missing"], 0.0, 1e-12, 0.0),
        Figure("plastic work and damage / energy", found["plastic"], 0.0, 1.0),
        Figure("dissipation (M9) / energy", found["dissipation"], 0.0, 0.4),
        Figure("account of the contacts / energy", found["account"], -0.06, 0.01, 0.0),
        Figure("ledger residual / energy", found["residual"], 0.0, 1e-12, 0.0),
        Figure("steel that has failed", found["failed"], 0.01, 1.0),
    ]


class Film:
    """Where all was at every look; in 3-D of the middle slice."""

    def __init__(self, simulation: es.Simulation):
        self.simulation, self.looks = simulation, []
        X = simulation.X
        spacing = float(simulation.bodies[0].spacing[0])
        self.shown = np.ones(len(X), dtype=bool) if X.shape[1] == 2 else np.abs(X[:, 2]) < 0.6 * spacing
        self.steel = np.arange(len(X)) < simulation.ranges["container"].stop
        self.size = 300.0 * spacing / SIDE
        self.look()

    def look(self) -> None:
        s = self.simulation
        self.looks.append((s.t, s.x, s.history("plastic_strain"), s.history("damage") == 1.0))

    def show(self, axes, k: int):
        """One look: water in blue, steel by its plastic strain, what has failed of it in red."""
        time, x, strain, failed = self.looks[k]
        water, whole, pieces = (self.shown & chosen for chosen in (~self.steel, self.steel & ~failed, failed))
        axes.clear()
        axes.scatter(x[water, 0], x[water, 1], s=self.size**2 / 16, c="tab:blue", lw=0)
        dots = axes.scatter(
            x[whole, 0], x[whole, 1], s=self.size**2 / 16, c=strain[whole], vmin=0.0, vmax=0.2, cmap="copper", lw=0
        )
        axes.scatter(x[pieces, 0], x[pieces, 1], s=self.size**2 / 16, c="tab:red", lw=0)
        axes.axvspan(-0.02, 0.0, color="0.6")
        axes.set(xlim=(-0.02, 0.22), ylim=(-0.25, 0.25), aspect="equal", title=f"{1e3 * time:.2f} ms", xlabel="x [m]")
        return dots

    def draw(self, rows: np.ndarray, momentum: float, path: Path) -> None:
        """Four moments, and the momentum that the wall took."""
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(1, 5, figsize=(15, 5), layout="constrained", width_ratios=(2, 2, 2, 2, 3))
        for axis, share in zip(axes[:4], (0.1, 0.3, 0.6, 1.0), strict=True):
            dots = self.show(axis, round(share * (len(self.looks) - 1)))
        figure.colorbar(dots, ax=axes[3], label="plastic strain of the steel; red: failed")
        axes[4].plot(1e3 * rows[:, 0], rows[:, 1] / abs(momentum))
        axes[4].set(xlabel="t [ms]", title="momentum that the wall took / start", ylim=(0.0, None))
        figure.savefig(path, dpi=100)
        plt.close(figure)

    def save(self, path: Path) -> None:
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt
        from matplotlib.animation import FuncAnimation, PillowWriter

        figure, axes = plt.subplots(figsize=(4, 6.5), layout="constrained")
        animation = FuncAnimation(figure, lambda k: self.show(axes, k), frames=len(self.looks), init_func=lambda: None)
        animation.save(path, writer=PillowWriter(fps=12))
        plt.close(figure)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Run, print, draw; the checked figures by name."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=20, help="particles along a side of the container; 20, 30, ...")
    parser.add_argument("--speed", type=float, default=200.0, help="[m/s]")
    parser.add_argument("-d", type=int, choices=(2, 3), default=2, help="dimension")
    parser.add_argument("--film", action="store_true", help="draw a film, too")
    parser.add_argument("--output", type=Path, default=Path("runs/container"))
    args = parser.parse_args(argv)
    simulation, writer = build(args.n, args.speed, args.d), SnapshotWriter(args.output)
    seen, start, momentum = Film(simulation), simulation.energy(), float(simulation.momentum()[0])

    def look() -> None:
        seen.look()
        if len(seen.looks) % 4 == 1:
            writer.write(simulation)

    rows = follow(simulation, np.linspace(0.0, SIDE / args.speed, FRAMES + 1)[1:], look)
    writer.finish()
    seen.draw(rows, momentum, args.output / "container.png")
    if args.film:
        seen.save(args.output / "container.gif")
    checked = figures(measure(simulation, start, momentum, float(rows[-1, 1])))
    print(table(checked))
    print(f"picture {args.output / 'container.png'}, snapshots {writer.series}")
    outside = [figure.name for figure in checked if not figure.accepted]
    if outside:
        raise SystemExit(f"outside the accepted band: {outside}")
    return {figure.name: figure.value for figure in checked}


if __name__ == "__main__":
    main()
