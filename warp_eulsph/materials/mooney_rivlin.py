"""Mooney–Rivlin rubber with isochoric–volumetric split."""

import functools
import math
from dataclasses import dataclass

import warp as wp

from ..linalg import cofactor, det, stretch_bounds
from ..space import Space
from .base import Law, Material, isochoric, largest_eigenvalue, positive


@dataclass(frozen=True, kw_only=True)
class MooneyRivlin(Material):
    """Ψ = c10 (J^(−2/3) I1 − 3) + c01 (J^(−4/3) I2 − 3) + κ/2 (J − 1)²; the initial shear modulus is 2 (c10 + c01).

    Args:
        density: initial density [kg/m³].
        c10: coefficient of the first invariant [Pa].
        c01: coefficient of the second invariant [Pa], zero or more (a negative one may lose ellipticity).
        bulk: bulk modulus κ [Pa].
    """

    c10: float
    c01: float
    bulk: float

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("c10", self.c10, "Pa")
        positive("bulk", self.bulk, "Pa")
        if not (math.isfinite(self.c01) and self.c01 >= 0.0):
            raise ValueError(f"c01 must be zero or positive and finite, got {self.c01} Pa; 0 is neo-Hookean")

    def constants(self) -> dict[str, float]:
        return {"c10": self.c10, "c01": self.c01, "kappa": self.bulk}

    def law(self, space: Space) -> Law:
        return _law(space)


@functools.cache
def _law(space: Space) -> Law:
    real, mat, vec2 = space.real, space.mat, space.row(2)
    determinant, cof, bounds = det(space), cofactor(space), stretch_bounds(space)
    coupled, shape_factor = largest_eigenvalue(real), isochoric(real)
    missing = float(3 - space.dim)  # stretches that are held at one

    @wp.struct
    class Constants:
        c10: real
        c01: real
        kappa: real

    @wp.func
    def invariants(b: mat) -> vec2:
        first = wp.trace(b) + real(missing)
        return vec2(first, real(0.5) * (first * first - wp.ddot(b, b) - real(missing)))

    @wp.func
    def stress(F: mat, c: Constants) -> mat:
        J = determinant(F)
        b = F @ wp.transpose(F)
        I = invariants(b)  # noqa: E741 (the invariants I1, I2)
        factor = shape_factor(J)
        a1, a2 = c.c10 * factor, c.c01 * factor * factor
        shape = F * (real(2.0) * (a1 + a2 * I[0])) - (b @ F) * (real(2.0) * a2)
        mean = (a1 * I[0] + real(2.0) * a2 * I[1]) * (real(2.0) / real(3.0)) / J
        return shape + cof(F) * (c.kappa * (J - real(1.0)) - mean)

    @wp.func
    def energy(F: mat, c: Constants) -> real:
        J = determinant(F)
        I = invariants(F @ wp.transpose(F))  # noqa: E741
        factor = shape_factor(J)
        shape = c.c10 * (factor * I[0] - real(3.0)) + c.c01 * (factor * factor * I[1] - real(3.0))
        return shape + real(0.5) * c.kappa * (J - real(1.0)) * (J - real(1.0))

    @wp.func
    def wave_moduli(F: mat, c: Constants) -> vec2:
        # With s = m·n and B = cof F cof Fᵀ: m·Q m = c10 J^(−2/3) [10/9 s² I1 − 8/3 s m·b n + 2 n·b n]
        # + c01 J^(−4/3) [−2/9 s² I2 + 4/3 s m·B n + 2 m·B m] + κ J² s²; entries bounded as in NeoHookean.
        J = determinant(F)
        I = invariants(F @ wp.transpose(F))  # noqa: E741
        q, p = bounds(F), bounds(cof(F))
        factor = shape_factor(J)
        a1, a2 = c.c10 * factor, c.c01 * factor * factor
        along = a1 * (real(10.0) * I[0] - real(6.0) * q[0]) + a2 * (real(30.0) * p[1] - real(2.0) * I[1])
        along = along / real(9.0) + c.kappa * J * J
        across = real(2.0) * (a1 * q[1] + a2 * p[1])
        mixed = real(2.0) / real(3.0) * (a1 * (q[1] - q[0]) + real(2.0) * a2 * (p[1] - p[0]))
        return vec2(coupled(along, mixed, across), across)

    return Law(Constants, stress, energy, wave_moduli)
