"""Two elastic bars that meet end to end, of equal and of unequal impedance: contact against the exact solution."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...interactions import Contact
from ...materials import NeoHookean
from ...scheme.arrangement import Arrangement, Convected, Current
from ...simulation import Body, Simulation
from ..case import Case
from ..figures import order, rms
from ..history import History, record
from ..report import Figure

# In units of the first bar: its length, density and wave speed are 1. Speeds are far below that of waves, so that the
# bars are linear; both take the same time from end to end, so that they part for good when the first waves are back.
SPEED = 0.01
CONTACT = 2.0  # [length/wave speed]
END, FRAMES = 2.4, 240


def exact(ratio: float, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean velocities of both bars over ``SPEED``; the second, at rest first, has ``ratio`` times impedance and mass.

    The stress at the contact is constant, Z1 Z2/(Z1 + Z2) times the speed, until the waves are back from the free ends;
    then the first bar moves at (1 − ratio)/(1 + ratio), the second at 2/(1 + ratio).
    """
    push = ratio / (1.0 + ratio) * np.clip(t, 0.0, CONTACT)
    return 1.0 - push, push / ratio


def build(n: int, ratio: float = 1.0, arrangement: Arrangement = Convected(), **options: Any) -> Simulation:
    """Bars of n particles each, faces together, without Poisson's effect; the left one at ``SPEED``.

    The second one is ``ratio`` times as heavy and as slow, and as much shorter, so that its impedance is ``ratio``.
    """
    x, length = (np.arange(n)[:, None] + 0.5) / n, 1.0 / ratio
    left = NeoHookean(density=1.0, young=1.0, poisson=0.0)
    right = NeoHookean(density=ratio**2, young=1.0, poisson=0.0)
    bodies = [
        Body(x=x, volume=1.0 / n, material=left, velocity=SPEED, name="left"),
        Body(x=1.0 + x * length, volume=length / n, material=right, name="right"),
    ]
    return Simulation(bodies, interactions=[Contact()], arrangement=arrangement, **options)


def measure(simulation: Simulation, writer: Any = None) -> History:
    """Over the collision: mean velocities over ``SPEED``, force over its exact value, the contact's energies [J]."""
    n = len(simulation.bodies[0].x)
    ratio = simulation.bodies[1].material.density ** 0.5

    def observe() -> dict[str, float]:
        v, energy, exactly = simulation.v[:, 0] / SPEED, simulation.energy(), exact(ratio, np.array(simulation.t))
        force = simulation.interaction_force[n:, 0].sum() / (SPEED * ratio / (1.0 + ratio))
        return {
            "left": v[:n].mean(),
            "right": v[n:].mean(),
            "left_exact": float(exactly[0]),
            "right_exact": float(exactly[1]),
            "force": force,
            "held": energy["held"],
            "contact": energy["interaction"],
            "energy": energy["total"],
            "momentum": float(simulation.momentum()[0]),
        }

    return record(simulation, np.linspace(0.0, END, FRAMES + 1), observe, writer=writer, stride=20)


def errors(history: History) -> dict[str, float]:
    """Of the velocities at the end and on the way, and of the time of contact; what the contact lost of the energy."""
    apart = [history[name] - history[f"{name}_exact"] for name in ("left", "right")]
    touching = history["held"] > 0.0
    return {
        "velocity": max(abs(values[-1]) for values in apart),
        "rms": max(rms(values) for values in apart),
        "time": history["t"][touching].max() / CONTACT - 1.0 if touching.any() else -1.0,
        "force": history["force"][(history["t"] > 0.5) & (history["t"] < 1.5)].mean() - 1.0,
        "contact": history["contact"][-1] / history["energy"][0],
        "momentum": np.abs(history["momentum"] / history["momentum"][0] - 1.0).max(),
    }


def run(quick: bool) -> Sequence[Figure]:
    """Equal and unequal bars at several resolutions, and the equal ones read anew in every step."""
    levels = (50, 100) if quick else (100, 200, 400)
    figures = []
    for ratio in (1.0, 2.0):
        found = [errors(measure(build(n, ratio))) for n in levels]
        for n, each in zip(levels, found, strict=True):
            end = f"_{ratio:g}_{n}"
            figures += [
                Figure(f"velocities{end}", each["velocity"], 0.0, 0.02 * max(1.0, 100 / n), 0.0),
                Figure(f"time_of_contact{end}", each["time"], -0.01, 0.02 * max(1.0, 100 / n), 0.0),
                Figure(f"force{end}", each["force"], -0.005, 0.005, 0.0),
                Figure(f"account_of_contact{end}", each["contact"], -0.2 / n, 0.0, 0.0),
                Figure(f"momentum{end}", each["momentum"], 0.0, 1e-12, 0.0),
            ]
        figures.append(Figure(f"order_{ratio:g}", order(levels, [each["velocity"] for each in found]), 0.5, 1.2))
    current = errors(measure(build(levels[0], 1.0, Current())))
    figures.append(Figure("current_velocities", current["velocity"], 0.0, 0.02 * max(1.0, 100 / levels[0]), 0.0))
    return figures


CASE = Case(
    name="colliding_bars",
    title="Two bars that meet end to end: velocities, time and force of contact, its account, momentum",
    source="d'Alembert's exact solution: constant force until the waves are back from the free ends",
    run=run,
)
