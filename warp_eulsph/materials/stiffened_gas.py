"""Stiffened gas: a gas under a pressure of its own, which makes it a liquid that can be heated."""

import functools
import math
from dataclasses import dataclass
from typing import Any, ClassVar

import warp as wp

from .base import Variable
from .fluid import Equation, Fluid

ADIABAT = Variable("adiabat", "-", "(p + p_oo) J^γ over its value at the start, exp((s - s_0)/c_v)", 1.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class StiffenedGas(Fluid):
    """p = (γ − 1) ρ e − γ p∞ (Harlow & Amsden 1971); on an isentrope p + p∞ goes with J^(−γ).

    Its history: ``adiabat``, the isentrope it is on, which heat raises. What is stored is the internal energy per
    initial volume, less γ p∞/(γ − 1).

    Args:
        density: initial density [kg/m³].
        gamma: exponent γ > 1.
        stiffness: p∞ [Pa].
        pressure: p at the start [Pa], above −p∞.
        viscosity, cavitation: as in ``Fluid``.
    """

    gamma: float
    stiffness: float
    pressure: float
    variable: ClassVar[Variable | None] = ADIABAT

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (math.isfinite(self.gamma) and self.gamma > 1.0):
            raise ValueError(f"gamma must be greater than 1 and finite, got {self.gamma}; air has 1.4, water 4.4")
        if not (math.isfinite(self.stiffness) and self.stiffness >= 0.0):
            raise ValueError(f"stiffness must be zero or positive and finite, got {self.stiffness} Pa; 0 is a gas")
        if not (math.isfinite(self.pressure) and self.pressure > -self.stiffness):
            raise ValueError(f"pressure must be finite and above {-self.stiffness:g} Pa, got {self.pressure}")
        if self.cavitation is not None and not -self.stiffness < self.cavitation <= self.pressure:
            raise ValueError(
                f"cavitation must be in ({-self.stiffness:g}, pressure = {self.pressure:g}] Pa, got {self.cavitation}"
            )

    def state(self) -> dict[str, float]:
        total = self.pressure + self.stiffness
        return {"gamma": self.gamma, "stiffness": self.stiffness, "total": total, "start": self.pressure}

    @staticmethod
    @functools.cache
    def make_equation(real: type, Constants: Any) -> Equation:
        @wp.func
        def pressure(J: real, theta: real, c: Constants) -> real:
            return c.total * theta * wp.pow(J, -c.gamma) - c.stiffness

        @wp.func
        def energy(J: real, theta: real, c: Constants) -> real:
            # less what a stiffened gas has of stiffness alone at the start, which would drown the rest
            gained = c.total * (theta * wp.pow(J, real(1.0) - c.gamma) - real(1.0)) + c.start
            return gained / (c.gamma - real(1.0)) + c.stiffness * (J - real(1.0))

        @wp.func
        def modulus(J: real, theta: real, c: Constants) -> real:
            return c.gamma * c.total * theta * wp.pow(J, real(1.0) - c.gamma)

        @wp.func
        def opening(p: real, theta: real, c: Constants) -> real:
            return wp.pow(c.total * theta / (p + c.stiffness), real(1.0) / c.gamma)

        @wp.func
        def heat(J: real, c: Constants) -> real:
            return (c.gamma - real(1.0)) * wp.pow(J, c.gamma - real(1.0)) / c.total

        return Equation(pressure, energy, modulus, opening, heat)


@dataclass(frozen=True, kw_only=True)
class IdealGas(StiffenedGas):
    """p = (γ − 1) ρ e: a stiffened gas without stiffness.

    Args:
        density: initial density [kg/m³].
        gamma: ratio of the specific heats γ > 1, 1.4 for air.
        pressure: p at the start [Pa], positive.
        viscosity, cavitation: as in ``Fluid``.
    """

    gamma: float = 1.4
    stiffness: float = 0.0

    def __post_init__(self) -> None:
        if self.stiffness != 0.0:
            raise ValueError(f"stiffness of an ideal gas must be 0, got {self.stiffness} Pa; StiffenedGas takes one")
        super().__post_init__()
