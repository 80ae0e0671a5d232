"""Corrected values of the weights: W̃_b(x_a) = α_a (1 + β_a·(x_a − x_b)) W_ab (docs/method.md §2)."""

import functools
from abc import ABC
from dataclasses import dataclass
from typing import ClassVar

import warp as wp

from ..fields import neighbour_structure, structure
from ..space import Space, difference
from ..weights import Weight
from ..weights.base import value
from .correction import corrected_inverse


class Values(ABC):
    """Which fields the corrected values reproduce."""

    #: Linear fields are reproduced too.
    linear: ClassVar[bool]


@dataclass(frozen=True)
class Shepard(Values):
    """Constants are reproduced, β = 0; values stay positive."""

    linear = False


@dataclass(frozen=True)
class Linear(Values):
    """Linear fields are reproduced; values near boundaries may be negative."""

    linear = True


@functools.cache
def make_value_correction(weight: Weight, space: Space, linear: bool) -> wp.Kernel:
    """Kernel: α_a [-] and β_a [1/m] such that Σ_b V_b W̃_b(x_a) (1, x_a − x_b) = (1, 0); β = 0 unless ``linear``.

    With the moments M_k = Σ_b V_b W_ab (x_a − x_b)^⊗k: β = −M_2⁻¹ M_1, α = 1/(M_0 + β·M_1), which is positive.
    The sums include a itself, directions without neighbours keep β = 0.
    """
    real, vec, mat = space.real, space.vec, space.mat
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    separation, W_of, invert = difference(space), value(weight, space), corrected_inverse(space)

    @wp.kernel(module="unique", enable_backward=False)
    def value_correction(
        first: int,
        reference: Reference,
        near: Neighbours,
        alpha: wp.array(dtype=real),
        beta: wp.array(dtype=vec),
    ):
        a = first + wp.tid()
        x_a = reference.x[a]
        h_a = reference.h[a]
        M_0 = reference.V[a] * W_of(real(0.0), h_a)
        M_1 = vec()
        M_2 = mat()
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            # In units of h, so that the cut-off of the inverse is dimensionless
            offset = separation(x_a, reference.x[b], near.box) / h_a
            VW = reference.V[b] * W_of(wp.length(offset) * h_a, real(0.5) * (h_a + reference.h[b]))
            M_0 += VW
            M_1 += offset * VW
            M_2 += wp.outer(offset, offset) * VW
        slope = vec()
        if wp.static(linear):
            L, _ = invert(M_2 / M_0)
            slope = -(L @ (M_1 / M_0))
        alpha[a] = real(1.0) / (M_0 + wp.dot(slope, M_1))
        beta[a] = slope / h_a

    return value_correction


@functools.cache
def corrected_value(space: Space) -> wp.Function:
    """``wp.func`` W̃_b(x_c) = α_c (1 + β_c·(x_c − x_b)) W_cb [1/m^d]."""
    real, vec = space.real, space.vec

    @wp.func
    def corrected_value(alpha: real, beta: vec, offset: vec, W: real) -> real:
        return alpha * (real(1.0) + wp.dot(beta, offset)) * W

    return corrected_value
