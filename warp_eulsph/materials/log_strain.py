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

# Largest |eigenvalue| for which the series of ln(1 + X) is taken, that to which arguments of exp are halved, and one
# that metals seldom pass, to which shorter series do.
LARGEST_OF_LOG, LARGEST_OF_EXP, SELDOM_PASSED = 0.1, 0.2, 0.02
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
    few, terms = (_terms(real, lambda k, x=x: x**k / (k + 1)) for x in (SELDOM_PASSED, LARGEST_OF_LOG))
    tiny, small = ((x / SHARE) ** 2 for x in (SELDOM_PASSED, LARGEST_OF_LOG))
    eigen = symmetric_eigen(Space(3, real))

    def series(terms: int) -> wp.Function:
        @wp.func
        def series(c2: real, c3: real) -> vec:
            """S with −ln(1 − X) = X S, S = S₀ + S₁ X + S₂ X²."""
            out = vec()
            for k in range(wp.static(terms)):  # Horner: S ← 1/n + X S, n = terms … 1
                out = vec(real(1.0) / real(wp.static(terms) - k) + c3 * out[2], out[0] + c2 * out[2], out[1])
            return out

        return series

    short, long = series(few), series(terms)

    @wp.func
    def deviatoric_logarithm(b: mat) -> mat:
        unit = wp.identity(n=3, dtype=real)
        X = unit - b * (real(3.0) / wp.trace(b))  # traceless; ln b = ln(1 − X) + a multiple of 1
        square = X @ X
        norm = wp.trace(square)
        if norm < real(small):
            c2 = real(0.5) * norm
            c3 = wp.determinant(X)
            S = vec()
            if norm < real(tiny):
                S = short(c2, c3)
            else:
                S = long(c2, c3)
            return (unit * (norm / real(3.0)) - square) * S[1] - X * (S[0] + c2 * S[2])
        R, values = eigen(b)
        e = vec(wp.log(values[0]), wp.log(values[1]), wp.log(values[2]))
        mean = (e[0] + e[1] + e[2]) / real(3.0)
        return R @ wp.diag(e - vec(mean, mean, mean)) @ wp.transpose(R)

    return deviatoric_logarithm


@functools.cache
def exponential(real: type) -> wp.Function:
    """``wp.func`` exp(E) of a symmetric, traceless E, exact to round-off."""
    mat, vec = matrix_type(3, 3, real), Space(3, real).vec
    few, terms = (_terms(real, lambda k, x=x: x**k / math.factorial(k)) for x in (SELDOM_PASSED, LARGEST_OF_EXP))
    tiny, small = SELDOM_PASSED / SHARE, LARGEST_OF_EXP / SHARE

    def series(terms: int) -> wp.Function:
        @wp.func
        def series(X: mat) -> mat:
            square = X @ X
            c2 = real(0.5) * wp.trace(square)
            c3 = wp.determinant(X)
            S = vec(real(1.0), real(0.0), real(0.0))
            for k in range(wp.static(terms)):  # Horner: S ← 1 + X S / n, n = terms … 1
                S = S * (real(1.0) / real(wp.static(terms) - k))
                S = vec(real(1.0) + c3 * S[2], S[0] + c2 * S[2], S[1])
            return wp.identity(n=3, dtype=real) * S[0] + X * S[1] + square * S[2]

        return series

    short, long = series(few), series(terms)

    @wp.func
    def exponential(E: mat) -> mat:
        size = wp.sqrt(wp.ddot(E, E))
        if size < real(tiny):
            return short(E)
        halvings = int(0)
        share = real(1.0)
        while size > real(small) and halvings < 64:
            size *= real(0.5)
            share *= real(0.5)
            halvings += 1
        out = long(E * share)
        for _ in range(halvings):
            out = out @ out
        return out

    return exponential
