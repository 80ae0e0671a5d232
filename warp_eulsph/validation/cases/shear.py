"""Simple shear without end: a block between plates that move apart sideways, periodic along them, J = 1 throughout.

x = X + γ Y e_x with γ = 10/s · t, the same at every particle from the start, is an exact motion: its stress is uniform
and nothing accelerates. For the neo-Hookean law at J = 1 the shear stress is μ γ and the stored energy μ γ²/2 per
volume, which is the plates' work. Particles start jittered by 10 % of their spacing, so that errors have something to
grow from; three layers at both plates follow the motion, the rest is free to go wrong. Surface vectors are the true
ones.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from ... import (
    Always,
    Body,
    Convected,
    Current,
    Motion,
    NeoHookean,
    PairAreas,
    ReferencePolicy,
    Shifting,
    Simulation,
    Verlet,
)
from ...geometry import box
from ..case import Case
from ..report import Figure

RATE = 10.0  # 1/s
LAYERS = 3
BLOCK = NeoHookean(density=1e3, young=1e6, poisson=0.3)
MU = BLOCK.constants()["mu"]


@wp.func
def slide(X: wp.vec2d, t: wp.float64) -> wp.vec2d:
    return wp.vec2d(wp.float64(RATE) * t * X[1], wp.float64(0.0))


def build(n: int, reference: ReferencePolicy, jitter: float = 0.1, **options: Any) -> tuple[Simulation, Motion]:
    """A block of 1 m × 1 m as n × n particles, and the condition of its upper plate."""
    x, volume = box((0.0, 0.0), (1.0, 1.0), 1.0 / n, jitter=jitter)
    layers = np.arange(len(x)) % n  # the last axis of a lattice runs fastest
    normal = 1.0 * (layers == n - 1) - 1.0 * (layers == 0)
    along, up = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    body = Body(
        x=x,
        volume=volume,
        material=BLOCK,
        velocity=RATE * x[:, 1:] * along,
        surface=normal[:, None] * up / n,
    )
    upper = Motion(slide, layers >= n - LAYERS)
    lower = Motion(slide, layers < LAYERS)
    options = {"periodic": (1.0, 0.0), **options}
    return Simulation(body, boundaries=[lower, upper], reference=reference, **options), upper


def errors(simulation: Simulation, upper: Motion) -> dict[str, float]:
    """Relative errors of F (L2, against γ), shear stress (rms) and the plate's reaction; energy / exact; range of J."""
    shear = RATE * simulation.t
    exact = np.array([[1.0, shear], [0.0, 1.0]])
    F, J, energy = simulation.F, simulation.J, simulation.energy()
    stress = MU * J ** (-5.0 / 3.0) * (F @ F.transpose(0, 2, 1))[:, 0, 1]
    return {
        "F": math.sqrt(float(np.mean(np.square(F - exact).sum(axis=(1, 2))))) / shear,
        "stress": float(np.sqrt(np.mean(np.square(stress / (MU * shear) - 1.0)))),
        "reaction": float(simulation.reaction(upper)[0]) / (MU * shear) - 1.0,
        "energy": energy["stored"] / (0.5 * MU * shear**2),
        "least J": float(J.min()),
        "largest J": float(J.max()),
    }


#: Name -> arrangement, scheme and shear: the default, and two that read the current arrangement.
FORMS = {
    "convected": (Convected(), Verlet(), 10.0),
    "current_shifted": (Current(), Verlet(shifting=Shifting()), 5.0),
    "current_m11": (Current(), Verlet(correction=PairAreas(kappa=math.inf)), 5.0),
}


def run(quick: bool) -> Sequence[Figure]:
    """All within 5 %. Quick: to a shear of ½, where every form should hold; else the default to 10, the others to 5."""
    n = 12 if quick else 16
    figures = []
    for name, (arrangement, scheme, shear) in FORMS.items():
        simulation, upper = build(n, Always(), arrangement=arrangement, scheme=scheme)
        simulation.run((0.5 if quick else shear) / RATE)
        now = errors(simulation, upper)
        figures += [
            Figure(f"{name}_error_of_F", now["F"], 0.0, 0.05, 0.0),
            Figure(f"{name}_error_of_stress", now["stress"], 0.0, 0.05, 0.0),
            Figure(f"{name}_error_of_reaction", now["reaction"], -0.05, 0.05, 0.0),
            Figure(f"{name}_stored_energy", now["energy"], 0.95, 1.05, 1.0),
        ]
    return figures


CASE = Case(
    name="shear",
    title="Simple shear of a jittered block between driven plates, periodic along them",
    source="exact",
    run=run,
)
