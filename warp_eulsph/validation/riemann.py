"""Exact solution of the Riemann problem of stiffened gases (Toro, Riemann Solvers and Numerical Methods, 2009, §4).

With p + p∞ in the place of p a stiffened gas is an ideal one; the two sides may differ in γ and p∞.
"""

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class GasState:
    """A uniform state.

    Args:
        density: [kg/m³]. velocity: [m/s]. pressure: [Pa].
        gamma: γ > 1. stiffness: p∞ [Pa], 0 of an ideal gas.
    """

    density: float
    velocity: float
    pressure: float
    gamma: float = 1.4
    stiffness: float = 0.0

    @property
    def total(self) -> float:
        """p + p∞ [Pa]."""
        return self.pressure + self.stiffness

    @property
    def sound_speed(self) -> float:
        """[m/s]."""
        return math.sqrt(self.gamma * self.total / self.density)

    def jump(self, p: float) -> float:
        """Change of velocity [m/s] across the wave that leads to the pressure ``p`` [Pa]: shock above, else fan."""
        gamma, ratio = self.gamma, (p + self.stiffness) / self.total
        if ratio > 1.0:
            share = 2.0 / (self.density * ((gamma + 1.0) * (p + self.stiffness) + (gamma - 1.0) * self.total))
            return (p - self.pressure) * math.sqrt(share)
        return 2.0 * self.sound_speed / (gamma - 1.0) * (ratio ** ((gamma - 1.0) / (2.0 * gamma)) - 1.0)

    def behind(self, p: float) -> float:
        """Density [kg/m³] behind the wave that leads to the pressure ``p`` [Pa]."""
        gamma, ratio = self.gamma, (p + self.stiffness) / self.total
        if ratio <= 1.0:
            return float(self.density * ratio ** (1.0 / gamma))
        weak = (gamma - 1.0) / (gamma + 1.0)
        return self.density * (ratio + weak) / (weak * ratio + 1.0)


def contact(left: GasState, right: GasState) -> tuple[float, float]:
    """Pressure [Pa] and velocity [m/s] between the waves, by bisection.

    Raises:
        ValueError: states that part and leave a vacuum.
    """

    def mismatch(p: float) -> float:
        return left.jump(p) + right.jump(p) + right.velocity - left.velocity

    least = -min(left.stiffness, right.stiffness)
    if mismatch(least + 1e-14 * (left.total + right.total)) > 0.0:
        raise ValueError(f"the states must not leave a vacuum between them, got {left} and {right}")
    step = left.total + right.total
    while mismatch(least + step) < 0.0:
        step *= 2.0
    low, high = least, least + step
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if mismatch(middle) < 0.0 else (low, middle)
    p = 0.5 * (low + high)
    return p, 0.5 * (left.velocity + right.velocity + right.jump(p) - left.jump(p))


def solve(left: GasState, right: GasState, xi: np.ndarray) -> dict[str, np.ndarray]:
    """``density`` [kg/m³], ``velocity`` [m/s] and ``pressure`` [Pa] at x/t = ``xi`` [m/s], (n,)."""
    xi = np.asarray(xi, dtype=float)
    p, u = contact(left, right)
    found = {name: np.zeros(len(xi)) for name in ("density", "velocity", "pressure")}
    for side, sign in ((left, -1.0), (right, 1.0)):
        own = xi < u if sign < 0.0 else xi >= u
        values = _side(side, sign, p, u, xi[own])
        for name, value in zip(found, values, strict=True):
            found[name][own] = value
    return found


def shock_speed(side: GasState, p: float, sign: float) -> float:
    """Speed [m/s] of the shock into ``side`` with the pressure ``p`` [Pa] behind it; to the right if ``sign`` > 0."""
    gamma, ratio = side.gamma, (p + side.stiffness) / side.total
    factor = math.sqrt((gamma + 1.0) / (2.0 * gamma) * ratio + (gamma - 1.0) / (2.0 * gamma))
    return side.velocity + sign * side.sound_speed * factor


def _side(side: GasState, sign: float, p: float, u: float, xi: np.ndarray) -> tuple[np.ndarray, ...]:
    """Density, velocity, pressure at ``xi`` on one side of the contact; ``sign`` −1 on the left."""
    gamma, c = side.gamma, side.sound_speed
    outside = (side.density, side.velocity, side.pressure)
    inside = (side.behind(p), u, p)
    if p > side.pressure:
        passed = sign * xi < sign * shock_speed(side, p, sign)
        return tuple(np.where(passed, b, a) for a, b in zip(outside, inside, strict=True))
    head = side.velocity + sign * c
    c_inside = c * ((p + side.stiffness) / side.total) ** ((gamma - 1.0) / (2.0 * gamma))
    tail = u + sign * c_inside
    speed = 2.0 / (gamma + 1.0) * (-sign * c + 0.5 * (gamma - 1.0) * side.velocity + xi)
    c_fan = sign * (xi - speed)
    ratio = np.clip(c_fan / c, 0.0, 1.0)
    fan = (
        side.density * ratio ** (2.0 / (gamma - 1.0)),
        speed,
        side.total * ratio ** (2.0 * gamma / (gamma - 1.0)) - side.stiffness,
    )
    before, after = sign * xi >= sign * head, sign * xi <= sign * tail
    return tuple(np.where(before, a, np.where(after, b, f)) for a, b, f in zip(outside, inside, fan, strict=True))
