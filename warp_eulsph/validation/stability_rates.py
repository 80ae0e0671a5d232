"""Rates of the scheme's operators: the fastest acoustic mode and the strongest damping.

They say which part limits an explicit step before any is chosen. M5 of the stress of M4, ∂²v/∂t² = −K v, has the
frequencies ω, K v = ω² v, on the imaginary axis; M9 has the rates δ on the negative real axis. Störmer-Verlet keeps an
undamped oscillation as it is up to ωΔt = 2, explicit midpoint multiplies it by |λ| = √(1 + (ωΔt)⁴/4); both bear
δΔt ≤ 2.
"""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..fields import allocate
from ..scheme.dissipation import UpwindForces
from ..scheme.stabiliser import Sums
from ..simulation import Simulation
from ..structs import ForceArrays
from .stability_step import Point, Step

# Deviation of F in the central difference of the stress: 1e-8 from the third derivative, 1e-12 from round-off.
DIFFERENCE = 1e-4


@dataclass(frozen=True)
class Rates:
    """In wave speeds over spacings.

    Args:
        frequency: ω dx/c of the fastest mode of M4 and M5.
        damping: δ dx/c of the most strongly damped mode of M9 with ε = 1.
        gain: largest real part of an eigenvalue of M9; above round-off it would feed a mode.
        turning: largest imaginary part of an eigenvalue of M9.
    """

    frequency: float
    damping: float
    gain: float
    turning: float


@functools.cache
def rates(point: Point) -> Rates:
    """The rates of a point's operators in its reference, from dense eigenvalues; cfl and scheme do not matter."""
    step = Step(point)
    simulation = step.simulation
    acoustic = _matrix(simulation, lambda v: _accelerate(simulation, v))
    damping = _matrix(simulation, lambda v: _dissipate(simulation, v))
    # Dual operators: M K is symmetric, so with the square roots of the masses K is too, but for round-off.
    root = np.sqrt(np.repeat(simulation.particles.mass.numpy(), point.dim))
    symmetric = acoustic * root[:, None] / root[None, :]
    squares = -np.linalg.eigvalsh(0.5 * (symmetric + symmetric.T))
    modes = np.linalg.eigvals(damping) / step.speed
    return Rates(
        frequency=math.sqrt(squares.max()) / step.speed,
        damping=float(-modes.real.min()),
        gain=float(modes.real.max()),
        turning=float(np.abs(modes.imag).max()),
    )


def _matrix(simulation: Simulation, operator: Callable[[wp.array], np.ndarray]) -> np.ndarray:
    """Matrix (n dim, n dim) of accelerations per velocity."""
    v = np.zeros(simulation.v.shape)
    columns = []
    for a in range(v.size):
        v.flat[a] = 1.0
        force = operator(wp.array(v, dtype=simulation.space.vec, device=simulation.device))
        v.flat[a] = 0.0
        columns.append((force / simulation.particles.mass.numpy()[:, None]).ravel())
    return np.stack(columns, axis=1)


def _gradient(simulation: Simulation, v: wp.array) -> wp.array:
    """∇v (M4), (n,) of mat."""
    space, configuration = simulation.space, simulation.stepper.configuration
    grad_v = wp.zeros(len(v), dtype=space.mat, device=simulation.device)
    configuration.gradient(v, grad_v)
    return grad_v


def _accelerate(simulation: Simulation, v: wp.array) -> np.ndarray:
    """Force [N] (M5) of the stress that ∇v (M4) causes per second, about the present F, (n, dim)."""
    stepper, configuration = simulation.stepper, simulation.stepper.configuration
    grad_v, force = _gradient(simulation, v).numpy(), np.zeros(simulation.v.shape)
    out = wp.zeros_like(v)
    stepper.flux.keep_dual()
    for sign in (1.0, -1.0):
        F = wp.array(
            simulation.F + sign * DIFFERENCE * grad_v @ simulation.F, dtype=simulation.space.mat, device=v.device
        )
        stepper.flux.compute(F, stepper.grad_v, configuration, simulation.clock.fields)
        configuration.divergence(stepper.flux.fields.Pi, out)
        force += sign / (2.0 * DIFFERENCE) * out.numpy()
    return force


def _dissipate(simulation: Simulation, v: wp.array) -> np.ndarray:
    """Force [N] of M9 with ε = 1, (n, dim)."""
    stepper, space = simulation.stepper, simulation.space
    forces: ForceArrays = allocate(space, "Forces", len(v), simulation.device)
    upwind = UpwindForces(space, simulation.device)
    grad_v = _gradient(simulation, v)
    upwind.compute(Sums(stepper.configuration, stepper.flux.fields, grad_v, forces, 1.0), stepper.U.x, v)
    return forces.dissipation.numpy()
