"""Water that rests on an elastic plate between two walls: deflection, force and pressure are those of statics."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from ...boundaries import BodyForce, Clamped, Damping, Fixed
from ...geometry import box
from ...interactions import Contact, Plane, RigidBody
from ...materials import NeoHookean, TaitLiquid
from ...scheme.dissipation import Upwind
from ...scheme.uncorrected import Uncorrected
from ...scheme.verlet import Verlet
from ...simulation import Body, Simulation
from ...weights import CubicSpline
from ..case import Case
from ..report import Figure

WEIGHT, RAMP, END = 9.81, 0.15, 0.4  # m/s², s
LENGTH, THICK, DEEP = 1.0, 0.1, 0.5  # m
DENSITY, YOUNG, POISSON = 2700.0, 1.6e8, 0.3
LEDGE = 4  # columns that are held beside the plate, on which the water's corners lie


@wp.func
def filling_up(x: wp.vec2d, t: wp.float64) -> wp.vec2d:
    s = wp.min(t / wp.float64(RAMP), wp.float64(1.0))
    return wp.vec2d(wp.float64(0.0), -wp.float64(WEIGHT) * s * s * (wp.float64(3.0) - wp.float64(2.0) * s))


def deflection(load: float) -> float:
    """In the middle of a clamped plate in plane strain under ``load`` [Pa], bent and sheared (Timoshenko) [m]."""
    bending = YOUNG * THICK**3 / 12.0 / (1.0 - POISSON**2)
    shear = 5.0 / 6.0 * YOUNG / (2.0 + 2.0 * POISSON) * THICK
    return load * LENGTH**4 / (384.0 * bending) + load * LENGTH**2 / (8.0 * shear)


# The plate is thinner than the reach of the weight that liquids take by default.
SHORT: dict[str, Any] = {
    "scheme": Verlet(dissipation=Upwind(volume=True), correction=Uncorrected()),
    "weight": CubicSpline(),
    "dilation": 1.3,
}


def build(across: int, wet: bool) -> Simulation:
    """The plate, ``across`` particles thick, with water on it or without."""
    dx = THICK / across
    x, volume = box((0.0, -THICK), (LENGTH, 0.0), dx)
    metal = NeoHookean(density=DENSITY, young=YOUNG, poisson=POISSON)
    bodies = [Body(x=x, volume=volume, material=metal, spacing=dx, name="plate")]
    ends = [Clamped(point=(end, 0.0), normal=(2.0 * end - 1.0, 0.0), body="plate") for end in (0.0, LENGTH)]
    conditions: list[Any] = [BodyForce(filling_up), Damping(40.0), *ends]
    interactions: list[Any] = []
    if wet:
        x, volume = box((0.0, 0.0), (LENGTH, DEEP), dx)
        water = TaitLiquid(density=1e3, sound_speed=30.0)
        bodies.append(Body(x=x, volume=volume, material=water, spacing=dx, name="water"))
        far = LEDGE * dx
        sides = [box((-far, -far), (0.0, 0.0), dx)[0], box((LENGTH, -far), (LENGTH + far, 0.0), dx)[0]]
        ledge = Body(x=np.concatenate(sides), volume=dx * dx, material=metal, spacing=dx, name="ledge")
        bodies.append(ledge)
        conditions.append(Fixed(body="ledge"))
        interactions = [Contact(between=[("water", "plate"), ("water", "ledge")])]
        for n in (1.0, -1.0):
            centre = (0.5 * (1.0 - n) * LENGTH, 0.0)
            interactions.append(
                RigidBody(Plane(normal=(n, 0.0)), centre=centre, bodies=["water"], name=f"wall {n:.0f}")
            )
    return Simulation(bodies, boundaries=conditions, interactions=interactions, **SHORT)


def measure(across: int, wet: bool) -> dict[str, float]:
    """Deflection over that of theory; with water its force on the plate over its weight, and the error of pressure."""
    simulation = build(across, wet)
    simulation.run(END)
    dx, size = THICK / across, across * round(across * LENGTH / THICK)
    plate = simulation.X[:size]
    middle = np.abs(plate[:, 0] - 0.5 * LENGTH) < dx
    sunk = (plate[middle, 1] - simulation.x[:size][middle, 1]).mean()
    load = (DENSITY * THICK + (1e3 * DEEP if wet else 0.0)) * WEIGHT
    found = {"deflection": float(sunk) / deflection(load)}
    if wet:
        own = slice(size, size + round(LENGTH * DEEP / dx**2))
        y, p = simulation.x[own, 1], -simulation.cauchy_stress[own, 0, 0] / (1e3 * WEIGHT * DEEP)
        error = p - (y.max() + 0.5 * dx - y) / DEEP
        energy = simulation.energy()
        found |= {
            "force": -float(simulation.interaction_force[:size, 1].sum()) / (1e3 * DEEP * LENGTH * WEIGHT),
            "pressure": float(np.sqrt(np.mean(error**2))),
            "account": energy["interaction"] / energy["total"],
            "residual": abs(energy["residual"]) / energy["total"],
        }
    return found


def run(quick: bool) -> Sequence[Figure]:
    """The plate is soft where it is coarse; what the water adds is seen beside the same plate under its own weight."""
    across = 4 if quick else 6
    dry, wet = measure(across, False), measure(across, True)
    band = 0.06 if quick else 0.03
    return [
        Figure("deflection_dry", dry["deflection"], 1.0 - band, 1.0 + band, 1.0),
        Figure("deflection", wet["deflection"], 1.0 - band, 1.0 + band, 1.0),
        Figure("deflection_over_dry", wet["deflection"] / dry["deflection"], 0.99, 1.01, 1.0),
        Figure("force_on_plate", wet["force"], 0.98, 1.01, 1.0),
        Figure("pressure_rms", wet["pressure"], 0.0, 0.01, 0.0),
        Figure("account_of_contact", wet["account"], -1e-12, 1e-12, 0.0),
        Figure("ledger_residual", wet["residual"], 0.0, 1e-10, 0.0),
    ]


CASE = Case(
    name="water_on_plate",
    title="Water at rest on a clamped elastic plate: deflection, force, pressure",
    source="Timoshenko's plate in plane strain under rho g H; a soft and thick form of Fourey et al. (2017)",
    run=run,
)
