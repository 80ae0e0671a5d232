"""Dual divergence (M5): the exact adjoint of the corrected gradient."""

import functools

import warp as wp

from ..fields import neighbour_structure, structure
from ..space import Space, difference
from .row_sums import flux_sum


@functools.cache
def make_divergence(space: Space, simd: bool = False) -> wp.Kernel:
    """Kernel: −T_a = V_a Σ_b V_b g_ab (Π_a + Π_b) ξ with Π = Q Lᵀ (M5); sums to zero over all particles.

    ξ joins the balanced positions of the particles (M13), their positions where nothing is balanced.
    """
    vec, mat = space.vec, space.mat
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    sum_of = flux_sum(space, simd)

    @wp.kernel(module="unique", enable_backward=False)
    def divergence(
        first: int, reference: Reference, near: Neighbours, Pi: wp.array(dtype=mat), out: wp.array(dtype=vec)
    ):
        a = first + wp.tid()
        out[a] = sum_of(a, near, Pi, reference.balanced) * reference.V[a]

    return divergence


@functools.cache
def make_tilted_divergence(space: Space) -> wp.Kernel:
    """Kernel: −T_a = V_a Σ_b V_b g_ab (t_ab Π_a + t_ba Π_b) ξ, tilted (M17); its Σ t_ab w_ab ξ is known."""
    vec, mat = space.vec, space.mat
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    separation = difference(space)

    @wp.kernel(module="unique", enable_backward=False)
    def tilted_divergence(
        first: int, reference: Reference, near: Neighbours, Pi: wp.array(dtype=mat), out: wp.array(dtype=vec)
    ):
        a = first + wp.tid()
        x_a = reference.x[a]
        total = Pi[a] @ reference.moment[a]
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            dual = near.w[k] + (near.w[k] - near.own[k])
            total += Pi[b] @ (separation(reference.x[b], x_a, near.box) * dual)
        out[a] = total * reference.V[a]

    return tilted_divergence
