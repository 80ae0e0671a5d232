"""Weakly compressible liquid: pressure from the change of volume only."""

import functools
import math
from dataclasses import dataclass
from typing import Any, ClassVar

import warp as wp

from ..linalg import reciprocal_power
from .base import positive
from .fluid import Equation, Fluid

# |J − 1| below which the energy is a series: differences of powers would leave float32 a sixth of it at 5e-4. Its terms
# fall by (γ + k)/50(k + 2), so that what follows this many is below the round-off of float64, for γ up to 17.
NEAR, TERMS = 0.02, 12


@dataclass(frozen=True, kw_only=True)
class TaitLiquid(Fluid):
    """p = B (J^(−γ) − 1), B = ρ0 c0²/γ.

    Args:
        density: initial density [kg/m³].
        sound_speed: c0 at the initial density [m/s]; 10 times the largest velocity keeps J within 1 %.
        gamma: exponent γ > 1, 7 for water.
        viscosity, cavitation: as in ``Fluid``; B is the most tension there is.
    """

    sound_speed: float
    gamma: float = 7.0
    liquid: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("sound_speed", self.sound_speed, "m/s")
        if not (math.isfinite(self.gamma) and self.gamma > 1.0):
            raise ValueError(f"gamma must be greater than 1 and finite, got {self.gamma}; 7 is water")
        B = self.state()["B"]
        if self.cavitation is not None and not -B < self.cavitation <= 0.0:
            raise ValueError(f"cavitation must be in (−B = {-B:g}, 0] Pa, got {self.cavitation}; p is 0 at rest")

    def state(self) -> dict[str, float]:
        return {"B": self.density * self.sound_speed**2 / self.gamma, "gamma": self.gamma}

    @staticmethod
    @functools.cache
    def make_equation(real: type, Constants: Any) -> Equation:
        power = reciprocal_power(real)

        @wp.func
        def pressure(J: real, theta: real, c: Constants) -> real:
            return c.B * (power(J, c.gamma) - real(1.0))

        @wp.func
        def energy(J: real, theta: real, c: Constants) -> real:
            x = J - real(1.0)
            if wp.abs(x) < real(NEAR):
                series = real(1.0)
                for left in range(TERMS):
                    k = real(TERMS - left)
                    series = real(1.0) - (c.gamma + k) / (k + real(2.0)) * x * series
                return real(0.5) * c.B * c.gamma * x * x * series
            compression = (power(J, c.gamma - real(1.0)) - real(1.0)) / (c.gamma - real(1.0))
            return c.B * (compression + x)

        @wp.func
        def modulus(J: real, theta: real, c: Constants) -> real:
            return c.B * c.gamma * power(J, c.gamma - real(1.0))

        @wp.func
        def opening(p: real, theta: real, c: Constants) -> real:
            return wp.pow(real(1.0) + p / c.B, -real(1.0) / c.gamma)

        return Equation(pressure, energy, modulus, opening)
