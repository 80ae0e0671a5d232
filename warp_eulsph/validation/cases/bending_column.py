"""Bending rubber column, 2-D or 3-D: 1 m wide, 6 m high, clamped base, set off sideways at 10 y/6 m/s."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...boundaries import Clamped
from ...geometry import box
from ...materials import NeoHookean
from ...scheme.arrangement import Convected, Current
from ...scheme.policy import Always, ReferencePolicy
from ...scheme.verlet import Verlet
from ...simulation import Body, Simulation
from ..case import Case
from ..figures import difference, energy_figures
from ..history import History, at, record, series
from ..report import Figure
from ..solids import RUBBER, MaterialPoint

HEIGHT = 6.0
FRAME = 2.5e-3  # s
FIRST_SWING, THREE_SWINGS = 0.55, 2.6  # s; soft columns swing slower than the reference, whose third turn is at 2.26
SERIES = "bendY_2"


def build(dim: int, n: int, reference: ReferencePolicy, **options: Any) -> Simulation:
    """The column, n particles across, clamped at its base. In 2-D Poisson's ratio is 0.3."""
    x, volume = box((-0.5, 0.0, -0.5)[:dim], (0.5, HEIGHT, 0.5)[:dim], 1.0 / n)
    velocity = np.zeros_like(x)
    velocity[:, 0] = 10.0 * x[:, 1] / HEIGHT
    material = RUBBER if dim == 3 else NeoHookean(density=RUBBER.density, young=RUBBER.young, poisson=0.3)
    body = Body(x=x, volume=volume, material=material, velocity=velocity)
    base = Clamped(point=(0.0,) * dim, normal=(0.0, -1.0, 0.0)[:dim])
    return Simulation(body, boundaries=[base], reference=reference, **options)


def measure(simulation: Simulation, until: float, writer: Any = None) -> History:
    """Sideways displacement of the centre of the tip [m], and energy [J]."""
    centre = np.zeros(simulation.space.dim)
    centre[1] = HEIGHT
    tip = MaterialPoint(simulation, centre)

    def observe() -> dict[str, float]:
        return {"tip": float(tip.x[0]), "energy": simulation.energy()["total"]}

    return record(simulation, np.arange(round(until / FRAME) + 1) * FRAME, observe, writer=writer, stride=20)


def extrema(t: np.ndarray, tip: np.ndarray) -> list[tuple[float, float]]:
    """(time [s], displacement [m]) of the first three turning points of the swing, alternately to either side.

    A turning point is the largest displacement between two passages through zero.
    """
    passages = np.flatnonzero(tip[1:] * tip[:-1] < 0.0) + 1
    parts = np.split(np.arange(len(t)), passages)[:3]
    tops = [part[np.abs(tip[part]).argmax()] for part in parts]
    return [(float(t[top]), float(tip[top])) for top in tops]


def run(quick: bool) -> Sequence[Figure]:
    """At 12 across three extrema within 1.5 % in value and time; at 5 across the first within 2 %.

    The layer that is held lies within the column, whose upper half of a layer it stiffens.

    Quick is the first swing only: three take minutes.
    """
    n, band, until = (5, 0.02, FIRST_SWING) if quick else (12, 0.015, THREE_SWINGS)
    simulation = build(3, n, Always())
    history = measure(simulation, until)
    reference = series(SERIES)
    shown = reference["t"] < until
    found = extrema(history["t"], history["tip"])
    figures = []
    for k, (t, value) in enumerate(extrema(reference["t"][shown], reference["utx"][shown])):
        time_found, value_found = found[k] if k < len(found) else (np.nan, np.nan)
        figures.append(Figure(f"swing_{k + 1}_value_error", value_found / value - 1.0, -band, band, 0.0))
        figures.append(Figure(f"swing_{k + 1}_time_error", time_found / t - 1.0, -band, band, 0.0))
    # The two arrangements beside each other on the first swing of the plane column, which is cheap. Without
    # tilt and sharpening, which the current one does not have.
    plane, current = (
        measure(build(2, 8, Always(), arrangement=form, scheme=Verlet(tilt=None, sharpening=None)), FIRST_SWING)["tip"]
        for form in (Convected(), Current())
    )
    return [
        *figures,
        Figure("tip_history_error", difference(history["tip"], at(reference, "utx", history["t"])), reference=0.0),
        Figure("plane_current_arrangement_difference", difference(current, plane), 0.0, 0.01, 0.0),
        *energy_figures(history, simulation.energy()["residual"]),
    ]


CASE = Case(
    name="bending_column",
    title="Bending rubber column, 3-D, over three swings: extrema of the tip",
    source="independent total Lagrangian spectral-element solution (bendY_2.csv)",
    run=run,
)
