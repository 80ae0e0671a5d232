"""Liquid jet on a flat wall: force on the wall, and the sheets that run along it, by default options.

A plane jet of width b and speed U strikes a rigid, frictionless wall at right angles and parts into two sheets.
Pressure at its free surface is nil, so that far from the stagnation point each sheet has the speed U (Bernoulli) and
half of the jet's width, and the wall takes all of its momentum: the force is ρ U² b per depth (Batchelor, An
Introduction to Fluid Dynamics, 1967, §6.3). Here b = U = ρ = 1, c0 = 20 U, and the jet is 8 b long. The force is its
impulse over the time from 2 to 6 b/U, after the front has spread and before the end arrives; sheets are looked at
2.5 b from the middle.
"""

from collections.abc import Sequence

import numpy as np

from ... import Body, Simulation, TaitLiquid
from ...geometry import box
from ...interactions import Plane, RigidBody
from ..case import Case
from ..report import Figure

LENGTH, SOUND = 8.0, 20.0  # over the width; over the speed
FROM, TO = 2.0, 6.0  # in widths over the speed
AWAY, LONG = 2.5, 0.5  # where the sheets are looked at, and how much of them, in widths


def build(n: int) -> Simulation:
    """The jet, n particles across, at the wall x = 0."""
    x, volume = box((0.0, -0.5), (LENGTH, 0.5), 1.0 / n)
    water = TaitLiquid(density=1.0, sound_speed=SOUND, cavitation=0.0)
    jet = Body(x=x, volume=volume, material=water, velocity=(-1.0, 0.0), spacing=1.0 / n)
    return Simulation(jet, interactions=[RigidBody(Plane(normal=(1.0, 0.0)), name="wall")])


def measure(n: int) -> dict[str, float]:
    """Mean force, thickness and speed of the sheets at ``TO``, the least distance from the wall [spacings], books."""
    simulation = build(n)
    wall = simulation.bound_interactions[0]
    given, begun = 0.0, (0.0, 0.0)
    while simulation.t < TO:
        simulation.advance(TO, 1)
        given -= simulation.dt * float(wall.force[0])  # type: ignore[attr-defined]
        if simulation.t <= FROM:
            begun = (simulation.t, given)
    x, v, energy = simulation.x, simulation.v, simulation.energy()
    sheet = (np.abs(np.abs(x[:, 1]) - AWAY) < LONG / 2.0) & (x[:, 0] < 1.0)
    return {
        "force": (given - begun[1]) / (simulation.t - begun[0]),
        "thickness": float(sheet.sum()) / n**2 / (2.0 * LONG),
        "speed": float(np.abs(v[sheet, 1]).mean()),
        "deepest": float(x[:, 0].min()) * n,
        "energy": energy["total"] / (0.5 * LENGTH),
        "residual": abs(energy["residual"]) / energy["total"],
    }


def run(quick: bool) -> Sequence[Figure]:
    """Force within 4 %, sheets within 8 % in width and 2 % in speed; none a tenth of a spacing inside the wall."""
    figures = []
    for n in (10,) if quick else (10, 20):
        found = measure(n)
        figures += [
            Figure(f"force_{n}", found["force"], 0.96, 1.04, 1.0),
            Figure(f"thickness_of_sheets_{n}", found["thickness"], 0.46, 0.54, 0.5),
            Figure(f"speed_of_sheets_{n}", found["speed"], 0.98, 1.02, 1.0),
            Figure(f"nearest_to_the_wall_{n}", found["deepest"], -0.1, 1.0),
            Figure(f"energy_kept_{n}", found["energy"], 0.9, 1.0, 1.0),
            Figure(f"ledger_residual_{n}", found["residual"], 0.0, 1e-12, 0.0),
        ]
    return figures


CASE = Case(
    name="jet",
    title="Liquid jet on a flat wall: force, and the sheets along it",
    source="momentum and Bernoulli's theorem (Batchelor 1967, section 6.3)",
    run=run,
)
