"""Weakly compressible liquid: pressure from the change of volume only."""

import functools
import math
from dataclasses import dataclass
from typing import ClassVar

import warp as wp

from ..linalg import cofactor, det
from ..space import Space
from .base import Law, Material, positive


@dataclass(frozen=True, kw_only=True)
class TaitLiquid(Material):
    """p = B (J^(−γ) − 1), B = ρ0 c0²/γ; no shear stress. It carries F = J^(1/d) I, so shear never piles up in F.

    Args:
        density: initial density [kg/m³].
        sound_speed: c0 at the initial density [m/s]; 10 times the largest velocity keeps J within 1 %.
        gamma: exponent γ > 1, 7 for water.
    """

    sound_speed: float
    gamma: float = 7.0
    flows: ClassVar[bool] = True
    forgets: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("sound_speed", self.sound_speed, "m/s")
        if not (math.isfinite(self.gamma) and self.gamma > 1.0):
            raise ValueError(f"gamma must be greater than 1 and finite, got {self.gamma}; 7 is water")

    def constants(self) -> dict[str, float]:
        return {"B": self.density * self.sound_speed**2 / self.gamma, "gamma": self.gamma}

    def law(self, space: Space) -> Law:
        return _law(space)


@functools.cache
def _law(space: Space) -> Law:
    dim, real, mat, pair = space.dim, space.real, space.mat, space.row(2)
    determinant, cof = det(space), cofactor(space)
    root = 1.0 / space.dim

    @wp.struct
    class Constants:
        B: real
        gamma: real

    @wp.func
    def stress(F: mat, c: Constants) -> mat:
        return cof(F) * (-c.B * (wp.pow(determinant(F), -c.gamma) - real(1.0)))

    @wp.func
    def energy(F: mat, c: Constants) -> real:
        J = determinant(F)
        compression = (wp.pow(J, real(1.0) - c.gamma) - real(1.0)) / (c.gamma - real(1.0))
        return c.B * (compression + J - real(1.0))

    @wp.func
    def wave_moduli(F: mat, c: Constants) -> pair:
        return pair(c.B * c.gamma * wp.pow(determinant(F), real(1.0) - c.gamma), real(0.0))

    @wp.func
    def update(F: mat, c: Constants) -> mat:
        return wp.identity(n=wp.static(dim), dtype=real) * wp.pow(determinant(F), real(root))

    return Law(Constants, stress, energy, wave_moduli, update)
