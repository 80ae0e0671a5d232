"""Logarithms and exponentials of symmetric 3 × 3 matrices as ``wp.func``: logarithmic (Hencky) strains.

By series whose powers the Cayley–Hamilton theorem reduces, X³ = ½ tr(X²) X + det(X) 1 for traceless X: a few products
of numbers per term. Elastic strains of metals are small; large ones go by eigenvectors.
"""

import functools
import math
from typing import Any

import warp as wp

from ..linalg import symmetric_eigen
from ..space import Space, matrix_type

# Largest |eigenvalue| for which the series of ln(1 + X) is taken, and the one that exp's arguments are halved to.
LARGEST_OF_LOG, LARGEST_OF_EXP = 0.1, 0.2
# Of a traceless 3 × 3 matrix the largest eigenvalue is at most √(2/3) of its norm.
SHARE = math.sqrt(2.0 / 3.0)


def _terms(real: type, first_left_out: Any) -> int:
    """Least number of terms so that the first one left out is below half a unit in the last place."""
    half_ulp = 2.0**-54 if real is wp.float64 else 2.0**-25
    return next(k for k in range(1, 100) if first_left_out(k) < half_ulp)


@functools.cache
def deviatoric_logarithm(real: type) -> wp.Function:
    """``wp.func`` dev ln b of a symmetric, positive definite b, exact to round-off; NaN for others."""
    mat, vec = matrix_type(3, 3, real), Space(3, real).vec
    terms = _terms(real, lambda k: LARGEST_OF_LOG**k / (k + 1))
    small = (LARGEST_OF_LOG / SHARE) ** 2
    eigen = symmetric_eigen(Space(3, real))

    @wp.func
    def deviatoric_logarithm(b: mat) -> mat:
        unit = wp.identity(n=3, dtype=real)
        X = unit - b * (real(3.0) / wp.trace(b))  # traceless; ln b = ln(1 − X) + a multiple of 1
        square = X @ X
        norm = wp.trace(square)
        if norm < real(small):
            c2 = real(0.5) * norm
            c3 = wp.determinant(X)
            s0 = real(0.0)
            s1 = real(0.0)
            s2 = real(0.0)
            for k in range(wp.static(terms)):  # Horner: S ← 1/n + X S, n = terms … 1; −ln(1 − X) = X S
                t0 = real(1.0) / real(terms - k) + c3 * s2
                t1 = s0 + c2 * s2
                s2 = s1
                s1 = t1
                s0 = t0
            return (unit * (norm / real(3.0)) - square) * s1 - X * (s0 + c2 * s2)
        R, values = eigen(b)
        e = vec(wp.log(values[0]), wp.log(values[1]), wp.log(values[2]))
        mean = (e[0] + e[1] + e[2]) / real(3.0)
        return R @ wp.diag(e - vec(mean, mean, mean)) @ wp.transpose(R)

    return deviatoric_logarithm


@functools.cache
def exponential(real: type) -> wp.Function:
    """``wp.func`` exp(E) of a symmetric, traceless E, exact to round-off."""
    mat = matrix_type(3, 3, real)
    terms = _terms(real, lambda k: LARGEST_OF_EXP**k / math.factorial(k))
    small = LARGEST_OF_EXP / SHARE

    @wp.func
    def exponential(E: mat) -> mat:
        size = wp.sqrt(wp.ddot(E, E))
        halvings = int(0)
        while size > real(small) and halvings < 64:
            size *= real(0.5)
            halvings += 1
        X = E * wp.pow(real(0.5), real(halvings))
        square = X @ X
        c2 = real(0.5) * wp.trace(square)
        c3 = wp.determinant(X)
        s0 = real(1.0)
        s1 = real(0.0)
        s2 = real(0.0)
        for k in range(wp.static(terms)):  # Horner: S ← 1 + X S / n, n = terms … 1
            share = real(1.0) / real(terms - k)
            t0 = real(1.0) + c3 * s2 * share
            t1 = (s0 + c2 * s2) * share
            s2 = s1 * share
            s1 = t1
            s0 = t0
        out = wp.identity(n=3, dtype=real) * s0 + X * s1 + square * s2
        for _ in range(halvings):
            out = out @ out
        return out

    return exponential
