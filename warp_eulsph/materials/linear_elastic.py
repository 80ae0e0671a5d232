"""Hooke's law for small strains and rotations."""

import functools
from dataclasses import dataclass
from typing import ClassVar

import warp as wp

from ..linalg import stretch_bounds
from ..space import Space
from .base import Isotropic, Law


@dataclass(frozen=True, kw_only=True)
class LinearElastic(Isotropic):
    """P = λ tr(ε) I + 2μ ε, ε = sym(F − I). Uniaxial strain in 1-D; for a bar in uniaxial stress take ``Bar``.

    Args:
        density: initial density [kg/m³].
        young: Young's modulus [Pa].
        poisson: Poisson's ratio, in (−1, 0.5).
    """

    linear: ClassVar[bool] = True

    def law(self, space: Space) -> Law:
        return _law(space)


@functools.cache
def _law(space: Space) -> Law:
    dim, real, mat, pair = space.dim, space.real, space.mat, space.row(2)
    bounds = stretch_bounds(space)

    @wp.struct
    class Constants:
        mu: real
        lam: real

    @wp.func
    def strain(F: mat) -> mat:
        return (F + wp.transpose(F)) * real(0.5) - wp.identity(n=wp.static(dim), dtype=real)

    @wp.func
    def stress(F: mat, c: Constants) -> mat:
        e = strain(F)
        return wp.identity(n=wp.static(dim), dtype=real) * (c.lam * wp.trace(e)) + e * (real(2.0) * c.mu)

    @wp.func
    def energy(F: mat, c: Constants) -> real:
        e = strain(F)
        return real(0.5) * c.lam * wp.trace(e) * wp.trace(e) + c.mu * wp.ddot(e, e)

    @wp.func
    def wave_moduli(F: mat, c: Constants) -> pair:
        # Q(n) = μ |w|² I + (λ + μ) w⊗w, w = Fᵀn
        b_max = bounds(F)[1]
        return pair((c.lam + real(2.0) * c.mu) * b_max, c.mu * b_max)

    return Law(Constants, stress, energy, wave_moduli)
