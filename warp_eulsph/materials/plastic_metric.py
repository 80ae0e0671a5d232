"""Kinematics of finite plasticity (M18, M20 in docs/method.md): F = F_e F_p, kept as F and C_p⁻¹ = F_p⁻¹ F_p⁻ᵀ.

For isotropic laws whose plastic flow is coaxial with the elastic strain e = ln V_e. C_p⁻¹ keeps det C_p⁻¹ = 1: what a
law does to volume is a number of its own.
"""

import functools
import math
from typing import Any, NamedTuple

import warp as wp

from ..linalg import det, reciprocal_cube_root, symmetric_bounds
from ..space import Space, matrix_type
from .base import Variable
from .log_strain import strain_functions

#: Begins the history of a law that flows.
METRIC = Variable(
    "plastic_metric",
    "-",
    "inverse plastic metric C_p^-1 since the last rebasing, out-of-plane parts included",
    start=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0),
)


class Kinematics(NamedTuple):
    """Functions, all ``wp.func``, of F and a row h of history that ``METRIC`` begins; full is 3 × 3 in any dimension.

    Attributes:
        trial: (F, h) -> dev e (full).
        size: (F, h) -> |dev e|.
        flowed: (F, h, share) -> h whose C_p⁻¹ leaves this share of dev e.
        rebased: (F, h) -> (F, h) of the same det F and dev e, with what is left of F after plastic flow.
        moduli: (F, h, t, μ, κ) -> (M, μ_s) as ``Law.wave_moduli``, t = tr τ/3, of Ψ = ψ(ln J) + μ |dev e|², ψ'' = κ.
        in_space: full -> its part in the space.
    """

    trial: wp.Function
    size: wp.Function
    flowed: wp.Function
    rebased: wp.Function
    moduli: wp.Function
    in_space: wp.Function


@functools.cache
def elastic_moduli(real: type) -> wp.Function:
    """``wp.func`` (below, apart, t, μ, κ) -> (M, μ_s) as ``Law.wave_moduli`` of Ψ = ψ(ln J) + μ |dev e|² with ψ'' = κ.

    t = tr τ/3; of 2 dev e the least eigenvalue is no more ``below`` zero, and eigenvalues are no more ``apart``.
    """
    pair = Space(3, real).row(2)

    @wp.func
    def elastic_moduli(below: real, apart: real, t: real, mu: real, kappa: real) -> pair:
        # Along principal directions κ + 4/3 μ − τ_i, and μ x/(1 − e^(−x)) ≤ μ (1 + x) with x = 2 (e_i − e_j) for shear
        shear = mu * (real(1.0) + apart)
        M = kappa + real(4.0) / real(3.0) * mu * (real(1.0) + real(0.25) * apart * apart)
        return pair(wp.max(M - t + mu * below, shear), shear)

    return elastic_moduli


@functools.cache
def moduli_of_size(real: type) -> wp.Function:
    """``wp.func`` (|dev e|, t, μ, κ) -> the same where the eigenvalues are three in sum zero: √(2/3) and √2 |dev e|."""
    pair, moduli = Space(3, real).row(2), elastic_moduli(real)
    below, apart = 2.0 * math.sqrt(2.0 / 3.0), 2.0 * math.sqrt(2.0)

    @wp.func
    def moduli_of_size(size: real, t: real, mu: real, kappa: real) -> pair:
        return moduli(real(below) * size, real(apart) * size, t, mu, kappa)

    return moduli_of_size


@functools.cache
def elastic_kinematics(space: Space, row: Any) -> Kinematics:
    """The functions for rows of history of this type."""
    real, mat, pair, dim = space.real, space.mat, space.row(2), space.dim
    full, strain = matrix_type(3, 3, real), space.row(8)
    determinant, bounds, root = det(space), symmetric_bounds(space), reciprocal_cube_root(real)
    of_size, of_bounds = moduli_of_size(real), elastic_moduli(real)
    deviator, logarithm, size_of, power = strain_functions(real)

    @wp.func
    def extended(F: mat) -> full:
        """F with the missing stretches of one."""
        out = wp.identity(n=3, dtype=real)
        for i in range(wp.static(dim)):
            for j in range(wp.static(dim)):
                out[i, j] = F[i, j]
        return out

    @wp.func
    def in_space(A: full) -> mat:
        out = mat()
        for i in range(wp.static(dim)):
            for j in range(wp.static(dim)):
                out[i, j] = A[i, j]
        return out

    @wp.func
    def pulled(F: mat, h: row) -> full:
        """H = F C_p⁻¹."""
        return extended(F) @ full(h[0], h[3], h[4], h[3], h[1], h[5], h[4], h[5], h[2])

    @wp.func
    def elastic(F: mat, h: row) -> strain:
        """What the functions of log_strain.py take of b_e = F C_p⁻¹ Fᵀ."""
        return deviator(pulled(F, h), extended(F))

    @wp.func
    def trial(F: mat, h: row) -> full:
        return logarithm(elastic(F, h)) * real(0.5)

    @wp.func
    def size(F: mat, h: row) -> real:
        return size_of(elastic(F, h)) * real(0.5)

    @wp.func
    def flowed(F: mat, h: row, share: real) -> row:
        # J^⅔ F⁻¹ exp(2 share dev e) F⁻ᵀ, which is F⁻¹ b_e^share F⁻ᵀ times a number, and F⁻¹ = Hᵀ b_e⁻¹
        H = pulled(F, h)
        C = wp.transpose(H) @ power(elastic(F, h), share - real(2.0)) @ H
        C = C * root(wp.determinant(C))
        out = h
        for k in range(3):
            out[k] = C[k, k]
        out[3] = C[0, 1]
        out[4] = C[0, 2]
        out[5] = C[1, 2]
        return out

    @wp.func
    def rebased(F: mat, h: row):
        out = h
        F_e = F
        if wp.static(dim > 1):
            J, V = determinant(F), power(elastic(F, h), real(0.5))  # V times a number
            ratio = J / wp.determinant(V)
            V = V * (ratio * root(ratio) * root(ratio))
            V += V * ((J - wp.determinant(V)) / (real(3.0) * J))  # round-off of det F would add up
            s = real(1.0)
            if wp.static(dim == 2):
                s = wp.sqrt(V[2, 2])  # so that det F stays J
            F_e = in_space(V) * s
            for k in range(6):
                out[k] = real(0.0)
            out[0] = real(1.0) / (s * s)
            out[1] = out[0]
            out[2] = s * s * s * s
        return F_e, out

    @wp.func
    def moduli(F: mat, h: row, t: real, mu: real, kappa: real) -> pair:
        if wp.static(dim == 3):
            return of_size(size(F, h), t, mu, kappa)
        # Of the stretches over J^(1/3), squared, the largest and the least in the space: ln a ≤ a − 1, −ln c ≤ 1/c − 1
        J = determinant(F)
        b = bounds(in_space(pulled(F, h) @ wp.transpose(extended(F)))) * (root(J) * root(J))
        below = real(1.0) / b[0] - real(1.0)
        return of_bounds(below, b[1] - real(1.0) + below, t, mu, kappa)

    return Kinematics(trial, size, flowed, rebased, moduli, in_space)
