"""Neo-Hookean solid with isochoric–volumetric split."""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..linalg import cofactor, det, stretch_bounds
from ..space import Space
from .base import Isotropic, Law, isochoric, lame_constants, largest_eigenvalue


@dataclass(frozen=True, kw_only=True)
class NeoHookean(Isotropic):
    """Ψ = μ/2 (J^(−2/3) F:F − 3) + κ/2 (J − 1)², Bonet & Wood (2008).

    Args:
        density: initial density [kg/m³].
        young: Young's modulus [Pa].
        poisson: Poisson's ratio, in (−1, 0.5).
    """

    def constants(self) -> dict[str, float]:
        mu, kappa = lame_constants(self.young, self.poisson)
        return {"mu": mu, "kappa": kappa}

    def law(self, space: Space) -> Law:
        return _law(space)


@functools.cache
def _law(space: Space) -> Law:
    real = space.real

    @wp.func
    def volumetric_energy(J: real) -> real:
        return real(0.5) * (J - real(1.0)) * (J - real(1.0))

    @wp.func
    def pressure_slope(J: real) -> real:
        return J - real(1.0)

    @wp.func
    def volumetric_modulus(J: real) -> real:
        return J * J

    return isochoric_neo_hookean(space, volumetric_energy, pressure_slope, volumetric_modulus)


def isochoric_neo_hookean(space: Space, volumetric_energy: Any, pressure_slope: Any, volumetric_modulus: Any) -> Law:
    """Law of Ψ = μ/2 (J^(−2/3) F:F − 3) + κ U(J).

    Args:
        space: dimension and precision.
        volumetric_energy: ``wp.func`` J -> U.
        pressure_slope: ``wp.func`` J -> U'.
        volumetric_modulus: ``wp.func`` J -> J² U''.
    """
    real, mat, pair = space.real, space.mat, space.row(2)
    determinant, cof, bounds = det(space), cofactor(space), stretch_bounds(space)
    coupled, shape_factor = largest_eigenvalue(real), isochoric(real)
    missing = float(3 - space.dim)  # stretches that are held at one
    third = 1.0 / 3.0

    @wp.struct
    class Constants:
        mu: real
        kappa: real

    @wp.func
    def stress(F: mat, c: Constants) -> mat:
        J = determinant(F)
        mu = c.mu * shape_factor(J)
        F_F = wp.ddot(F, F) + real(missing)
        return F * mu + cof(F) * (c.kappa * pressure_slope(J) - mu * real(third) / J * F_F)

    @wp.func
    def energy(F: mat, c: Constants) -> real:
        J = determinant(F)
        F_F = wp.ddot(F, F) + real(missing)
        shape = real(0.5) * c.mu * (shape_factor(J) * F_F - real(3.0))
        return shape + c.kappa * volumetric_energy(J)

    @wp.func
    def wave_moduli(F: mat, c: Constants) -> pair:
        # m·Q m = μ J^(−2/3) [5/9 s² tr b − 4/3 s m·b n + n·b n] + κ J² U'' s², s = m·n; in the plane of n and a
        # perpendicular p a 2×2 matrix whose entries are bounded one by one, |p·b n| ≤ (b_max − b_min)/2.
        J = determinant(F)
        mu = c.mu * shape_factor(J)
        trace = wp.ddot(F, F) + real(missing)
        b_range = bounds(F)
        along = mu * (real(5.0) / real(9.0) * trace - real(third) * b_range[0]) + c.kappa * volumetric_modulus(J)
        across = mu * b_range[1]
        mixed = mu * real(third) * (b_range[1] - b_range[0])
        return pair(coupled(along, mixed, across), across)

    return Law(Constants, stress, energy, wave_moduli)
