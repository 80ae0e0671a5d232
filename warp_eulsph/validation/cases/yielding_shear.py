"""Shear without end: a jittered block that yields, sheared to 20 by plates that move; stress is that of yield.

Perfectly plastic, y a hundredth of E, 10 % jitter, periodic along the plates: once it has yielded, τ = y/√3 everywhere
and for good, and the plastic strain is γ/√3 but for the elastic strain. The arrangement of the start knows its
neighbours however far they are, and pays by its step, which gets shorter with γ²; read anew, kept even (``Shifting``)
and with true surface vectors the step stays as it was.

Nothing in perfect plasticity says how the shear is spread, so that what noise of the jitter leaves in the velocities
grows, and dissipation alone is against it. By default (M9 with its stress) that is half as strong: the worst particle
is 2.5 % off at a shear of 6, and 17 % at 20. So the way to 20 is by forces alone.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from ...boundaries import Motion
from ...geometry import box
from ...materials import J2, LinearHardening
from ...scheme.arrangement import Current
from ...scheme.shifting import Shifting
from ...scheme.verlet import Verlet
from ...simulation import Body, Simulation
from ..case import Case
from ..report import Figure

YIELD, RATE, HELD = 1e4, 10.0, 3  # Pa, 1/s, layers of the plates
LAW = J2(density=1e3, young=1e6, poisson=0.3, hardening=LinearHardening(yield_stress=YIELD))


@wp.func
def slide(X: wp.vec2d, t: wp.float64) -> wp.vec2d:
    """The shear of ``RATE`` from the start."""
    return wp.vec2d(wp.float64(10.0) * t * X[1], wp.float64(0.0))


#: Options of the simulation, and the largest shear, quick and not.
FORMS: dict[str, tuple[dict[str, Any], int, int]] = {
    "default": ({}, 4, 4),
    "kept": ({"scheme": Verlet()}, 4, 20),
    "read_anew": ({"arrangement": Current(), "scheme": Verlet(shifting=Shifting())}, 20, 20),
}


def build(n: int, **options: Any) -> tuple[Simulation, np.ndarray]:
    """n × n particles, and which of them no plate holds; with true surface vectors where they are read anew."""
    x, volume = box((0.0, 0.0), (1.0, 1.0), 1.0 / n, jitter=0.1)
    layers = np.arange(len(x)) % n  # the last axis of a lattice runs fastest
    surface = None
    if "arrangement" in options:
        surface = ((1.0 * (layers == n - 1) - 1.0 * (layers == 0)) / n)[:, None] * np.array([0.0, 1.0])
    velocity = RATE * x[:, 1:] * np.array([1.0, 0.0])
    block = Body(x=x, volume=volume, material=LAW, velocity=velocity, surface=surface, name="block")
    plates = [Motion(slide, layers >= n - HELD), Motion(slide, layers < HELD)]
    return Simulation(block, boundaries=plates, periodic=(1.0, 0.0), **options), (layers >= HELD) & (layers < n - HELD)


def run(quick: bool) -> Sequence[Figure]:
    """Stress within 3 % of yield at every particle and every look; quick: 12², the arrangement of the start to 4."""
    n, figures = 12 if quick else 16, []
    for name, (options, *shears) in FORMS.items():
        last = shears[0 if quick else 1]
        simulation, free = build(n, **options)
        found = []
        for shear in np.arange(1.0, last + 1.0):
            simulation.run(shear / RATE)
            found.append(simulation.cauchy_stress[free, 0, 1] * simulation.J[free] / (YIELD / np.sqrt(3.0)))
        strain = float(simulation.history("plastic_strain")[free].mean()) * np.sqrt(3.0) / last
        energy = simulation.energy()
        figures += [
            Figure(f"{name}_least_stress_over_yield", float(np.min(found)), 0.97, 1.03, 1.0),
            Figure(f"{name}_largest_stress_over_yield", float(np.max(found)), 0.97, 1.03, 1.0),
            Figure(f"{name}_plastic_over_total_strain", strain, 0.95, 1.02, 1.0),
            Figure(f"{name}_ledger_residual", abs(energy["residual"]) / energy["total"], 0.0, 1e-10, 0.0),
            Figure(f"{name}_steps", float(simulation.steps)),
        ]
    return figures


CASE = Case(
    name="yielding_shear",
    title="Jittered elastic-plastic block sheared to 20: stress of yield throughout",
    source="exact: perfect plasticity",
    run=run,
)
