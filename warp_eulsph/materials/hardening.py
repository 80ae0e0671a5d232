"""Yield stress as a function of equivalent plastic strain, its rate, and temperature."""

import functools
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from .base import positive


@dataclass(frozen=True, kw_only=True)
class Hardening(ABC):
    """Yield stress y(α, α̇, T) [Pa] that does not fall with α or α̇, or by less than 3 μ."""

    #: Plastic work heats: there is a temperature.
    heats: ClassVar[bool] = False

    def heat(self, density: float) -> tuple[float, float]:
        """Temperature at the start [K], and its rise per plastic work per initial volume [K m³/J]."""
        return 0.0, 0.0

    @abstractmethod
    def constants(self) -> dict[str, Any]:
        """Numbers and tuples of numbers, fields of the constants that ``make_yield_stress`` reads."""

    @staticmethod
    @abstractmethod
    def make_yield_stress(real: type, Constants: Any) -> Any:
        """``wp.func`` (α, α̇ [1/s], T [K], constants) -> y [Pa]."""


def not_negative(name: str, value: float, unit: str) -> None:
    """Raise unless ``value`` is finite and zero or more."""
    if not (math.isfinite(value) and value >= 0.0):
        raise ValueError(f"{name} must be zero or positive and finite, got {value}; give it in {unit}")


@dataclass(frozen=True, kw_only=True)
class LinearHardening(Hardening):
    """y = y₀ + H α.

    Args:
        yield_stress: y₀ [Pa].
        modulus: H [Pa]; 0 is perfect plasticity.
    """

    yield_stress: float
    modulus: float = 0.0

    def __post_init__(self) -> None:
        positive("yield_stress", self.yield_stress, "Pa")
        not_negative("modulus", self.modulus, "Pa")

    def constants(self) -> dict[str, Any]:
        return {"y0": self.yield_stress, "H": self.modulus}

    @staticmethod
    @functools.cache
    def make_yield_stress(real: type, Constants: Any) -> wp.Function:
        @wp.func
        def linear(alpha: real, rate: real, T: real, c: Constants) -> real:
            return c.y0 + c.H * alpha

        return linear


@dataclass(frozen=True, kw_only=True)
class Voce(Hardening):
    """y = y₀ + Q (1 − e^(−b α)) + H α, which saturates where H = 0 (Voce 1948).

    Args:
        yield_stress: y₀ [Pa].
        saturation: Q [Pa].
        rate: b [-], of saturation per plastic strain.
        modulus: H [Pa].
    """

    yield_stress: float
    saturation: float
    rate: float
    modulus: float = 0.0

    def __post_init__(self) -> None:
        positive("yield_stress", self.yield_stress, "Pa")
        not_negative("saturation", self.saturation, "Pa")
        positive("rate", self.rate, "1")
        not_negative("modulus", self.modulus, "Pa")

    def constants(self) -> dict[str, Any]:
        return {"y0": self.yield_stress, "Q": self.saturation, "b": self.rate, "H": self.modulus}

    @staticmethod
    @functools.cache
    def make_yield_stress(real: type, Constants: Any) -> wp.Function:
        @wp.func
        def voce(alpha: real, rate: real, T: real, c: Constants) -> real:
            return c.y0 + c.Q * (real(1.0) - wp.exp(-c.b * alpha)) + c.H * alpha

        return voce


@dataclass(frozen=True, kw_only=True)
class Tabulated(Hardening):
    """y by linear interpolation in measured points, constant beyond the last.

    Args:
        strains: equivalent plastic strains α, from 0, increasing, (k,).
        stresses: yield stresses there [Pa], positive, not falling, (k,).
    """

    strains: Sequence[float]
    stresses: Sequence[float]

    def __post_init__(self) -> None:
        strains, stresses = (tuple(float(v) for v in given) for given in (self.strains, self.stresses))
        object.__setattr__(self, "strains", strains)
        object.__setattr__(self, "stresses", stresses)
        steps = np.diff(strains)
        if not (2 <= len(strains) <= 64 and strains[0] == 0.0 and (steps > 0.0).all() and math.isfinite(strains[-1])):
            raise ValueError(f"strains must be 2 to 64 numbers that increase from 0, got {strains}")
        if len(stresses) != len(strains) or not (stresses[0] > 0.0 and (np.diff(stresses) >= 0.0).all()):
            raise ValueError(f"stresses must be {len(strains)} positive numbers [Pa] that do not fall, got {stresses}")
        positive("the last of stresses", stresses[-1], "Pa")

    def constants(self) -> dict[str, Any]:
        return {"strains": self.strains, "stresses": self.stresses}

    @staticmethod
    @functools.cache
    def make_yield_stress(real: type, Constants: Any) -> wp.Function:
        count = int(Constants.vars["strains"].type._length_)

        @wp.func
        def tabulated(alpha: real, rate: real, T: real, c: Constants) -> real:
            y = c.stresses[0]
            intervals = int(count - 1)  # not unrolled
            for k in range(intervals):
                share = (alpha - c.strains[k]) / (c.strains[k + 1] - c.strains[k])
                y += wp.clamp(share, real(0.0), real(1.0)) * (c.stresses[k + 1] - c.stresses[k])
            return y

        return tabulated


@dataclass(frozen=True, kw_only=True)
class JohnsonCook(Hardening):
    """y = (A + B αⁿ)(1 + C ln max(α̇/ε̇₀, 1))(1 − T*ᵐ), T* = (T − T_r)/(T_m − T_r) in [0, 1] (Johnson & Cook 1983).

    No heat is conducted: T rises by ``taylor_quinney`` times the plastic work over ρ₀ c_p. Steps take T of their start.

    Args:
        A: yield stress at the reference rate and temperature [Pa].
        B: hardening [Pa].
        n: exponent of hardening.
        C: sensitivity to the rate.
        reference_rate: ε̇₀ [1/s].
        m: exponent of softening.
        temperature: at the start [K].
        melting: T_m [K].
        specific_heat: c_p [J/(kg K)].
        taylor_quinney: share of the plastic work that becomes heat; 0 is isothermal.
        reference_temperature: T_r [K], at which A and B were measured; None is that at the start.
    """

    A: float
    B: float
    n: float
    C: float = 0.0
    reference_rate: float = 1.0
    m: float = 1.0
    temperature: float = 293.0
    melting: float = 1356.0
    specific_heat: float = 383.0
    taylor_quinney: float = 0.9
    reference_temperature: float | None = None
    heats: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for name, unit in (("A", "Pa"), ("n", "1"), ("reference_rate", "1/s"), ("m", "1"), ("temperature", "K")):
            positive(name, getattr(self, name), unit)
        for name, unit in (("B", "Pa"), ("C", "1")):
            not_negative(name, getattr(self, name), unit)
        positive("specific_heat", self.specific_heat, "J/(kg K)")
        if not (math.isfinite(self.melting) and self.melting > self.temperature):
            raise ValueError(f"melting must be finite and above temperature = {self.temperature} K, got {self.melting}")
        if self.reference_temperature is not None:
            positive("reference_temperature", self.reference_temperature, "K")
            if self.melting <= self.reference_temperature:
                raise ValueError(f"melting = {self.melting} K must be above reference_temperature")
        if not 0.0 <= self.taylor_quinney <= 1.0:
            raise ValueError(f"taylor_quinney must be in [0, 1], got {self.taylor_quinney}; 0.9 is usual for metals")

    def heat(self, density: float) -> tuple[float, float]:
        return self.temperature, self.taylor_quinney / (density * self.specific_heat)

    def constants(self) -> dict[str, Any]:
        reference = self.temperature if self.reference_temperature is None else self.reference_temperature
        names = ("A", "B", "n", "C", "reference_rate", "m")
        found = {name: getattr(self, name) for name in names}
        return found | {"temperature": reference, "range": self.melting - reference}

    @staticmethod
    @functools.cache
    def make_yield_stress(real: type, Constants: Any) -> wp.Function:
        @wp.func
        def johnson_cook(alpha: real, rate: real, T: real, c: Constants) -> real:
            hot = wp.clamp((T - c.temperature) / c.range, real(0.0), real(1.0))
            faster = real(1.0) + c.C * wp.log(wp.max(rate / c.reference_rate, real(1.0)))
            return (c.A + c.B * wp.pow(alpha, c.n)) * faster * (real(1.0) - wp.pow(hot, c.m))

        return johnson_cook
