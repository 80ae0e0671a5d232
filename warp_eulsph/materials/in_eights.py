"""Kinematics of finite plasticity of eight particles at a time: C++ with clang's vectors, for the CPU only.

A particle at a time takes three times as long: what it waits for is arithmetic, some hundred products of reals that
depend on each other. Where elastic strains are larger than metals' the functions of a single particle are taken.
"""

import functools
import math
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from ..space import Space, matrix_type
from .log_strain import (
    DEVIATOR,
    DEVIATORIC,
    POLYNOMIAL,
    SELDOM_PASSED,
    SQUARED,
    largest_c2,
    logarithm_series,
    power_series,
    terms_of,
)

#: Particles at a time.
EIGHT = 8


@functools.cache
def block_structure(mat: type, row: type) -> Any:
    """Eight particles of one kind of law, or the rest of them.

    ``F`` has their F from ``first`` on, ``history`` their rows from ``own`` on, ``count`` of them.
    """

    @wp.struct
    class Block:
        F: wp.array(dtype=mat)
        history: wp.array(dtype=row)
        first: int
        own: int
        count: int

    return Block


class PlasticEights(NamedTuple):
    """Functions, all ``wp.func``, of a block (``block_structure``) whose C_p⁻¹ begins its rows of history.

    Attributes:
        measure: block -> (2, 8): |dev e|, NaN where the single particle's functions must be taken, and ln J.
        stress: (…, t, s, P): P from ``first`` on ← (t + s dev e) F⁻ᵀ, t and s of each.
        flow: (…, share): C_p⁻¹ that leaves this share of dev e; where it is 1, nothing is written.
    """

    measure: wp.Function
    stress: wp.Function
    flow: wp.Function


def _logarithm(real: type) -> str:
    """C++ of ln_J from J: J = 2^k m, √½ ≤ m < √2, by its bits, ln m by the series of the inverse hyperbolic tangent."""
    digits, word, width = (52, "long long", 12) if real is wp.float64 else (23, "int", 9)
    half = np.sqrt(0.5, dtype=Space(1, real).numpy)
    largest = ((math.sqrt(2.0) - 1.0) / (math.sqrt(2.0) + 1.0)) ** 2  # of ((m − 1)/(m + 1))²
    terms = terms_of(real, lambda k: largest ** (k + 1) / (2 * k + 3))
    series = " + square * (".join(f"T({2.0 / (2 * n + 3)!r})" for n in range(terms)) + ")" * (terms - 1)
    upper = math.floor(math.log(2.0) * 2.0**width) / 2.0**width  # k times it is exact
    return f"""
    typedef {word} I __attribute__((ext_vector_type({EIGHT})));
    I bits;
    __builtin_memcpy(&bits, &J, sizeof(E));
    const I k = (bits - {int(half.view(f"i{half.nbytes}"))}) >> {digits};
    bits -= k << {digits};
    E m;
    __builtin_memcpy(&m, &bits, sizeof(E));
    const E whole = __builtin_convertvector(k, E), over = m - T(1), ratio = over / (T(1) + m), square = ratio * ratio;
    const E ln_m = over - ratio * (over - square * ({series})), lower = T({math.log(2.0) - upper!r}) * whole;
    const E ln_J = J > T(0) ? T({upper!r}) * whole + (ln_m + lower) + (J - J) : E(T(NAN));
    """


@functools.cache
def plastic_eights(space: Space, row: Any) -> PlasticEights:
    """The functions for rows of history of this type."""
    real, mat = space.real, space.mat
    eight, two_eights, Block = space.row(EIGHT), matrix_type(2, EIGHT, real), block_structure(mat, row)
    begin = f"""
    #pragma clang fp contract(fast)
    typedef {"double" if real is wp.float64 else "float"} T;
    typedef T E __attribute__((ext_vector_type({EIGHT})));
    constexpr int dim = {space.dim};
    const int first = block.first, own = block.own, count = block.count;
    auto& history = block.history;
    // has the stack frame aligned, as in simd.py
    alignas(64) volatile char aligned[64];
    aligned[0] = 0;
    int of[{EIGHT}];
    for (int k = 0; k < {EIGHT}; ++k) of[k] = k < count ? k : count - 1;
    E G[3][3], C[6], H[3][3];
    #pragma unroll
    for (int i = 0; i < 3; ++i)
        #pragma unroll
        for (int j = 0; j < 3; ++j)
            if (i < dim && j < dim)
                #pragma unroll
                for (int k = 0; k < {EIGHT}; ++k) G[i][j][k] = block.F.data[first + of[k]].data[i][j];
            else G[i][j] = T(i == j);
    #pragma unroll
    for (int i = 0; i < 6; ++i)
        #pragma unroll
        for (int k = 0; k < {EIGHT}; ++k) C[i][k] = history.data[own + of[k]].c[i];
    #pragma unroll
    for (int i = 0; i < 3; ++i) {{
        H[i][0] = G[i][0] * C[0] + (G[i][1] * C[3] + G[i][2] * C[4]);
        H[i][1] = G[i][0] * C[3] + (G[i][1] * C[1] + G[i][2] * C[5]);
        H[i][2] = G[i][0] * C[4] + (G[i][1] * C[5] + G[i][2] * C[2]);
    }}
    """
    logarithmic = f"E s = T(0), t = T(0), u = T(0); {logarithm_series(real, SELDOM_PASSED)}"
    cofactors = """
    E K[3][3];
    #pragma unroll
    for (int i = 0; i < 3; ++i)
        #pragma unroll
        for (int j = 0; j < 3; ++j) {
            const int k = (i + 1) % 3, l = (i + 2) % 3, m = (j + 1) % 3, n = (j + 2) % 3;
            K[i][j] = G[k][m] * G[l][n] - G[k][n] * G[l][m];
        }
    const E J = G[0][0] * K[0][0] + (G[0][1] * K[0][1] + G[0][2] * K[0][2]);
    """

    @wp.func_native(f"""
    {begin}
    {DEVIATOR}
    {cofactors}
    {_logarithm(real)}
    {logarithmic}
    const E size = c2 < T({largest_c2(SELDOM_PASSED)!r}) ? T(0.5) * __builtin_elementwise_sqrt({SQUARED}) : E(T(NAN));
    wp::mat_t<2, {EIGHT}, T> out;
    __builtin_memcpy(out.data[0], &size, sizeof(E));
    __builtin_memcpy(out.data[1], &ln_J, sizeof(E));
    return out;
    """)
    def measure(block: Block) -> two_eights: ...

    @wp.func_native(f"""
    {begin}
    {DEVIATOR}
    {cofactors}
    {logarithmic}
    E pressure, factor;
    __builtin_memcpy(&pressure, tension.c, sizeof(E));
    __builtin_memcpy(&factor, shear.c, sizeof(E));
    factor *= T(0.5);
    {DEVIATORIC}
    E tau[3][3];
    {{
        const E of_unit = pressure + factor * S0, of_X = factor * S1, of_square = factor * S2;
        const E S0 = of_unit, S1 = of_X, S2 = of_square;
        {POLYNOMIAL}
        __builtin_memcpy(tau, R, sizeof(R));
    }}
    const E per_J = T(1) / J;
    #pragma unroll
    for (int i = 0; i < dim; ++i)
        #pragma unroll
        for (int j = 0; j < dim; ++j) {{
            E sum = 0;
            #pragma unroll
            for (int k = 0; k < dim; ++k) sum += tau[i][k] * K[k][j];
            sum *= per_J;
            for (int k = 0; k < count; ++k) P.data[first + k].data[i][j] = sum[k];
        }}
    """)
    def stress(block: Block, tension: eight, shear: eight, P: wp.array(dtype=mat)): ...

    # of (1 - w)^z, z in [0, 1/3], w = c2 + c3: |terms| below w^n/3n
    w_most = largest_c2(SELDOM_PASSED) + 2.0 * SELDOM_PASSED**3
    terms = terms_of(real, lambda k: w_most ** (k + 1) / (3 * (k + 1)))
    unimodular = " ".join(
        f"scale = T(1) + w * scale * (T({1.0 - 1.0 / n!r}) - z * T({1.0 / n!r}));" for n in range(terms, 0, -1)
    )

    @wp.func_native(f"""
    {begin}
    E left;
    __builtin_memcpy(&left, share.c, sizeof(E));
    {DEVIATOR}
    const E p = left - T(2), w = c2 + c3, z = (T(1) - left) * T(1.0 / 3.0);
    E s = T(1), t = T(0), u = T(0), scale = T(1);
    {power_series(real, SELDOM_PASSED)}
    {unimodular}
    scale *= -rate;
    const E S0 = s, S1 = t, S2 = u;
    {POLYNOMIAL}
    E RH[3][3];
    #pragma unroll
    for (int i = 0; i < 3; ++i)
        #pragma unroll
        for (int j = 0; j < 3; ++j) RH[i][j] = R[i][0] * H[0][j] + (R[i][1] * H[1][j] + R[i][2] * H[2][j]);
    auto element = [&](int i, int j) {{
        return scale * (H[0][i] * RH[0][j] + (H[1][i] * RH[1][j] + H[2][i] * RH[2][j]));
    }};
    const E x = element(0, 0), y = element(1, 1), z_ = element(2, 2);
    const E xy = element(0, 1), xz = element(0, 2), yz = element(1, 2);
    // det C = 1 but for round-off, which would add up
    const E det = x * (y * z_ - yz * yz) + (xy * (xz * yz - xy * z_) + xz * (xy * yz - y * xz));
    const E kept = T(1) + (T(1) - det) * T(1.0 / 3.0);
    const E out[6] = {{x * kept, y * kept, z_ * kept, xy * kept, xz * kept, yz * kept}};
    for (int k = 0; k < count; ++k)
        if (left[k] < 1)
            for (int i = 0; i < 6; ++i) history.data[own + k].c[i] = out[i][k];
    """)
    def flow(block: Block, share: eight): ...

    return PlasticEights(measure, stress, flow)
