"""Logarithms and powers of symmetric 3 × 3 matrices: logarithmic (Hencky) strains.

Of 1 − X, X traceless, by series whose powers the Cayley–Hamilton theorem reduces, X³ = c₂ X + c₃ with c₂ = ½ tr X² and
c₃ = det X: a few products of numbers per term. Elastic strains of metals are small; large ones go by eigenvectors.

The series are C++ for elements of a type E that holds one real of type T or several, so that one source does for a
particle and for several at a time (``in_eights.py``).
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import warp as wp

from ..linalg import symmetric_eigen
from ..space import Space

# Largest |eigenvalue| of X for which series are taken, and one that metals seldom pass, to which shorter series do.
LARGEST, SELDOM_PASSED = 0.1, 0.02


def largest_c2(eigenvalue: float) -> float:
    """The c₂ up to which no |eigenvalue| of a traceless 3 × 3 matrix is larger than this: it is at most √(2/3) |X|."""
    return 0.75 * eigenvalue * eigenvalue


def terms_of(real: type, first_left_out: Callable[[int], float]) -> int:
    """Least number of terms so that the first one left out is below half a unit in the last place."""
    half_ulp = 2.0**-54 if real is wp.float64 else 2.0**-25
    return next(k for k in range(1, 100) if first_left_out(k) < half_ulp)


#: a, b, c, d, e, f, the elements xx, yy, zz, xy, xz, yz of X = 1 − 3 H Gᵀ/tr(H Gᵀ), c2 and c3, of arrays H and G.
DEVIATOR = """
    auto dot = [&](int i, int j) { return H[i][0] * G[j][0] + (H[i][1] * G[j][1] + H[i][2] * G[j][2]); };
    const E xx = dot(0, 0), yy = dot(1, 1), zz = dot(2, 2), rate = T(-3) / (xx + (yy + zz));
    const E a = T(1) + rate * xx, b = T(1) + rate * yy, c = T(1) + rate * zz;
    const E d = rate * dot(0, 1), e = rate * dot(0, 2), f = rate * dot(1, 2);
    const E c2 = T(0.5) * (a * a + b * b + c * c) + (d * d + e * e + f * f);
    const E c3 = a * (b * c - f * f) + (d * (e * f - c * d) + e * (d * f - b * e));
"""


def _horner(terms: int, first: Callable[[int], str], share: Callable[[int], str]) -> str:
    """C++ of s, t, u ← first + share · (s + t X + u X²) X for n = terms … 1."""
    each = (
        f"{{ const E r = {share(n)}, v = r * u, w = r * s + c2 * v; s = {first(n)} + c3 * v; u = r * t; t = w; }}"
        for n in range(terms, 0, -1)
    )
    return " ".join(each)


def logarithm_series(real: type, largest: float) -> str:
    """C++ that makes s, t, u of −ln(1 − X) = X (s + t X + u X²) from zeros; |eigenvalues| of X up to ``largest``."""
    terms = terms_of(real, lambda k: largest**k / (k + 1))
    return _horner(terms, lambda n: f"T({1.0 / n!r})", lambda n: "E(T(1))")


def power_series(real: type, largest: float) -> str:
    """C++ that makes s, t, u of (1 − X)^p = s + t X + u X² from 1, 0, 0; p in [−2, 1]."""
    terms = terms_of(real, lambda k: (k + 2) * largest ** (k + 1))
    return _horner(terms, lambda n: "T(1)", lambda n: f"(T({1.0 - 1.0 / n!r}) - p * T({1.0 / n!r}))")


#: |dev ln(1 − X)|² from s, t, u of its series.
SQUARED = "(T(2) * c2 * (s + c2 * u) * (s + c2 * u) + t * (T(6) * c3 * (s + c2 * u) + T(2.0 / 3.0) * (c2 * c2) * t))"
#: S0, S1, S2 of dev ln(1 − X) = S0 + S1 X + S2 X² likewise.
DEVIATORIC = "const E S0 = T(2.0 / 3.0) * c2 * t, S1 = -(s + c2 * u), S2 = -t;"
#: R = S0 + S1 X + S2 X², an array.
POLYNOMIAL = """
    const E r_xy = S1 * d + S2 * (e * f - c * d), r_xz = S1 * e + S2 * (d * f - b * e);
    const E r_yz = S1 * f + S2 * (d * e - a * f);
    const E R[3][3] = {
        {S0 + S1 * a + S2 * (a * a + (d * d + e * e)), r_xy, r_xz},
        {r_xy, S0 + S1 * b + S2 * (b * b + (d * d + f * f)), r_yz},
        {r_xz, r_yz, S0 + S1 * c + S2 * (c * c + (e * e + f * f))},
    };
"""


class StrainFunctions(NamedTuple):
    """Functions, all ``wp.func``, of b = H Gᵀ, symmetric and positive definite; exact to round-off, NaN for others.

    Attributes:
        deviator: (H, G) -> row of X (xx, yy, zz, xy, xz, yz), c₂ and c₃, which the others take.
        logarithm: row -> dev ln b.
        size: row -> |dev ln b|.
        power: (row, p) -> (1 − X)^p, p in [−2, 1].
    """

    deviator: wp.Function
    logarithm: wp.Function
    size: wp.Function
    power: wp.Function


@functools.cache
def strain_functions(real: type) -> StrainFunctions:
    """The functions in this precision."""
    three = Space(3, real)
    mat, vec, row, eigen = three.mat, three.vec, three.row(8), symmetric_eigen(three)
    small = largest_c2(LARGEST)
    begin = f"""
    #if defined(__clang__)
    #pragma clang fp contract(fast)
    #endif
    typedef {"double" if real is wp.float64 else "float"} T;
    typedef T E;
    """
    elements = "const E a = X.c[0], b = X.c[1], c = X.c[2], d = X.c[3], e = X.c[4], f = X.c[5];"
    invariants = "const E c2 = X.c[6], c3 = X.c[7];"

    def by_size(series: Callable[[type, float], str]) -> str:
        few, many = (series(real, largest) for largest in (SELDOM_PASSED, LARGEST))
        return f"{invariants} if (c2 < T({largest_c2(SELDOM_PASSED)!r})) {{ {few} }} else {{ {many} }}"

    @wp.func_native(f"""
    {begin}
    const auto& H = left.data;
    const auto& G = right.data;
    {DEVIATOR}
    wp::vec_t<8, T> out;
    out.c[0] = a, out.c[1] = b, out.c[2] = c, out.c[3] = d, out.c[4] = e, out.c[5] = f, out.c[6] = c2, out.c[7] = c3;
    return out;
    """)
    def deviator(left: mat, right: mat) -> row: ...

    @wp.func_native(f"""
    {begin}
    E s = 0, t = 0, u = 0;
    {by_size(logarithm_series)}
    return {{s, t, u}};
    """)
    def logarithmic(X: row) -> vec: ...

    @wp.func_native(f"""
    {begin}
    E s = 1, t = 0, u = 0;
    {by_size(power_series)}
    return {{s, t, u}};
    """)
    def binomial(X: row, p: real) -> vec: ...

    @wp.func_native(f"""
    {begin}
    {elements}
    const E S0 = S.c[0], S1 = S.c[1], S2 = S.c[2];
    {POLYNOMIAL}
    return {{R[0][0], R[0][1], R[0][2], R[1][0], R[1][1], R[1][2], R[2][0], R[2][1], R[2][2]}};
    """)
    def polynomial(X: row, S: vec) -> mat: ...

    @wp.func_native(f"""
    {begin}
    {invariants}
    const E s = S.c[0], t = S.c[1], u = S.c[2];
    {DEVIATORIC}
    return {{S0, S1, S2}};
    """)
    def deviatoric(X: row, S: vec) -> vec: ...

    @wp.func_native(f"""
    {begin}
    {invariants}
    const E s = S.c[0], t = S.c[1], u = S.c[2];
    return sqrt({SQUARED});
    """)
    def norm(X: row, S: vec) -> real: ...

    @wp.func
    def eigenvectors(X: row):
        """Eigenvectors and eigenvalues of 1 − X."""
        R, values = eigen(mat(-X[0], -X[3], -X[4], -X[3], -X[1], -X[5], -X[4], -X[5], -X[2]))
        return R, values + vec(real(1.0), real(1.0), real(1.0))

    @wp.func
    def principal(values: vec) -> vec:
        e = vec(wp.log(values[0]), wp.log(values[1]), wp.log(values[2]))
        mean = (e[0] + e[1] + e[2]) / real(3.0)
        return e - vec(mean, mean, mean)

    @wp.func
    def logarithm(X: row) -> mat:
        if X[6] < real(small):
            return polynomial(X, deviatoric(X, logarithmic(X)))
        R, values = eigenvectors(X)
        return R @ wp.diag(principal(values)) @ wp.transpose(R)

    @wp.func
    def size(X: row) -> real:
        if X[6] < real(small):
            return norm(X, logarithmic(X))
        _R, values = eigenvectors(X)
        return wp.length(principal(values))

    @wp.func
    def power(X: row, p: real) -> mat:
        if X[6] < real(small):
            return polynomial(X, binomial(X, p))
        R, values = eigenvectors(X)
        for i in range(3):
            values[i] = wp.pow(values[i], p)
        return R @ wp.diag(values) @ wp.transpose(R)

    return StrainFunctions(deviator, logarithm, size, power)
