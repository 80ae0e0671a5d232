"""Exact standing waves on the unit square and cube: swinging plate and low-dispersion cube.

u = U0 sin(ωt) A_i sin(πX_i/2) Π_{j≠i} cos(πX_j/2), linear elasticity. At X_i = 0 the normal displacement is zero, at
X_i = 1 the tangential one and the normal traction: mirror ghosts, walls at X_i = 0 and planes of antisymmetry at
X_i = 1, keep the full order there. ω = π/2 √d c, with the shear speed c if Σ A_i = 0, the pressure speed if all A_i are
equal.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..boundaries import Antisymmetry, Wall, mirror
from ..geometry import box
from ..materials import LinearElastic
from ..output.stress import cauchy_stress
from ..scheme.arrangement import Current
from ..scheme.policy import Always, ReferencePolicy
from ..scheme.verlet import Verlet
from ..simulation import Body, Simulation
from ..weights import CubicSpline
from .figures import difference, order
from .report import Figure

DENSITY, YOUNG, POISSON = 1100.0, 17e6, 0.3
MU, KAPPA = YOUNG / 2 / (1 + POISSON), YOUNG / 3 / (1 - 2 * POISSON)
AMPLITUDE = 1e-6  # U0 [m], small enough that the exact solution of the linear problem is that of the moving reference
DILATION = 1.3
# Stored energy comes from F − I of size U0, whose round-off is 2e-16/U0 of it, at every step of every particle.
LEDGER = 1e-7


class StandingWave:
    """The exact solution at positions x [m], (n, dim)."""

    def __init__(self, x: np.ndarray):
        n, dim = x.shape
        A = np.array([-1.0, 1.0]) if dim == 2 else np.ones(dim)
        c = math.sqrt((MU if dim == 2 else KAPPA + 4 * MU / 3) / DENSITY)
        self.omega = math.pi / 2 * math.sqrt(dim) * c
        self.end = 0.4 * 2 * math.pi / self.omega  # where v, F and P are all far from zero
        sine, cosine = np.sin(np.pi * x / 2), np.cos(np.pi * x / 2)
        self.u, self.gradient = np.zeros((n, dim)), np.zeros((n, dim, dim))
        for i in range(dim):
            factors = [sine[:, k] if k == i else cosine[:, k] for k in range(dim)]
            self.u[:, i] = A[i] * np.prod(factors, axis=0)
            for j in range(dim):
                slope = np.pi / 2 * (cosine[:, j] if j == i else -sine[:, j])
                self.gradient[:, i, j] = A[i] * np.prod([slope if k == j else f for k, f in enumerate(factors)], axis=0)

    def velocity(self, t: float) -> np.ndarray:
        """[m/s], (n, dim)."""
        return AMPLITUDE * self.omega * math.cos(self.omega * t) * self.u

    def strain(self, t: float) -> np.ndarray:
        """F − I, (n, dim, dim)."""
        return AMPLITUDE * math.sin(self.omega * t) * self.gradient

    def stress(self, t: float) -> np.ndarray:
        """P [Pa], (n, dim, dim); the Cauchy stress differs from it by less than the errors of interest."""
        strain = self.strain(t)
        trace = np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(strain.shape[1])
        return (KAPPA - 2 * MU / 3) * trace + MU * (strain + strain.transpose(0, 2, 1))


def build(dim: int, n: int, reference: ReferencePolicy, **options: Any) -> tuple[Simulation, StandingWave]:
    """The unit square or cube, n particles along a side, with ghosts behind all of its faces; undeformed, moving."""
    x, volume = box([0.0] * dim, [1.0] * dim, 1 / n)
    wave = StandingWave(x)
    material = LinearElastic(density=DENSITY, young=YOUNG, poisson=POISSON)
    body = Body(x=x, volume=volume, material=material, velocity=wave.velocity(0.0))
    depth = 3 * CubicSpline().support * DILATION / n  # ghosts next to the plane need all neighbours, and these theirs
    conditions = []
    for i in range(dim):
        for position, image in ((0.0, Wall()), (1.0, Antisymmetry())):
            point, normal = np.full(dim, position), np.eye(dim)[i] * (2 * position - 1)
            body, ghosts = mirror(body, point=point.tolist(), normal=normal.tolist(), depth=depth, image=image)
            conditions.append(ghosts)
    return Simulation(body, boundaries=conditions, reference=reference, dilation=DILATION, **options), wave


def measure(simulation: Simulation, wave: StandingWave) -> dict[str, float]:
    """Relative L2 errors of v, F − I and P after 0.4 periods, and the energy's drift."""
    own = slice(0, len(wave.u))
    dim = wave.u.shape[1]
    start = simulation.energy()["total"]
    simulation.run(wave.end)
    t, energy = simulation.t, simulation.energy()
    return {
        "v": difference(simulation.v[own], wave.velocity(t)),
        "F": difference(simulation.F[own] - np.eye(dim), wave.strain(t)),
        "P": difference(cauchy_stress(simulation)[own, :dim, :dim], wave.stress(t)),
        "energy_drift": energy["total"] / start - 1.0,
        "ledger_residual": abs(energy["residual"]) / start,
    }


def figures(dim: int, levels: Sequence[int], least_order: float) -> list[Figure]:
    """Observed orders of M4 and M5 as they are, and what part of their error the default leaves at the finest level.

    Sharpened (M23), errors of space are as small as those of time, which have the other sign: orders mean nothing. The
    current arrangement, which is not sharpened, at the coarsest level beside them.
    """
    found = [measure(*build(dim, n, Always(), scheme=Verlet(sharpening=None))) for n in levels]
    sharp = measure(*build(dim, levels[-1], Always()))
    current = measure(*build(dim, levels[0], Always(), arrangement=Current()))
    checked = []
    for name in "vFP":
        observed = order(levels, [level[name] for level in found])
        checked.append(Figure(f"order_{name}", observed, low=least_order, reference=2.0))
        checked.append(Figure(f"error_{name}", sharp[name], reference=0.0))
        checked.append(Figure(f"part_of_error_{name}", sharp[name] / found[-1][name], high=0.2, reference=0.0))
    apart = max(abs(current[name] / found[0][name] - 1.0) for name in "vFP")
    return [
        *checked,
        Figure("current_arrangement_difference", apart, reference=0.0),
        Figure("energy_drift", sharp["energy_drift"], high=1e-6, reference=0.0),
        Figure("ledger_residual", max(level["ledger_residual"] for level in (*found, sharp)), 0.0, LEDGER, 0.0),
    ]
