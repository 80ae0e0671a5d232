"""How what positions are off turns with the pair: for that dissipation (M9) drags no rotation.

Where positions and F agree, ξ = ½ (F_a + F_b) ξ⁰, a rotation v = Ω x is reconstructed by ∇v ξ⁰ alone. What is left
over, r = ξ − ½ (F_a + F_b) ξ⁰ (M16), turns too: its velocity Ω r belongs to the reconstruction. From an eighth of the
pair's length on less of it is counted, from a quarter on nothing: positions say nothing of the pair there, and waves
would grow by it (``tests/test_stability_map.py``).
"""

import functools

import warp as wp

from ..space import Space, vector_type


@functools.cache
def make_spin(space: Space) -> wp.Function:
    """``wp.func`` ω of the antisymmetric part W of a velocity gradient, W r = ω × r, in three dimensions."""
    real, mat, dim, vec3 = space.real, space.mat, space.dim, vector_type(3, space.real)

    @wp.func
    def spin(D: mat) -> vec3:
        omega = vec3()
        if wp.static(dim == 3):
            omega[0] = (D[2, 1] - D[1, 2]) * real(0.5)
            omega[1] = (D[0, 2] - D[2, 0]) * real(0.5)
        if wp.static(dim > 1):
            omega[2] = (D[1, 0] - D[0, 1]) * real(0.5)
        return omega

    return spin


@functools.cache
def make_turned(space: Space) -> wp.Function:
    """``wp.func`` (ω, r, pair) -> ω × r, for ``pair`` of what length, less where r is long beside it."""
    real, vec, dim, vec3 = space.real, space.vec, space.dim, vector_type(3, space.real)

    @wp.func
    def turned(omega: vec3, r: vec, pair: real) -> vec:
        share = wp.clamp(real(2.0) - real(8.0) * wp.length(r) / pair, real(0.0), real(1.0))
        r3 = vec3()
        for i in range(wp.static(dim)):
            r3[i] = r[i] * share
        across = wp.cross(omega, r3)
        out = vec()
        if wp.static(dim > 1):
            for i in range(wp.static(dim)):
                out[i] = across[i]
        return out

    return turned


_FADE = """
        const V off = {off}, pair = {pair};
        V share = 1;  // of nearly all pairs, which need neither root nor quotient
        if (__builtin_reduce_or(off * 64 > pair)) {{
            share = T(2) - T(8) * __builtin_elementwise_sqrt(off / (pair + T(1e-30)));
            share = share > 1 ? (V)1 : (share < 0 ? (V)0 : share);
        }}
"""
#: C++ of the same for eight pairs, of −½ ω in S, added to the jumps J.
TURNING = {
    2: _FADE.format(off="R[0] * R[0] + R[1] * R[1]", pair="X[0] * X[0] + X[1] * X[1]")
    + """
        J[0] -= S[2] * R[1] * share;
        J[1] += S[2] * R[0] * share;
    """,
    3: _FADE.format(off="R[0] * R[0] + R[1] * R[1] + R[2] * R[2]", pair="X[0] * X[0] + X[1] * X[1] + X[2] * X[2]")
    + """
        J[0] += (S[1] * R[2] - S[2] * R[1]) * share;
        J[1] += (S[2] * R[0] - S[0] * R[2]) * share;
        J[2] += (S[0] * R[1] - S[1] * R[0]) * share;
    """,
}
