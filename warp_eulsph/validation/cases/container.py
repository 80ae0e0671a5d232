"""A steel container filled with water hits a rigid wall, yields and bursts: momentum, books, and convergence."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...geometry import box
from ...interactions import Contact, Plane, RigidBody
from ...materials import J2, Failing, LinearHardening, PlasticStrain, TaitLiquid
from ...scheme.dissipation import Upwind
from ...scheme.verlet import Verlet
from ...simulation import Body, Simulation
from ...weights import CubicSpline
from ..case import Case
from ..report import Figure

SIDE, WALL = 0.2, 0.02  # of the container, and how thick it is [m]
STEEL = Failing(
    material=J2(
        density=7850.0,
        young=206e9,
        poisson=0.3,
        hardening=LinearHardening(yield_stress=350e6, modulus=1e9),
    ),
    failure=PlasticStrain(energy=2e5, strain=0.2),
)
WATER = TaitLiquid(density=1000.0, sound_speed=1480.0, cavitation=0.0)
# Not the options of liquids at rest: walls of two particles are thinner than the reach of their weight.
SHORT: dict[str, Any] = {
    "scheme": Verlet(dissipation=Upwind(volume=True)),
    "weight": CubicSpline(),
    "dilation": 1.3,
}
SPEEDS = (100.0, 200.0, 300.0)  # m/s


def build(n: int, speed: float, dim: int = 2) -> Simulation:
    """The container at the wall x = 0, n particles along a side."""
    x, volume = box(lower=(0.0, *[-SIDE / 2] * (dim - 1)), upper=(SIDE, *[SIDE / 2] * (dim - 1)), spacing=SIDE / n)
    inside = (np.abs(x - np.array([SIDE / 2, *[0.0] * (dim - 1)])) < SIDE / 2 - WALL).all(axis=1)
    velocity = (-speed, *[0.0] * (dim - 1))
    steel = Body(x=x[~inside], volume=volume, material=STEEL, velocity=velocity, name="container")
    water = Body(x=x[inside], volume=volume, material=WATER, velocity=velocity, name="water", **SHORT)
    wall = RigidBody(Plane((1.0, *[0.0] * (dim - 1))), name="wall")
    return Simulation([steel, water], interactions=[wall, Contact()])


def follow(simulation: Simulation, times: Sequence[float], look: Callable[[], None] | None = None) -> np.ndarray:
    """Run to the times [s]; (steps, 2): time [s] and what the bodies gave the wall until then [N s], (per m in 2-D)."""
    wall: Any = simulation.bound_interactions[0]
    given, rows = 0.0, [(0.0, 0.0)]
    for time in times:
        while simulation.t < time:
            simulation.advance(time, 1)
            given -= simulation.dt * float(wall.force[0])
            rows.append((simulation.t, given))
        if look is not None:
            look()
    return np.array(rows)


def measure(simulation: Simulation, start: dict[str, float], momentum: float, given: float) -> dict[str, float]:
    """Accounts over the energy of the start, momenta over that of the start; what has failed, what yields."""
    energy, steel = simulation.energy(), simulation.ranges["container"]
    failed = simulation.history("damage")[steel.start : steel.stop] == 1.0
    total = start["total"]
    return {
        "momentum": given / -momentum,
        "missing": abs(simulation.momentum()[0] - momentum - given) / abs(momentum),
        "account": energy["interaction"] / total,
        "stepping": energy["stepping"] / total,
        "plastic": -energy["material"] / total,
        "dissipation": -energy["dissipation"] / total,
        "residual": abs(energy["residual"]) / total,
        "failed": float(failed.mean()),
    }


def found_at(n: int, speed: float, dim: int = 2) -> dict[str, float]:
    """All of it after the way of a side."""
    simulation = build(n, speed, dim)
    start, momentum = simulation.energy(), float(simulation.momentum()[0])
    rows = follow(simulation, [SIDE / speed])
    return measure(simulation, start, momentum, float(rows[-1, 1]))


def run(quick: bool) -> Sequence[Figure]:
    """Contact books within 6 % of the energy; what the wall took changes by less than 5 % from the last but one."""
    figures, levels = [], (20,) if quick else (20, 40, 80)
    for speed in SPEEDS:
        taken = []
        for n in levels:
            found = found_at(n, speed)
            taken.append(found["momentum"])
            who = f"_{speed:g}_{n}"
            figures += [
                Figure(f"momentum{who}", found["momentum"], 0.8, 1.1),
                Figure(f"missing{who}", found["missing"], 0.0, 1e-12, 0.0),
                Figure(f"account{who}", found["account"], -0.06, 0.005, 0.0),
                Figure(f"failed{who}", found["failed"], 0.05, 0.9),
                Figure(f"ledger_residual{who}", found["residual"], 0.0, 1e-12, 0.0),
            ]
        if len(taken) > 1:
            figures.append(Figure(f"change_{speed:g}", taken[-1] / taken[-2] - 1.0, -0.05, 0.05, 0.0))
    return figures


CASE = Case(
    name="container",
    title="Steel container filled with water bursts at a rigid wall: momentum, books, convergence",
    source="the example that the paper begins with (section 1); momentum and energy are exact, the rest converges",
    run=run,
)
