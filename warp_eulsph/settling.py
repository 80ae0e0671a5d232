"""Quasi-static answers: steps until loads and stresses balance."""

import logging
import math
from typing import Any

import numpy as np

from .boundaries import Damping
from .simulation import Simulation

log = logging.getLogger(__name__)

# Steps between two looks at the balance
STEPS_BETWEEN_LOOKS = 20


def residual(simulation: Simulation) -> float:
    """How far the bodies are from equilibrium [-]: unbalanced forces over those that they must balance.

    ‖f_material + f_loads + f_reactions‖ / (‖f_loads‖ + ‖f_reactions‖), roots of sums of squares over the particles in
    the last step; damping and dissipation, which vanish at rest, left out. Infinite before the first step, and where
    nothing loads or holds the bodies.
    """
    forces = simulation.stepper.forces

    def of(name: str) -> Any:
        values = getattr(forces, name).numpy()
        return values if len(values) else 0.0

    loads, reactions = of("external") - of("damping"), of("reaction")
    unbalanced = of("internal") + of("correction") + of("tie") + loads + reactions
    scale = float(np.linalg.norm(loads) + np.linalg.norm(reactions))
    return float(np.linalg.norm(unbalanced)) / scale if scale > 0.0 else math.inf


def settle(simulation: Simulation, tolerance: float = 1e-3, *, until: float) -> float:
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
    if not any(isinstance(boundary, Damping) for boundary in simulation.boundaries):
        raise ValueError("settle needs a Damping() among the boundaries, or motion goes on")
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        raise ValueError(f"tolerance must be positive and finite, got {tolerance}; 1e-3 is usual")
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
