"""Neo-Hookean solid in ln J, without isochoric split."""

import functools
from dataclasses import dataclass

import warp as wp

from ..linalg import det, inverse, stretch_bounds
from ..space import Space
from .base import Isotropic, Law


@dataclass(frozen=True, kw_only=True)
class NeoHookeanLog(Isotropic):
    """Ψ = μ/2 (F:F − 3) − μ ln J + λ/2 (ln J)², P = μ (F − F⁻ᵀ) + λ ln J F⁻ᵀ (Bonet & Wood, 2008, §6.4.3).

    Args:
        density: initial density [kg/m³].
        young: Young's modulus [Pa].
        poisson: Poisson's ratio, in (−1, 0.5).
    """

    def law(self, space: Space) -> Law:
        return _law(space)


@functools.cache
def _law(space: Space) -> Law:
    real, mat, pair = space.real, space.mat, space.row(2)
    determinant, invert, bounds = det(space), inverse(space), stretch_bounds(space)
    dim = float(space.dim)

    @wp.struct
    class Constants:
        mu: real
        lam: real

    @wp.func
    def stress(F: mat, c: Constants) -> mat:
        return F * c.mu + wp.transpose(invert(F)) * (c.lam * wp.log(determinant(F)) - c.mu)

    @wp.func
    def energy(F: mat, c: Constants) -> real:
        log_J = wp.log(determinant(F))
        return real(0.5) * c.mu * (wp.ddot(F, F) - real(dim)) + log_J * (real(0.5) * c.lam * log_J - c.mu)

    @wp.func
    def wave_moduli(F: mat, c: Constants) -> pair:
        # Q(n) = μ (n·b n) I + [μ + λ (1 − ln J)] n⊗n
        shear = c.mu * bounds(F)[1]
        stiffening = c.mu + c.lam * (real(1.0) - wp.log(determinant(F)))
        return pair(shear + wp.max(stiffening, real(0.0)), shear)

    return Law(Constants, stress, energy, wave_moduli)
