"""Neo-Hookean solid with isochoric–volumetric split."""

import functools
from dataclasses import dataclass

import warp as wp

from ..linalg import cofactor, det, symmetric_bounds
from ..space import Space
from .base import Law, Material, lame_constants


@dataclass(frozen=True, kw_only=True)
class NeoHookean(Material):
    """Ψ = μ/2 (J^(−2/3) F:F − 3) + κ/2 (J − 1)², Bonet & Wood (2008); BENCHMARKS' NHiso.

    Args:
        density: initial density [kg/m³].
        young: Young's modulus [Pa].
        poisson: Poisson's ratio, in (−1, 0.5).
    """

    young: float
    poisson: float

    def __post_init__(self) -> None:
        super().__post_init__()
        lame_constants(self.young, self.poisson)

    def constants(self) -> dict[str, float]:
        mu, kappa = lame_constants(self.young, self.poisson)
        return {"mu": mu, "kappa": kappa}

    def law(self, space: Space) -> Law:
        return _law(space)


@functools.cache
def _law(space: Space) -> Law:
    real, mat, pair = space.real, space.mat, space.row(2)
    determinant, cof, eigen_bounds = det(space), cofactor(space), symmetric_bounds(space)
    missing = float(3 - space.dim)  # stretches that are held at one

    @wp.struct
    class Constants:
        mu: real
        kappa: real

    @wp.func
    def stress(F: mat, c: Constants) -> mat:
        J = determinant(F)
        isochoric = wp.pow(J, real(-2.0) / real(3.0))
        F_F = wp.ddot(F, F) + real(missing)
        return F * (c.mu * isochoric) + cof(F) * (c.kappa * (J - real(1.0)) - c.mu / real(3.0) * isochoric / J * F_F)

    @wp.func
    def energy(F: mat, c: Constants) -> real:
        J = determinant(F)
        F_F = wp.ddot(F, F) + real(missing)
        shape = real(0.5) * c.mu * (wp.pow(J, real(-2.0) / real(3.0)) * F_F - real(3.0))
        return shape + real(0.5) * c.kappa * (J - real(1.0)) * (J - real(1.0))

    @wp.func
    def wave_moduli(F: mat, c: Constants) -> pair:
        J = determinant(F)
        b = wp.pow(J, real(-2.0) / real(3.0)) * (F @ wp.transpose(F))
        trace = wp.trace(b) + wp.pow(J, real(-2.0) / real(3.0)) * real(missing)
        b_range = eigen_bounds(b)
        longitudinal = c.mu * (real(5.0) / real(9.0) * trace - b_range[0] / real(3.0)) + c.kappa * J * J
        return pair(longitudinal, c.mu * b_range[1])

    return Law(Constants, stress, energy, wave_moduli)
