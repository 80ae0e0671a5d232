"""Quasi-static answers: steps until loads and stresses balance."""

import logging
import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from .boundaries import Boundary, Damping
from .scheme.stepper import Stepper

log = logging.getLogger(__name__)

# Steps between two looks at the balance
STEPS_BETWEEN_LOOKS = 20


class Damped(Protocol):
    """What is asked of a simulation."""

    stepper: Stepper

    @property
    def boundaries(self) -> Sequence[Boundary]:
        """Conditions."""

    @property
    def t(self) -> float:
        """Time [s]."""

    @property
    def steps(self) -> int:
        """Steps taken."""

    def step(self, count: int) -> None:
        """Take steps."""


def residual(simulation: Damped) -> float:
    """How far the bodies are from equilibrium [-]: unbalanced forces over loads, or over reactions where nothing loads.

    Σ|f_material + f_load + f_reaction| / Σ|f_load| over the particles in the last step, damping and dissipation, which
    vanish at rest, left out. Infinite before the first step, and where nothing loads or holds the bodies. Sums of
    lengths and not of squares, which the few particles of a clamp would rule. Of independent runs that have not failed
    the largest.
    """
    forces, clock = simulation.stepper.forces, simulation.stepper.clock

    def of(name: str) -> np.ndarray:
        values: np.ndarray = getattr(forces, name).numpy()
        return values.astype(float)

    loads, reactions = of("external") - of("damping"), of("reaction")
    unbalanced = of("internal") + of("correction") + of("tie") + loads + reactions
    found = []
    for run, own in clock.runs_of(range(len(loads))).items():
        if clock.well[run]:
            scale = _sum_of_lengths(loads[own]) or _sum_of_lengths(reactions[own])
            found.append(_sum_of_lengths(unbalanced[own]) / scale if scale > 0.0 else math.inf)
    return float(np.max(found)) if found else math.inf


def _sum_of_lengths(vectors: np.ndarray) -> float:
    return float(np.linalg.norm(vectors, axis=1).sum())


def check_damped(simulation: object) -> None:
    """Raise ValueError unless a condition damps, without which nothing comes to rest."""
    if not any(isinstance(boundary, Damping) for boundary in getattr(simulation, "boundaries", ())):
        raise ValueError("settle needs a Damping() among the boundaries, or motion goes on")


def check_tolerance(tolerance: float) -> None:
    """Raise ValueError unless it can be a residual."""
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        raise ValueError(f"settle: a residual must be positive and finite, got {tolerance}; 1e-3 is usual")


def settle(simulation: Damped, tolerance: float = 1e-3, *, until: float) -> float:
    """Step until the bodies are in equilibrium: ``residual(simulation) <= tolerance``; the residual reached.

    Args:
        simulation: under constant loads and conditions, with a ``Damping`` among them.
        tolerance: largest residual that counts as equilibrium [-].
        until: time [s] by which it must be reached.

    Raises:
        ValueError: no ``Damping`` among the conditions, or a tolerance that is not positive.
        RuntimeError: no equilibrium by the time ``until``.
        UnstableError: as ``Simulation.run``.
    """
    check_damped(simulation)
    check_tolerance(tolerance)
    found = math.inf
    while simulation.t < until:
        simulation.step(STEPS_BETWEEN_LOOKS)
        found = residual(simulation)
        if found <= tolerance:
            log.info("in equilibrium to %.1e at t = %.6g s, step %d", found, simulation.t, simulation.steps)
            return found
    raise RuntimeError(
        f"no equilibrium by t = {simulation.t:.6g} s: residual {found:.2e}, asked for {tolerance}; give it more "
        "time, or hold the bodies so that none moves freely"
    )
