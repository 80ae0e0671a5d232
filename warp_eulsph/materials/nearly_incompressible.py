"""Neo-Hookean solid whose volumetric energy resists collapse and unbounded expansion, for ν → 1/2."""

import functools
from dataclasses import dataclass

import warp as wp

from ..space import Space
from .base import Law, Material, positive
from .neo_hookean import isochoric_neo_hookean


@dataclass(frozen=True, kw_only=True)
class NearlyIncompressible(Material):
    """Ψ = μ/2 (J^(−2/3) F:F − 3) + κ/4 (J² − 1 − 2 ln J), Simo & Taylor (1991); the energy is infinite at J = 0.

    Args:
        density: initial density [kg/m³].
        shear: shear modulus μ [Pa].
        bulk: bulk modulus κ [Pa]; the time step goes with 1/√κ, 100 μ to 1000 μ is nearly incompressible.
    """

    shear: float
    bulk: float

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("shear", self.shear, "Pa")
        positive("bulk", self.bulk, "Pa")

    def constants(self) -> dict[str, float]:
        return {"mu": self.shear, "kappa": self.bulk}

    def law(self, space: Space) -> Law:
        return _law(space)


@functools.cache
def _law(space: Space) -> Law:
    real = space.real

    @wp.func
    def volumetric_energy(J: real) -> real:
        return real(0.25) * (J * J - real(1.0) - real(2.0) * wp.log(J))

    @wp.func
    def pressure_slope(J: real) -> real:
        return real(0.5) * (J - real(1.0) / J)

    @wp.func
    def volumetric_modulus(J: real) -> real:
        return real(0.5) * (J * J + real(1.0))

    return isochoric_neo_hookean(space, volumetric_energy, pressure_slope, volumetric_modulus)
