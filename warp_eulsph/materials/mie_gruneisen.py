"""Mie–Grüneisen equation of state about the Hugoniot of a linear shock speed: for solids and liquids under shocks."""

import functools
import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..space import vector_type
from .base import Variable, positive
from .fluid import Equation, Fluid

THERMAL = Variable("thermal_energy", "J/m^3", "internal energy that heat left, taken back to J = 1 on its isentrope")
# Points of Gauss and Legendre; 1e-10 of the pressure where a half of the largest compression is reached.
POINTS = 8


@dataclass(frozen=True, kw_only=True)
class MieGruneisen(Fluid):
    """p = p_H (1 − Γ0 η/2) + Γ0 E, p_H = ρ0 c0² η/(1 − s η)², η = 1 − J; p = −ρ0 c0² (J − 1) + Γ0 E where J > 1.

    E is the internal energy per initial volume, zero at the start, p_H the pressure behind a shock into matter at rest,
    whose speed is c0 + s u behind which matter moves at u (Rice, McQueen & Walsh, Solid State Physics 6, 1958); Γ/V is
    constant. On an isentrope E = e^(Γ0 η) [θ + ∫₀^η p_ref e^(−Γ0 y) dy], p_ref = p − Γ0 E: heat raises θ, which is the
    history ``thermal_energy``; the integral is a sum of Gauss and Legendre. Γ0 ≤ 2 s keeps p rising with η.

    Args:
        density: initial density [kg/m³].
        sound_speed: c0 [m/s].
        slope: s of the shock speed [-].
        gruneisen: Γ0 at the initial density [-].
        viscosity, cavitation: as in ``Fluid``; −ρ0 c0²/Γ0 is the most tension there is.
    """

    sound_speed: float
    slope: float
    gruneisen: float
    variable: ClassVar[Variable | None] = THERMAL

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("sound_speed", self.sound_speed, "m/s")
        positive("slope", self.slope, "1")
        if not (math.isfinite(self.gruneisen) and 0.0 < self.gruneisen <= 2.0 * self.slope):
            raise ValueError(f"gruneisen must be in (0, 2 slope = {2.0 * self.slope:g}], got {self.gruneisen}")
        most = self.density * self.sound_speed**2 / self.gruneisen
        if self.cavitation is not None and not -most < self.cavitation <= 0.0:
            raise ValueError(f"cavitation must be in (−ρ0 c0²/Γ0 = {-most:g}, 0] Pa, got {self.cavitation}")

    def state(self) -> dict[str, float]:
        return {"A": self.density * self.sound_speed**2, "s": self.slope, "G": self.gruneisen}

    @staticmethod
    @functools.cache
    def make_equation(real: type, Constants: Any) -> Equation:
        places, weights = np.polynomial.legendre.leggauss(POINTS)
        points = vector_type(POINTS, real)
        at, share = points(*(0.5 * (places + 1.0))), points(*(0.5 * weights))

        @wp.func
        def cold(eta: real, c: Constants) -> real:
            """p_ref; not a number beyond the largest compression, where there is no state."""
            if eta < real(0.0):
                return c.A * eta
            left = real(1.0) - c.s * eta
            if left <= real(0.0):
                return real(wp.nan)
            return c.A * eta / (left * left) * (real(1.0) - real(0.5) * c.G * eta)

        @wp.func
        def energy(J: real, theta: real, c: Constants) -> real:
            eta = real(1.0) - J
            if eta < real(0.0):  # the integral in closed form
                grown = real(1.0) - wp.exp(c.G * eta)
                return c.A / c.G * (-eta - grown / c.G) + theta * (real(1.0) - grown)
            total = real(0.0)
            for k in range(wp.static(POINTS)):
                total += share[k] * cold(at[k] * eta, c) * wp.exp(-c.G * at[k] * eta)
            return wp.exp(c.G * eta) * (theta + total * eta)

        @wp.func
        def pressure(J: real, theta: real, c: Constants) -> real:
            return cold(real(1.0) - J, c) + c.G * energy(J, theta, c)

        @wp.func
        def modulus(J: real, theta: real, c: Constants) -> real:
            # −J² dp/dJ = J² (dp_ref/dη + Γ0 p), as dE/dη = p on an isentrope
            eta = real(1.0) - J
            slope = c.A
            if eta > real(0.0):
                left = real(1.0) - c.s * eta
                slope = c.A * (real(1.0) + c.s * eta - c.G * eta) / (left * left * left)
            return J * J * (slope + c.G * pressure(J, theta, c))

        @wp.func
        def opening(p: real, theta: real, c: Constants) -> real:
            return real(1.0) - wp.log((p + c.A / c.G) / (c.A / c.G + c.G * theta)) / c.G

        @wp.func
        def heat(J: real, c: Constants) -> real:
            return wp.exp(c.G * (J - real(1.0)))

        return Equation(pressure, energy, modulus, opening, heat)
