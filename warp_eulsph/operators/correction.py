"""Pair weights and the gradient correction L_a = K_a⁻¹ (M3), with its fall-back for poor neighbourhoods."""

import functools

import warp as wp

from ..fields import neighbour_structure, structure
from ..linalg import inverse, symmetric_bounds, symmetric_eigen
from ..simd import prelude
from ..space import Space, difference
from ..weights import Weight
from ..weights.base import pair_weight

# K is the identity where the neighbourhood is full and about a half at flat surfaces. Along a direction in which it
# keeps less than this share, differences carry no usable slope and the gradient's component there is set to zero.
CUTOFF = 0.02


@functools.cache
def make_pair_sums(weight: Weight, space: Space) -> wp.Kernel:
    """Kernel: w_ab = V_b g_ab of every pair, its sum, K_a = Σ w ξ⊗ξ (M3, ξ = x_b − x_a) and the mass sum of M7."""
    real, mat = space.real, space.mat
    Particles, Reference, Neighbours = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        neighbour_structure(space),
    )
    separation, g_of = difference(space), pair_weight(weight, space)

    @wp.kernel(module="unique", enable_backward=False)
    def pair_sums(first: int, particles: Particles, reference: Reference, near: Neighbours, K: wp.array(dtype=mat)):
        a = first + wp.tid()
        x_a = reference.x[a]
        h_a = reference.h[a]
        K_a = mat()
        row = real(0.0)
        diagonal = real(0.0)
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            xi = separation(reference.x[b], x_a, near.box)
            g = g_of(wp.length(xi), real(0.5) * (h_a + reference.h[b]))
            w = reference.V[b] * g
            near.w[k] = w
            K_a += wp.outer(xi, xi) * w
            row += particles.mass[b] * g
            diagonal += w
        K[a] = K_a
        reference.row[a] = row
        reference.diagonal[a] = diagonal

    return pair_sums


@functools.cache
def make_pair_sums_simd(weight: Weight, space: Space) -> wp.Kernel:
    """SIMD kernel of ``make_pair_sums``."""
    real, vec, mat = space.real, space.vec, space.mat
    Particles, Reference, Neighbours = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        neighbour_structure(space),
    )
    sigma = weight.sigma[space.dim - 1]
    snippet = f"""
    {prelude(space)}
    auto slope = [](V q) __attribute__((always_inline)) {{ return {weight.slope_cpp}; }};
    const Q x_one = load(x.data[a].c);
    const V x_a = both(x_one, x_one);
    const T h_a = h.data[a];
    V sums[dim * dim], row = 0, diagonal = 0;
    #pragma unroll
    for (int i = 0; i < dim * dim; ++i) sums[i] = 0;
    auto eight = [&](int k, const int* b, int many) __attribute__((always_inline)) {{
        V p[4], xi[4], h_ab, V_b, m_b;
        #pragma unroll
        for (int i = 0; i < 4; ++i) p[i] = nearest(both(load(x.data[b[i]].c), load(x.data[b[i + 4]].c)) - x_a);
        #pragma unroll
        for (int i = 0; i < 8; ++i) {{
            h_ab[i] = h.data[b[i]];
            V_b[i] = i < many ? volume.data[b[i]] : 0;
            m_b[i] = i < many ? mass.data[b[i]] : 0;
        }}
        turn(p, xi);
        V rr = xi[0] * xi[0];
        #pragma unroll
        for (int i = 1; i < dim; ++i) rr += xi[i] * xi[i];
        const V rate = 2 / (h_ab + h_a), q = __builtin_elementwise_sqrt(rr) * rate;
        V g = slope(q) * T({sigma!r});
        #pragma unroll
        for (int i = 0; i < dim + 2; ++i) g *= rate;
        g = q < T({weight.support!r}) ? g : (V)0;
        const V w_ab = g * V_b;
        if (many == 8) __builtin_memcpy(w.data + k, &w_ab, sizeof(V));
        else for (int i = 0; i < many; ++i) w.data[k + i] = w_ab[i];
        #pragma unroll
        for (int i = 0; i < dim; ++i) for (int j = 0; j <= i; ++j) sums[i * dim + j] += xi[i] * xi[j] * w_ab;
        row += g * m_b;
        diagonal += w_ab;
    }};
    int k = begin;
    for (; k + 8 <= end; k += 8) eight(k, index.data + k, 8);
    if (k < end) {{
        int some[8];  // the particle itself makes up the number, with no volume
        #pragma unroll
        for (int i = 0; i < 8; ++i) some[i] = k + i < end ? index.data[k + i] : a;
        eight(k, some, end - k);
    }}
    #pragma unroll
    for (int i = 0; i < dim; ++i) for (int j = 0; j <= i; ++j)
        K.data[a].data[i][j] = K.data[a].data[j][i] = total(sums[i * dim + j]);
    rows.data[a] = total(row);
    diagonals.data[a] = total(diagonal);
    """

    @wp.func_native(snippet)
    def weigh(
        a: int,
        begin: int,
        end: int,
        index: wp.array(dtype=int),
        w: wp.array(dtype=real),
        box: vec,
        x: wp.array(dtype=vec),
        h: wp.array(dtype=real),
        volume: wp.array(dtype=real),
        mass: wp.array(dtype=real),
        K: wp.array(dtype=mat),
        rows: wp.array(dtype=real),
        diagonals: wp.array(dtype=real),
    ): ...

    @wp.kernel(module="unique", enable_backward=False)
    def pair_sums_simd(
        first: int, particles: Particles, reference: Reference, near: Neighbours, K: wp.array(dtype=mat)
    ):
        a = first + wp.tid()
        begin, end = near.start[a], near.start[a + 1]
        x, h, V = reference.x, reference.h, reference.V
        weigh(
            a, begin, end, near.index, near.w, near.box, x, h, V, particles.mass, K, reference.row, reference.diagonal
        )

    return pair_sums_simd


@functools.cache
def corrected_inverse(space: Space) -> wp.Function:
    """``wp.func`` (K) -> (K⁻¹, 0); where eigenvalues of K are below ``CUTOFF`` the pseudo-inverse, and how many are."""
    real, mat, dim = space.real, space.mat, space.dim
    invert, bounds, eigen = inverse(space), symmetric_bounds(space), symmetric_eigen(space)

    @wp.func
    def corrected_inverse(K: mat):
        L = mat()
        lacking = int(0)
        if bounds(K)[0] >= real(CUTOFF):
            L = invert(K)
        else:
            R, values = eigen(K)
            for i in range(wp.static(dim)):
                if values[i] >= real(CUTOFF):
                    axis = wp.transpose(R)[i]
                    L += wp.outer(axis, axis) / values[i]
                else:
                    lacking += 1
        return L, lacking

    return corrected_inverse


@functools.cache
def make_correct(space: Space) -> wp.Kernel:
    """Kernel: L_a from K_a (M3), which may be the same array; ``poor``: directions in which a particle fell back."""
    mat, Reference, invert = space.mat, structure(space, "Reference"), corrected_inverse(space)

    @wp.kernel(module="unique", enable_backward=False)
    def correct(first: int, K: wp.array(dtype=mat), reference: Reference, poor: wp.array(dtype=wp.int32)):
        a = first + wp.tid()
        L, lacking = invert(mat(K[a]))
        reference.L[a] = L
        poor[a] = lacking

    return correct
