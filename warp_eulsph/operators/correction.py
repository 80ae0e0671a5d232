"""Pair weights and the gradient correction L_a = K_a⁻¹ (M3), with its fall-back for poor neighbourhoods."""

import functools

import warp as wp

from ..fields import neighbour_structure, structure
from ..linalg import inverse, symmetric_bounds, symmetric_eigen
from ..simd import OWN_ROW, prelude
from ..space import Space, difference
from ..weights import Weight
from ..weights.base import pair_weight

# K is the identity where the neighbourhood is full and about a half at flat surfaces. Along a direction in which it
# keeps less than this share, differences carry no usable slope and the gradient's component there is set to zero.
CUTOFF = 0.02
# Rows of four that the SIMD pass reads of a neighbour.
VECTORS = 2


@functools.cache
def make_pair_sums(weight: Weight, space: Space, of_v: bool) -> wp.Kernel:
    """Kernel: w_ab = V_b g_ab of every pair, its sum, K_a = Σ w ξ⊗ξ (M3, ξ = x_b − x_a) and the mass sum of M7.

    With ``of_v`` the sums of ∇v instead of masses, Σ w (v_b − v_a)⊗ξ: what M4 multiplies by L.
    """
    real, vec, mat = space.real, space.vec, space.mat
    Particles, Reference, Neighbours = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        neighbour_structure(space),
    )
    separation, g_of = difference(space), pair_weight(weight, space)

    @wp.kernel(module="unique", enable_backward=False)
    def pair_sums(
        first: int,
        particles: Particles,
        reference: Reference,
        near: Neighbours,
        v: wp.array(dtype=vec),
        K: wp.array(dtype=mat),
        out: wp.array(dtype=mat),
    ):
        a = first + wp.tid()
        x_a = reference.x[a]
        h_a = reference.h[a]
        K_a, changes = mat(), mat()
        row = real(0.0)
        diagonal = real(0.0)
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            xi = separation(reference.x[b], x_a, near.box)
            g = g_of(wp.length(xi), real(0.5) * (h_a + reference.h[b]))
            w = reference.V[b] * g
            near.w[k] = w
            K_a += wp.outer(xi, xi) * w
            diagonal += w
            if wp.static(of_v):
                changes += wp.outer(v[b] - v[a], xi * w)
            else:
                row += particles.mass[b] * g
        K[a] = K_a
        if wp.static(of_v):
            out[a] = changes
        else:
            reference.row[a] = row
        reference.diagonal[a] = diagonal

    return pair_sums


@functools.cache
def make_pack(space: Space, of_v: bool) -> wp.Kernel:
    """Kernel: what ``make_pair_sums_simd`` reads of a neighbour, ``VECTORS`` rows of four: x with h, v or m with V."""
    real, vec, dim = space.real, space.vec, space.dim
    Particles, Reference = structure(space, "Particles"), structure(space, "Reference")

    @wp.kernel(module="unique", enable_backward=False)
    def pack(
        first: int, particles: Particles, reference: Reference, v: wp.array(dtype=vec), rows: wp.array2d(dtype=real)
    ):
        a = first + wp.tid()
        x_a = reference.x[a]
        rows[a, 4] = particles.mass[a]
        for i in range(wp.static(dim)):
            rows[a, i] = x_a[i]
            if wp.static(of_v):
                rows[a, 4 + i] = v[a][i]
        rows[a, 3] = reference.h[a]
        rows[a, 7] = reference.V[a]

    return pack


@functools.cache
def make_pair_sums_simd(weight: Weight, space: Space, of_v: bool) -> wp.Kernel:
    """SIMD kernel of ``make_pair_sums``, from packed rows."""
    real, vec, mat = space.real, space.vec, space.mat
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    sigma = weight.sigma[space.dim - 1]
    snippet = f"""
    {prelude(space)}
    constexpr int vectors = {VECTORS};
    constexpr bool of_v = {str(of_v).lower()};
    const Q* const all = (const Q*)rows.data;
    {OWN_ROW}
    auto slope = [](V q) __attribute__((always_inline)) {{ return {weight.slope_cpp}; }};
    // lengths h are added where the rest is subtracted, volumes and masses are taken as they are
    const V x_a = mine(0, -1), v_a = of_v ? mine(1, 0) : (V)0;
    V sums[dim * dim], changes[dim * dim], row = 0, diagonal = 0;
    #pragma unroll
    for (int i = 0; i < dim * dim; ++i) sums[i] = changes[i] = 0;
    auto eight = [&](int k, const int* b, int many) __attribute__((always_inline)) {{
        V p[4], u[4], xi[4], dv[4];
        #pragma unroll
        for (int i = 0; i < 4; ++i) {{
            const Q* const B = all + (size_t)b[i] * vectors;
            const Q* const C = all + (size_t)b[i + 4] * vectors;
            p[i] = nearest(both(B[0], C[0]) - x_a);
            u[i] = both(B[1], C[1]) - v_a;
        }}
        turn(p, xi);
        turn(u, dv);
        V rr = xi[0] * xi[0];
        #pragma unroll
        for (int i = 1; i < dim; ++i) rr += xi[i] * xi[i];
        const V rate = 2 / xi[3], q = __builtin_elementwise_sqrt(rr) * rate;
        V g = slope(q) * T({sigma!r});
        #pragma unroll
        for (int i = 0; i < dim + 2; ++i) g *= rate;
        g = q < T({weight.support!r}) ? g : (V)0;
        for (int i = many; i < 8; ++i) g[i] = 0;
        const V w_ab = g * dv[3];
        if (many == 8) __builtin_memcpy(w.data + k, &w_ab, sizeof(V));
        else for (int i = 0; i < many; ++i) w.data[k + i] = w_ab[i];
        diagonal += w_ab;
        if (!of_v) row += g * dv[0];
        #pragma unroll
        for (int j = 0; j < dim; ++j) {{
            const V along = xi[j] * w_ab;
            #pragma unroll
            for (int i = j; i < dim; ++i) sums[i * dim + j] += xi[i] * along;
            #pragma unroll
            for (int i = 0; i < of_v * dim; ++i) changes[i * dim + j] += dv[i] * along;
        }}
    }};
    int k = begin;
    for (; k + 8 <= end; k += 8) eight(k, index.data + k, 8);
    if (k < end) {{
        int some[8];  // the particle itself makes up the number, with no weight
        #pragma unroll
        for (int i = 0; i < 8; ++i) some[i] = k + i < end ? index.data[k + i] : a;
        eight(k, some, end - k);
    }}
    #pragma unroll
    for (int i = 0; i < dim; ++i) {{
        for (int j = 0; j <= i; ++j) K.data[a].data[i][j] = K.data[a].data[j][i] = total(sums[i * dim + j]);
        for (int j = 0; j < of_v * dim; ++j) out.data[a].data[i][j] = total(changes[i * dim + j]);
    }}
    if (!of_v) masses.data[a] = total(row);
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
        rows: wp.array2d(dtype=real),
        K: wp.array(dtype=mat),
        masses: wp.array(dtype=real),
        diagonals: wp.array(dtype=real),
        out: wp.array(dtype=mat),
    ): ...

    @wp.kernel(module="unique", enable_backward=False)
    def pair_sums_simd(
        first: int,
        reference: Reference,
        near: Neighbours,
        rows: wp.array2d(dtype=real),
        K: wp.array(dtype=mat),
        out: wp.array(dtype=mat),
    ):
        a = first + wp.tid()
        begin, end, w, box = near.start[a], near.start[a + 1], near.w, near.box
        weigh(a, begin, end, near.index, w, box, rows, K, reference.row, reference.diagonal, out)

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
