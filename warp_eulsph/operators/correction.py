"""Pair weights and the gradient correction L_a = K_a⁻¹ (M3), with its fall-back for poor neighbourhoods."""

import functools
from typing import Any

import warp as wp

from ..fields import neighbour_structure, structure
from ..linalg import inverse, symmetric_bounds, symmetric_eigen
from ..space import Space, difference
from ..weights import Weight
from ..weights.base import pair_weight

# K is the identity where the neighbourhood is full and about a half at flat surfaces. Along a direction in which it
# keeps less than this share, differences carry no usable slope and the gradient's component there is set to zero.
CUTOFF = 0.02


@functools.cache
def make_pair_sums(weight: Weight, space: Space) -> Any:
    """Kernel: g_ab of every pair, K_a = Σ V_b g ξ⊗ξ (M3, ξ = x_b − x_a) and the mass sum of M7."""
    real, mat = space.real, space.mat
    Particles, Reference, Neighbours = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        neighbour_structure(space),
    )
    separation, g_of = difference(space), pair_weight(weight, space)

    @wp.kernel(module="unique", enable_backward=False)
    def pair_sums(particles: Particles, reference: Reference, near: Neighbours, K: wp.array(dtype=mat)):
        a = wp.tid()
        x_a = reference.x[a]
        h_a = reference.h[a]
        K_a = mat()
        row = real(0.0)
        for k in range(near.start[a], near.start[a + 1]):
            b = near.index[k]
            xi = separation(reference.x[b], x_a, near.box)
            g = g_of(wp.length(xi), real(0.5) * (h_a + reference.h[b]))
            near.g[k] = g
            K_a += wp.outer(xi, xi) * (reference.V[b] * g)
            row += particles.mass[b] * g
        K[a] = K_a
        reference.row[a] = row

    return pair_sums


@functools.cache
def corrected_inverse(space: Space) -> Any:
    """``wp.func`` K⁻¹, the pseudo-inverse where an eigenvalue of K is below ``CUTOFF``."""
    real, mat, dim = space.real, space.mat, space.dim
    invert, bounds, eigen = inverse(space), symmetric_bounds(space), symmetric_eigen(space)

    @wp.func
    def corrected_inverse(K: mat) -> mat:
        L = mat()
        if bounds(K)[0] >= real(CUTOFF):
            L = invert(K)
        else:
            R, values = eigen(K)
            for i in range(wp.static(dim)):
                if values[i] >= real(CUTOFF):
                    axis = wp.transpose(R)[i]
                    L += wp.outer(axis, axis) / values[i]
        return L

    return corrected_inverse


@functools.cache
def make_correct(space: Space) -> Any:
    """Kernel: L_a from K_a (M3), and ``poor``: directions in which a particle fell back."""
    real, mat, dim = space.real, space.mat, space.dim
    Reference = structure(space, "Reference")
    invert, bounds, eigen = corrected_inverse(space), symmetric_bounds(space), symmetric_eigen(space)

    @wp.kernel(module="unique", enable_backward=False)
    def correct(K: wp.array(dtype=mat), reference: Reference, poor: wp.array(dtype=wp.int32)):
        a = wp.tid()
        reference.L[a] = invert(K[a])
        lacking = int(0)
        if bounds(K[a])[0] < real(CUTOFF):
            _, values = eigen(K[a])
            for i in range(wp.static(dim)):
                if values[i] < real(CUTOFF):
                    lacking += 1
        poor[a] = lacking

    return correct
