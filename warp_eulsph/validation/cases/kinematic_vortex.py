"""Kinematic vortex: a prescribed flow that winds up a square and unwinds it, F by products of velocity gradients.

Velocity on the unit square, zero on its sides,

    u = −sin²(π x) sin(2 π y) cos(π t/T) ,   v = sin²(π y) sin(2 π x) cos(π t/T) ,

the single vortex of Rider & Kothe (J. Comput. Phys. 141, 1998) that LeVeque (SIAM J. Numer. Anal. 33, 1996) reverses at
T/2: J = 1 always and F(T) = 1. No stress acts; what is tested is the gradient (M4) on particles that the flow
disorders, and F ← (1 + Δt ∇v^{n+½}) F (M14). The exact F of each particle is integrated along its own path.

Aimed at, from an independent corrected-SPH program (cubic spline, h = 1.4 spacings, 64²): T = 1, 2, 4 stretch a line
2.5, 4.9 and 10 times, with a median relative error of F at T/2 of 0.004, 0.009, 0.027 and rms(J − 1) of 0.0055, 0.019,
0.042. The errors at T, with everything back in place, are those of F against 1.
"""

import functools
import math
from collections.abc import Sequence

import numpy as np
import warp as wp

from ... import Always, Body, Current, NeoHookean, ReferencePolicy, Simulation, TimeStep, Velocity, Verlet
from ...geometry import box
from ..case import Case
from ..report import Figure

# period [s] -> stretch, median relative error of F, rms(J − 1) and half a unit of its last digit; at T/2 of 64²
AIMED = {1.0: (2.5, 0.004, 5.5e-3, 5e-5), 2.0: (4.9, 0.009, 1.9e-2, 5e-4), 4.0: (10.0, 0.027, 4.2e-2, 5e-4)}
STEPS_PER_SECOND = 200


def flow(x: np.ndarray, t: float, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Velocities [m/s], (n, 2), and their gradients [1/s], (n, 2, 2)."""
    c, (X, Y) = math.cos(math.pi * t / period), math.pi * x.T
    v = np.stack([-(np.sin(X) ** 2) * np.sin(2 * Y), np.sin(Y) ** 2 * np.sin(2 * X)], axis=1)
    along = np.sin(2 * X) * np.sin(2 * Y)
    rows = [[-along, -2.0 * np.sin(X) ** 2 * np.cos(2 * Y)], [2.0 * np.sin(Y) ** 2 * np.cos(2 * X), along]]
    return c * v, c * math.pi * np.array(rows).transpose(2, 0, 1)


def exact(x: np.ndarray, t: float, period: float, steps: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Positions [m] and deformation gradients [-] at time ``t`` [s] of particles that start at ``x``; Runge–Kutta 4."""
    F, dt = np.tile(np.eye(2), (len(x), 1, 1)), t / steps

    def rate(time: float, x: np.ndarray, F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        v, L = flow(x, time, period)
        return v, L @ F

    for n in range(steps):
        now = n * dt
        v1, F1 = rate(now, x, F)
        v2, F2 = rate(now + dt / 2, x + dt / 2 * v1, F + dt / 2 * F1)
        v3, F3 = rate(now + dt / 2, x + dt / 2 * v2, F + dt / 2 * F2)
        v4, F4 = rate(now + dt, x + dt * v3, F + dt * F3)
        x, F = x + dt / 6 * (v1 + 2 * v2 + 2 * v3 + v4), F + dt / 6 * (F1 + 2 * F2 + 2 * F3 + F4)
    return x, F


@functools.cache
def make_flow(period: float) -> wp.Function:
    """``wp.func`` (x [m], t [s]) -> velocity [m/s]."""
    turn, pi = math.pi / period, math.pi

    @wp.func
    def velocity(x: wp.vec2d, t: wp.float64) -> wp.vec2d:
        c = wp.cos(wp.float64(turn) * t)
        X = wp.float64(pi) * x[0]
        Y = wp.float64(pi) * x[1]
        two = wp.float64(2.0)
        sin_X, sin_Y = wp.sin(X), wp.sin(Y)
        return wp.vec2d(-c * sin_X * sin_X * wp.sin(two * Y), c * sin_Y * sin_Y * wp.sin(two * X))

    return velocity


def build(n: int, period: float, reference: ReferencePolicy = Always()) -> Simulation:
    """n × n particles, all of them driven; the material's stress has no effect and no correction is computed."""
    x, volume = box((0.0, 0.0), (1.0, 1.0), 1.0 / n)
    idle = NeoHookean(density=1.0, young=1.0, poisson=0.3)
    body = Body(x=x, volume=volume, material=idle, velocity=flow(x, 0.0, period)[0])
    return Simulation(
        body,
        boundaries=[Velocity(value=make_flow(period))],
        reference=reference,
        arrangement=Current(),
        scheme=Verlet(dissipation=None, correction=None),
        time_step=TimeStep(fixed=1.0 / STEPS_PER_SECOND),
        dilation=1.4,
    )


def errors(simulation: Simulation, period: float) -> dict[str, float]:
    """Largest stretch; median relative error of F; rms(J − 1); largest error of positions [m]."""
    x, F = exact(simulation.bodies[0].x, simulation.t, period)
    relative = np.linalg.norm(simulation.F - F, axis=(1, 2)) / np.linalg.norm(F, axis=(1, 2))
    return {
        "stretch": float(np.linalg.svd(F, compute_uv=False).max()),
        "F": float(np.median(relative)),
        "J": float(np.sqrt(np.mean((simulation.J - 1.0) ** 2))),
        "x": float(np.linalg.norm(simulation.x - x, axis=1).max()),
    }


def run(quick: bool) -> Sequence[Figure]:
    """At T/2 and T, 64²: half a unit of the last digit above the figures aimed at.

    Quick: 32² and T = 1, with four times those errors, at second order.
    """
    n, periods, allowed = (32, (1.0,), 4.0) if quick else (64, tuple(AIMED), 1.0)
    figures: list[Figure] = []
    for period in periods:
        stretch, error, volume, digit = AIMED[period]
        simulation = build(n, period)
        half, back = (errors(simulation, period) for _ in simulation.frames([period / 2, period]))
        label = f"period_{period:g}"
        figures += [
            Figure(f"{label}_stretch", half["stretch"], 0.95 * stretch, 1.05 * stretch, stretch),
            Figure(f"{label}_median_error_of_F", half["F"], 0.0, allowed * (error + 5e-4), error),
            Figure(f"{label}_rms_error_of_J", half["J"], 0.0, allowed * (volume + digit), volume),
            Figure(f"{label}_median_error_of_F_back", back["F"], reference=0.0),
            Figure(f"{label}_largest_error_of_x_back", back["x"], reference=0.0),
        ]
    return figures


CASE = Case(
    name="kinematic_vortex",
    title="Prescribed vortex that winds up and unwinds, F by products, no stress",
    source="exact along each path; errors aimed at from an independent corrected-SPH program",
    run=run,
)
