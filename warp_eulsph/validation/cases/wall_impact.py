"""An elastic bar thrown against a rigid wall: it stays for 2 L/c and leaves as it came."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...geometry import box
from ...interactions import Plane, RigidBody
from ...materials import LinearElastic
from ...scheme.arrangement import Current
from ...scheme.lax_wendroff import LaxWendroff
from ...scheme.policy import Never
from ...simulation import Body, Simulation
from ..case import Case
from ..figures import order
from ..report import Figure

SPEED, END = 0.01, 2.6  # of waves, whose speed is 1; time in lengths of the bar over that


def build(n: int, **options: Any) -> Simulation:
    """A bar of n particles, length, density and wave speed 1, at the wall."""
    x, volume = box(lower=(0.0,), upper=(1.0,), spacing=1.0 / n)
    body = Body(x=x, volume=volume, material=LinearElastic(density=1.0, young=1.0, poisson=0.0), velocity=-SPEED)
    return Simulation(body, interactions=[RigidBody(Plane((1.0,)), name="wall")], **options)


def measure(simulation: Simulation) -> dict[str, float]:
    """Contact time over 2 L/c, pressure over ρ c v; speed after, energy and the contact's account over those before."""
    wall: Any = simulation.bound_interactions[0]
    start = simulation.energy()["total"]
    rows = []
    while simulation.t < END:
        simulation.step()
        rows.append((simulation.t, -wall.force[0]))
    times, forces = np.array(rows).T
    touching, plateau = times[forces > 0.0], (times > 0.3) & (times < 1.7)
    energy = simulation.energy()
    return {
        "contact_time": (touching[-1] - touching[0]) / 2.0,
        "rebound": float(simulation.v.mean()) / SPEED,
        "energy": energy["total"] / start,
        "account": energy["interaction"] / start,
        "pressure": forces[plateau].mean() / SPEED,
        "residual": abs(energy["residual"]) / start,
    }


def run(quick: bool) -> Sequence[Figure]:
    """Bands of 2 % at 100 particles; what is lost falls as the dissipation behind a jump does, at half an order."""
    levels = (50, 100) if quick else (50, 100, 200, 400)
    figures, found = [], []
    for n in levels:
        found.append(measure(build(n)))
        figures += _judged(found[-1], f"_{n}", 0.02 * max(1.0, 100 / n))
    others: dict[str, dict[str, Any]] = {
        "_read_anew": {"arrangement": Current()},
        "_lax_wendroff": {"scheme": LaxWendroff(), "reference": Never()},
    }
    for name, options in others.items():
        figures += _judged(measure(build(100, **options)), name, 0.021)
    lost = [1.0 - each["rebound"] for each in found]
    return [*figures, Figure("order_of_rebound", order(levels, lost), low=0.4)]


def _judged(found: dict[str, float], suffix: str, band: float) -> list[Figure]:
    figures = [
        Figure(f"{name}{suffix}", found[name], 1.0 - band, 1.0 + band, 1.0) for name in ("contact_time", "energy")
    ]
    figures.append(Figure(f"rebound{suffix}", found["rebound"], 1.0 - 1.25 * band, 1.0 + band, 1.0))
    figures.append(Figure(f"pressure{suffix}", found["pressure"], 0.998, 1.002, 1.0))
    figures.append(Figure(f"account{suffix}", found["account"], -0.1 * band, 0.1 * band, 0.0))
    return [*figures, Figure(f"ledger_residual{suffix}", found["residual"], 0.0, 1e-10, 0.0)]


CASE = Case(
    name="wall_impact",
    title="Elastic bar on a rigid wall: contact time, rebound, pressure, energy",
    source="d'Alembert: contact for 2 L/c at the pressure rho c v, rebound at the speed of impact",
    run=run,
)
