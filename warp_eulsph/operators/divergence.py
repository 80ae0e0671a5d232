"""Dual divergence (M5): the exact adjoint of the corrected gradient."""

import functools
from typing import Any

import warp as wp

from ..fields import neighbour_structure, structure
from ..space import Space, difference


@functools.cache
def make_divergence(space: Space) -> Any:
    """Kernel: −T_a = V_a Σ_b V_b g_ab (Π_a + Π_b) ξ with Π = Q Lᵀ (M5); sums to zero over all particles.

    ξ joins the balanced positions of the particles (M13), their positions where nothing is balanced.
    """
    vec, mat = space.vec, space.mat
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    separation = difference(space)

    @wp.kernel(module="unique", enable_backward=False)
    def divergence(reference: Reference, near: Neighbours, Pi: wp.array(dtype=mat), out: wp.array(dtype=vec)):
        a = wp.tid()
        x_a = reference.balanced[a]
        Pi_a = Pi[a]
        force = vec()
        for k in range(near.start[a], near.start[a + 1]):
            b = near.index[k]
            xi = separation(reference.balanced[b], x_a, near.box)
            force += (Pi_a + Pi[b]) @ (xi * (reference.V[b] * near.g[k]))
        out[a] = force * reference.V[a]

    return divergence
