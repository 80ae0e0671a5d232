"""Tilted pair weights: what free faces take from third moments, given back as far as the stable step bears (M17)."""

import functools
import math
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..fields import neighbour_structure, structure
from ..linalg import inverse, symmetric_eigen
from ..space import Space, difference


@dataclass(frozen=True)
class Tilt:
    """Pair weights of M3 and M4 times t_ab = exp(−μ_a·ξ/dx), their adjoint in M5 (M17): right answers when coarse.

    At a free face all neighbours lie on one side, and the corrected gradient reads tangential derivatives a fraction of
    a spacing inside: coarse bodies are soft in shear. μ_a takes as much of the third moment Σ_b w_ab t_ab |ξ|² ξ out of
    the weights as |μ_a| ≤ ``most`` lets it; all of it but in the outermost layer. Inside even arrangements it is zero.

    It acts where the arrangement does not move, at the price of one more number per pair.

    Args:
        most: largest |μ_a|. At 1.5 the highest frequency of a lattice is a seventh higher than without, and that of the
            poorest body, of strips and rods two particles thick, hardly: 0.81 of what the default step bears, 0.78
            without (``tests/test_tilt.py``). So the step stays as it is. At 2 jittered bodies become the poorest.
    """

    most: float = 1.5

    def __post_init__(self) -> None:
        if not (math.isfinite(self.most) and 0.0 < self.most <= 3.0):
            raise ValueError(
                f"the largest tilt must be in (0, 3], got {self.most}; 1.5 is the tested value, tilt=None has none"
            )


# Newton's rounds, and halvings of the multiplier in each, which leave 1e-6 of μ_a at most
ROUNDS, HALVINGS = 12, 40


@functools.cache
def _within(space: Space) -> wp.Function:
    """``wp.func`` (H, r, most) -> the μ with |μ| ≤ most that minimises ½ μ·H μ − r·μ, H positive semi-definite.

    (H + λ) μ = r with the multiplier λ ≥ 0 of the bound, found by bisection.
    """
    real, vec, mat, dim, eigen = space.real, space.vec, space.mat, space.dim, symmetric_eigen(space)

    @wp.func
    def within(H: mat, r: vec, most: real) -> vec:
        R, values = eigen(H)
        along = wp.transpose(R) @ r
        low, high = real(0.0), wp.length(r) / most  # at which |μ| ≤ most for sure
        for _ in range(wp.static(HALVINGS)):
            mean = real(0.5) * (low + high)
            size = real(0.0)
            for i in range(wp.static(dim)):
                part = along[i] / (values[i] + mean)
                size += part * part
            if size > most * most:
                low = mean
            else:
                high = mean
        mu = vec()
        for i in range(wp.static(dim)):
            mu[i] = along[i] / wp.max(values[i] + high, real(1e-30))
        return R @ mu

    return within


@functools.cache
def make_tilt(space: Space) -> wp.Kernel:
    """Kernel: μ_a/dx [1/m], which minimises Φ(μ) = Σ_b w_ab |ξ|² exp(−μ·ξ/dx), convex, within |μ| ≤ ``most``.

    The slope of Φ is the third moment Σ_b w_ab t_ab |ξ|² ξ of the tilted weights. By Newton's method on ln Φ. Zero
    where the moment of the weights themselves is round-off, and where the neighbourhood lacks a direction.
    """
    real, vec, mat = space.real, space.vec, space.mat
    Particles, Reference = structure(space, "Particles"), structure(space, "Reference")
    Neighbours, separation, minimise = neighbour_structure(space), difference(space), _within(space)
    round_off = 1e3 * float(np.finfo(wp.dtype_to_numpy(space.real)).eps)

    @wp.kernel(module="unique", enable_backward=False)
    def tilt(
        first: int,
        particles: Particles,
        reference: Reference,
        near: Neighbours,
        poor: wp.array(dtype=wp.int32),
        most: real,
        out: wp.array(dtype=vec),
    ):
        a = first + wp.tid()
        rounds = int(ROUNDS)
        if poor[a] > 0:
            rounds = 0
        mu = vec()
        for _ in range(rounds):
            total, scale = real(0.0), real(0.0)
            moment = vec()
            square = mat()
            for k in range(near.start[a], near.stop[a], near.stride):
                xi = separation(reference.x[near.index[k]], reference.x[a], near.box) / particles.spacing[a]
                e = near.w[k] * wp.dot(xi, xi) * wp.exp(-wp.dot(mu, xi))
                total += e
                scale += e * wp.length(xi)
                moment += xi * e
                square += wp.outer(xi, xi) * e
            if wp.length(moment) <= real(round_off) * scale:
                break
            slope = moment / total
            H = square / total - wp.outer(slope, slope)
            mu = minimise(H, H @ mu + slope, most)
        out[a] = mu / particles.spacing[a]

    return tilt


@functools.cache
def make_tilted_sums(space: Space) -> wp.Kernel:
    """Kernel: the weights with t_ab and t_ba, L_a, Σ own ξ, and the graph Laplacian's diagonal.

    ``near.own`` ← w_ab t_ab and ``near.w`` ← ½ w_ab (t_ab + t_ba), both from ``near.w`` = w_ab.
    """
    real, vec, mat = space.real, space.vec, space.mat
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    separation, invert = difference(space), inverse(space)

    @wp.kernel(module="unique", enable_backward=False)
    def tilted_sums(first: int, reference: Reference, near: Neighbours, tilt: wp.array(dtype=vec)):
        a = first + wp.tid()
        x_a, mu_a = reference.x[a], tilt[a]
        K = mat()
        moment = vec()
        diagonal = real(0.0)
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            xi = separation(reference.x[b], x_a, near.box)
            own = near.w[k] * wp.exp(-wp.dot(mu_a, xi))
            dual = near.w[k] * wp.exp(wp.dot(tilt[b], xi))
            near.own[k] = own
            near.w[k] = (own + dual) * real(0.5)
            diagonal += near.w[k]
            moment += xi * own
            K += wp.outer(xi, xi) * own
        if wp.dot(mu_a, mu_a) > real(0.0):
            reference.L[a] = invert(K)
        reference.moment[a] = moment
        reference.diagonal[a] = diagonal

    return tilted_sums
