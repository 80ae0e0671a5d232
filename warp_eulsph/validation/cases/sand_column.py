"""Sand column: a column of dry sand, as high as it is wide, is let go and slumps on a bed of the same sand.

Plane strain, its back a smooth wall. Measured columns of several grains, all with angles of repose near 30°, run out by
1.2 of their width at this aspect ratio and keep their height at the wall (Lube, Huppert, Sparks & Freundt, Phys. Rev. E
72, 041301, 2005). The cone is that of 30° in plane strain, sin φ = 3 sin 30°/(2√3 + sin 30°). Neighbours are read anew.
"""

from collections.abc import Sequence

import numpy as np

from ...boundaries import Fixed, Gravity
from ...geometry import box
from ...materials import DruckerPrager
from ...scheme.arrangement import Current
from ...simulation import Body, Simulation
from ..case import Case
from ..report import Figure

RUNOUT, END = 1.2, 1.4  # of the width, 1 m; s, when the slump is at rest
FRICTION = float(np.degrees(np.arcsin(1.5 / (2.0 * np.sqrt(3.0) + 0.5))))
SAND = DruckerPrager(density=1800.0, young=2e6, poisson=0.25, friction=FRICTION)


def build(n: int) -> Simulation:
    """n × n particles on a bed three deep that does not move."""
    dx = 1.0 / n
    column, _ = box((0.0, -3.0 * dx), (1.0, 1.0), dx)
    bed, _ = box((1.0, -3.0 * dx), (3.0, 0.0), dx)
    x = np.concatenate([column, bed])
    sand = Body(x=x, volume=np.full(len(x), dx**2), material=SAND, name="sand")
    held = [Fixed(lambda X: X[:, 1] < 0.0), Fixed(lambda X: X[:, 0] < dx, axes=(0,))]
    return Simulation(sand, boundaries=[*held, Gravity(9.81)], arrangement=Current())


def run(quick: bool) -> Sequence[Figure]:
    """Run-out within 25 %, as measured ones scatter with how the front is read; height within 20 %; at rest."""
    figures = []
    for n in (16,) if quick else (16, 24, 32):
        simulation = build(n)
        simulation.run(END)
        loose = simulation.X[:, 1] > 0.0
        x, energy, half = simulation.x[loose], simulation.energy(), 0.5 / n
        front = float(x[x[:, 1] < 3.0 / n, 0].max()) + half
        fallen = -energy["material"]
        figures += [
            Figure(f"{n}_runout", front - 1.0, 0.75 * RUNOUT, 1.25 * RUNOUT, RUNOUT),
            Figure(f"{n}_height_at_the_wall", float(x[:, 1].max()) + half, 0.8, 1.0 + half, 1.0),
            Figure(f"{n}_kinetic_over_plastic_work", energy["kinetic"] / fallen, 0.0, 0.01, 0.0),
            Figure(f"{n}_ledger_residual", abs(energy["residual"]) / fallen, 0.0, 1e-10, 0.0),
            Figure(f"{n}_largest_plastic_strain", float(simulation.history("plastic_strain").max())),
        ]
    return figures


CASE = Case(
    name="sand_column",
    title="Column of dry sand let go: run-out and height",
    source="measured columns (Lube, Huppert, Sparks & Freundt 2005)",
    run=run,
)
