"""Saint Venant–Kirchhoff solid: Hooke's law between the material strain and stress."""

import functools
from dataclasses import dataclass

import warp as wp

from ..linalg import stretch_bounds
from ..space import Space
from .base import Isotropic, Law


@dataclass(frozen=True, kw_only=True)
class SaintVenantKirchhoff(Isotropic):
    """P = F S, S = λ tr(E) I + 2μ E, E = ½ (FᵀF − I); large rotations, moderate strains (it softens in compression).

    Args:
        density: initial density [kg/m³].
        young: Young's modulus [Pa].
        poisson: Poisson's ratio, in (−1, 0.5).
    """

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
        return (wp.transpose(F) @ F - wp.identity(n=wp.static(dim), dtype=real)) * real(0.5)

    @wp.func
    def stress(F: mat, c: Constants) -> mat:
        E = strain(F)
        return F @ (wp.identity(n=wp.static(dim), dtype=real) * (c.lam * wp.trace(E)) + E * (real(2.0) * c.mu))

    @wp.func
    def energy(F: mat, c: Constants) -> real:
        E = strain(F)
        return real(0.5) * c.lam * wp.trace(E) * wp.trace(E) + c.mu * wp.ddot(E, E)

    @wp.func
    def wave_moduli(F: mat, c: Constants) -> pair:
        # m·Q m = n·τ n + (λ + μ)(m·b n)² + μ (m·b m)(n·b n), τ = λ tr(E) b + μ (b² − b), whose largest value is at one
        # end of the range of b because τ is convex in it. Along the principal directions i, k of b the shear modulus is
        # (τ_i − τ_k)/(b_i − b_k) b_i = [λ tr(E) + μ (b_i + b_k − 1)] b_i.
        b = bounds(F)
        pre = c.lam * wp.trace(strain(F)) - c.mu
        tension = wp.max((pre + c.mu * b[0]) * b[0], (pre + c.mu * b[1]) * b[1])
        shear = wp.max(pre + real(2.0) * c.mu * b[1], real(0.0))
        return pair(tension + (c.lam + real(2.0) * c.mu) * b[1] * b[1], shear * b[1])

    return Law(Constants, stress, energy, wave_moduli)
