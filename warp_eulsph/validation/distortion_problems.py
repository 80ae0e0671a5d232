"""Problems of the map of distortion: what grows in them, how they start, and what they are measured against."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import ReferencePolicy, Simulation
from .cases import bending_column, extension, punch, shear, spinning_plate, twisting_column, vortex
from .figures import rms
from .history import at, series
from .solids import MaterialPoint


@dataclass(frozen=True)
class Run:
    """A simulation and how it is judged: ``error()`` [-] is asked at every frame, None where there is no reference."""

    simulation: Simulation
    error: Callable[[], float | None]


@dataclass(frozen=True)
class Problem:
    """A problem with a growing distortion.

    Args:
        name: of the problem.
        distortion: what grows, with its unit.
        error: what the error is.
        levels: resolutions, coarse first.
        marks: distortion -> time [s] at which it is reached.
        frame: time between two looks [s].
        start: (level, reference, options of the simulation) -> Run.
    """

    name: str
    distortion: str
    error: str
    levels: Sequence[int]
    marks: dict[float, float]
    frame: float
    start: Callable[..., Run]


AMPLITUDE = 0.5


def start_vortex(rings: int, reference: ReferencePolicy, **options: Any) -> Run:
    """The vortex at half its full amplitude: a shear of 11 at t = ½ s."""
    simulation = vortex.build(rings, reference, AMPLITUDE, **options)
    X, volume = simulation.bodies[0].x, simulation.bodies[0].volume

    def error() -> float:
        F = vortex.exact(X, simulation.t, AMPLITUDE)[2]
        wrong, right = (volume @ np.square(G).sum(axis=(1, 2)) for G in (simulation.F - F, F - np.eye(2)))
        return math.sqrt(wrong / right)

    return Run(simulation, error)


def start_shear(n: int, reference: ReferencePolicy, **options: Any) -> Run:
    """The block in simple shear."""
    simulation, upper = shear.build(n, reference, **options)

    def error() -> float:
        now = shear.errors(simulation, upper)
        return max(now["F"], now["stress"])

    return Run(simulation, error)


def start_extension(n: int, reference: ReferencePolicy, **options: Any) -> Run:
    """The jittered block pulled by its ends, slowly."""
    simulation, pulled = extension.build(2, n, reference, 0.1, **options)

    def error() -> float:
        now = extension.errors(simulation, pulled)
        return max(abs(now["reaction"]), now["spread"])

    return Run(simulation, error)


def start_punch(n: int, reference: ReferencePolicy, **options: Any) -> Run:
    """The punched block; its reference gives reactions until 15 ms."""
    simulation, condition = punch.build(n, reference, **options)
    seen: dict[float, float] = {}

    def error() -> float | None:
        seen[simulation.t] = -1e-6 * simulation.reaction(condition)[1]
        for time, bounds in punch.REACTIONS.items():
            if abs(simulation.t - time) < 1e-6:
                # mean over the half millisecond before: single steps ring
                recent = [reaction for t, reaction in seen.items() if time - 0.5e-3 < t <= time]
                return abs(float(np.mean(recent)) / (0.5 * sum(bounds)) - 1.0)
        return None

    return Run(simulation, error)


def start_plate(n: int, reference: ReferencePolicy, **options: Any) -> Run:
    """The spinning plate; its reference goes to 0.15 s."""
    simulation, exact = spinning_plate.build(n, reference, **options), series(spinning_plate.SERIES)
    corner, wrong, right = MaterialPoint(simulation, np.array([0.5, 0.5])), [], []

    def error() -> float:
        right.append(at(exact, "Rcorner", simulation.t))
        wrong.append(float(np.linalg.norm(corner.x)) - right[-1])
        return math.sqrt(np.mean(np.square(wrong))) / max(np.ptp(right), 1e-12)

    return Run(simulation, error)


def start_twist(n: int, reference: ReferencePolicy, **options: Any) -> Run:
    """The twisting column."""
    simulation, exact = twisting_column.build(n, reference, **options), twisting_column.reference_history()
    corner = MaterialPoint(simulation, np.array([0.5, twisting_column.HEIGHT, 0.5]))
    seen = [(0.0, *corner.x[[0, 2]])]

    def error() -> float:
        seen.append((simulation.t, *corner.x[[0, 2]]))
        t, x, z = np.array(seen).T
        right = at(exact, "rotation", t)
        return rms(twisting_column.turned(x, z) - right) / right.max()

    return Run(simulation, error)


def start_bend(n: int, reference: ReferencePolicy, **options: Any) -> Run:
    """The bending column in 3-D."""
    simulation, exact = bending_column.build(3, n, reference, **options), series(bending_column.SERIES)
    tip, wrong, right = MaterialPoint(simulation, np.array([0.0, bending_column.HEIGHT, 0.0])), [], []

    def error() -> float:
        right.append(at(exact, "utx", simulation.t))
        wrong.append(tip.x[0] - right[-1])
        return rms(np.array(wrong)) / np.abs(right).max()

    return Run(simulation, error)


def _time_of_rotation(degrees: float) -> float:
    exact = twisting_column.reference_history()
    return float(
        np.interp(degrees, exact["rotation"][: exact["rotation"].argmax()], exact["t"][: exact["rotation"].argmax()])
    )


def _time_of_shear(gamma: float) -> float:
    return math.asin(min(gamma / vortex.largest_shear(AMPLITUDE), 1.0)) / math.pi


PROBLEMS = (
    Problem(
        "shear",
        "shear",
        "of F or stress",
        (12, 24),
        {gamma: gamma / shear.RATE for gamma in (0.5, 1.0, 2.0, 5.0, 8.0)},
        0.01,
        start_shear,
    ),
    Problem(
        "extension",
        "stretch",
        "of the reaction, or spread of F11",
        (12, 24),
        {stretch: (stretch - 1.0) / extension.SLOW for stretch in (1.25, 1.5, 2.0, 3.0, 5.0)},
        0.05,
        start_extension,
    ),
    Problem(
        "vortex",
        "largest shear",
        "of F, L2",
        (8, 16),
        {gamma: _time_of_shear(gamma) for gamma in (1.0, 2.0, 4.0, 6.0, 8.0, 11.0)},
        0.01,
        start_vortex,
    ),
    Problem(
        "punch",
        "depth [%]",
        "of the reaction",
        (20, 40),
        {4.0: 0.005, 9.0: 0.010, 14.0: 0.015, 19.0: 0.020, 24.0: 0.025, 29.0: 0.030},
        1e-4,
        start_punch,
    ),
    Problem(
        "spinning plate",
        "turns of 60 ms",
        "of the corner's radius, rms / range",
        (16, 32),
        {turns: turns * 2.0 * math.pi / spinning_plate.SPIN for turns in (0.25, 0.5, 1.0, 2.0, 2.5)},
        5e-4,
        start_plate,
    ),
    Problem(
        "twisting column",
        "degrees turned",
        "of the rotation, rms / largest",
        (6, 8),
        {degrees: _time_of_rotation(degrees) for degrees in (90.0, 180.0, 270.0, 337.0)},
        1e-3,
        start_twist,
    ),
    Problem(
        "bending column",
        "quarters of a swing",
        "of the tip, rms / largest",
        (4, 6),
        {1.0: 0.455, 2.0: 0.915, 3.0: 1.376},
        5e-3,
        start_bend,
    ),
)
