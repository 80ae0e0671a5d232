"""Viscosity of fluids: σ = 2 η dev D beside the pressure, D = sym(∇v)."""

import functools
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import warp as wp

from .base import positive


@dataclass(frozen=True, kw_only=True)
class Viscosity(ABC):
    """Shear viscosity η(γ̇) [Pa s] of the rate of shear γ̇ = √(2 dev D : dev D) [1/s]; no bulk viscosity."""

    @abstractmethod
    def constants(self) -> dict[str, float]:
        """Numbers that ``make_viscosity`` reads, fields of its constants."""

    @property
    @abstractmethod
    def steepest(self) -> float:
        """Largest d(η γ̇)/dγ̇ over η: what the stable step is to be counted by."""

    @staticmethod
    @abstractmethod
    def make_viscosity(real: type, Constants: Any) -> Any:
        """``wp.func`` (γ̇ [1/s], constants) -> η [Pa s]."""


@dataclass(frozen=True, kw_only=True)
class Newtonian(Viscosity):
    """η constant.

    Args:
        viscosity: η [Pa s].
    """

    viscosity: float

    def __post_init__(self) -> None:
        positive("viscosity", self.viscosity, "Pa s")

    def constants(self) -> dict[str, float]:
        return {"eta": self.viscosity}

    @property
    def steepest(self) -> float:
        return 1.0

    @staticmethod
    @functools.cache
    def make_viscosity(real: type, Constants: Any) -> wp.Function:
        @wp.func
        def newtonian(rate: real, c: Constants) -> real:
            return c.eta

        return newtonian


@dataclass(frozen=True, kw_only=True)
class PowerLaw(Viscosity):
    """η = K γ̇^(n − 1), kept between two bounds (Ostwald 1925; de Waele 1923): n < 1 thins in shear, n > 1 thickens.

    Args:
        consistency: K [Pa s^n].
        exponent: n, positive.
        least: least η [Pa s].
        largest: largest η [Pa s], which a thinning fluid has at rest; the time step goes with it.
    """

    consistency: float
    exponent: float
    least: float = 0.0
    largest: float

    def __post_init__(self) -> None:
        positive("consistency", self.consistency, "Pa s^n")
        positive("exponent", self.exponent, "1")
        positive("largest", self.largest, "Pa s")
        if not (math.isfinite(self.least) and 0.0 <= self.least <= self.largest):
            raise ValueError(
                f"least must be in [0, largest = {self.largest}] Pa s, got {self.least}; 0 bounds nothing from below"
            )

    def constants(self) -> dict[str, float]:
        return {"K": self.consistency, "n": self.exponent, "eta_least": self.least, "eta_largest": self.largest}

    @property
    def steepest(self) -> float:
        return max(1.0, self.exponent)

    @staticmethod
    @functools.cache
    def make_viscosity(real: type, Constants: Any) -> wp.Function:
        @wp.func
        def power_law(rate: real, c: Constants) -> real:
            # A thinning fluid at rest: its largest viscosity, where the power has no value
            if rate == real(0.0) and c.n < real(1.0):
                return c.eta_largest
            return wp.clamp(c.K * wp.pow(rate, c.n - real(1.0)), c.eta_least, c.eta_largest)

        return power_law
