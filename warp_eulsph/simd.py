"""What SIMD kernels share: packed rows, and the C++ that their loops over neighbours are made of.

A SIMD kernel is a Warp kernel whose loop over neighbours is C++ with clang's vector types (``wp.func_native``), for the
CPU only. A neighbour's vector fills a *row* of four lanes. Loops take eight neighbours k … k + 7 at a time, as four
vectors of two rows, those of k + i and k + i + 4. Sums run in the order of the lists, in up to eight parts.
"""

import functools

import warp as wp

from .space import Space, vector_type

LANES = 4  # of a row
ALIGNMENT = 64  # bytes, a cache line


def packed_rows(space: Space, n: int, vectors: int, device: wp.DeviceLike, within: wp.array | None = None) -> wp.array:
    """Rows of ``vectors`` times four reals for ``n`` particles, (n, 4 · vectors), on a cache line's boundary.

    In the memory of the rows ``within`` where they are large enough: for passes that take turns, each of which writes
    all that it reads. Otherwise in their own, zeroed.
    """
    size, item = n * vectors * LANES, wp.types.type_size_in_bytes(space.real)
    if within is not None and within.size >= size > 0:
        return within.flatten()[:size].reshape((n, vectors * LANES))
    room = wp.zeros(size + ALIGNMENT // item, dtype=space.real, device=device)
    skip = (-(room.ptr or 0) % ALIGNMENT) // item
    return room[skip : skip + size].reshape((n, vectors * LANES))


@functools.cache
def four_of(space: Space) -> wp.Function:
    """``wp.func`` (rows, a, m) -> four reals of packed rows, from 4 m on in that of a: for portable kernels.

    GPUs read 16 bytes at a time, where the compiler may take it that they lie on such a boundary.
    """
    real, vec4 = space.real, vector_type(LANES, space.real)
    name = "double" if real is wp.float64 else "float"

    @wp.func_native(f"""
    struct alignas(16) Four {{ {name} c[{LANES}]; }};
    const Four four = ((const Four*)(rows.data + (size_t)a * rows.shape[1]))[m];
    wp::vec_t<{LANES}, {name}> out;
    for (int i = 0; i < {LANES}; ++i) out.c[i] = four.c[i];
    return out;
    """)
    def four_of(rows: wp.array2d(dtype=real), a: int, m: int) -> vec4: ...

    return four_of


def _lanes(*of_row: int) -> str:
    """Lanes of a shuffle that does the same in both rows; from 4 on, those of the second operand."""
    return ", ".join(str(lane + (4 if lane >= 4 else 0) + 4 * row) for row in range(2) for lane in of_row)


_SHUFFLES = f"""
    auto both = [](Q low, Q high) __attribute__((always_inline)) {{
        return (V)__builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
    }};
    // one lane of each row in all lanes of that row
    auto spread = [](V u, int lane) __attribute__((always_inline)) {{
        switch (lane) {{
            case 0: return (V)__builtin_shufflevector(u, u, {_lanes(0, 0, 0, 0)});
            case 1: return (V)__builtin_shufflevector(u, u, {_lanes(1, 1, 1, 1)});
            case 2: return (V)__builtin_shufflevector(u, u, {_lanes(2, 2, 2, 2)});
            default: return (V)__builtin_shufflevector(u, u, {_lanes(3, 3, 3, 3)});
        }}
    }};
    // from the rows of eight neighbours the first lanes of all eight, the second ones, ...
    auto turn = [](const V* p, V* out) __attribute__((always_inline)) {{
        const V a = __builtin_shufflevector(p[0], p[1], {_lanes(0, 4, 2, 6)});
        const V b = __builtin_shufflevector(p[0], p[1], {_lanes(1, 5, 3, 7)});
        const V c = __builtin_shufflevector(p[2], p[3], {_lanes(0, 4, 2, 6)});
        const V d = __builtin_shufflevector(p[2], p[3], {_lanes(1, 5, 3, 7)});
        out[0] = __builtin_shufflevector(a, c, {_lanes(0, 1, 4, 5)});
        out[1] = __builtin_shufflevector(b, d, {_lanes(0, 1, 4, 5)});
        out[2] = __builtin_shufflevector(a, c, {_lanes(2, 3, 6, 7)});
        out[3] = __builtin_shufflevector(b, d, {_lanes(2, 3, 6, 7)});
    }};
    auto fold = [](V u) __attribute__((always_inline)) {{ return (Q)(u.lo + u.hi); }};
    auto total = [](V u) __attribute__((always_inline)) {{
        const Q q = u.lo + u.hi;
        return (q[0] + q[1]) + (q[2] + q[3]);
    }};
"""


@functools.cache
def prelude(space: Space) -> str:
    """C++ before a loop: the types T, Q (row of four) and V (two rows), what turns them about, nearest images.

    Expects ``box`` (vec) among the arguments of the function where space is periodic.
    """
    wide = space.real is wp.float64
    masked = f"__builtin_ia32_loadup{'d256' if wide else 's128'}_mask"
    lanes = f"__builtin_ia32_maskloadp{'d256' if wide else 's'}"
    image = ""
    if space.periodic:
        image = f"""
        V image_box = 0, image_rate = 0;
        #pragma unroll
        for (int i = 0; i < {space.dim}; ++i) {{
            image_box[i] = image_box[i + 4] = box.c[i];
            image_rate[i] = image_rate[i + 4] = box.c[i] > 0 ? 1 / box.c[i] : 0;
        }}
        """
    nearest = "d - image_box * __builtin_elementwise_rint(d * image_rate)" if space.periodic else "d"
    along = "d - image_box[j] * __builtin_elementwise_rint(d * image_rate[j])" if space.periodic else "d"
    return f"""
    #pragma clang fp contract(fast)
    typedef {"double" if wide else "float"} T;
    typedef T Q __attribute__((ext_vector_type(4)));
    typedef T V __attribute__((ext_vector_type(8)));
    constexpr int dim = {space.dim};
    // has the stack frame aligned, which clang does not by itself: spilled vectors that cross lines cost up to half
    alignas({ALIGNMENT}) volatile char aligned[{ALIGNMENT}];
    aligned[0] = 0;
    {_SHUFFLES}
    {image}
    // dim reals, then zeros
    auto load = [](const T* p) __attribute__((always_inline)) {{
    #if defined(__AVX512VL__) && __has_builtin({masked})
        typedef T M __attribute__((__vector_size__(4 * sizeof(T))));
        return (Q){masked}((const M*)p, M{{}}, (1 << dim) - 1);
    #elif defined(__AVX__) && __has_builtin({lanes})
        typedef {"long long" if wide else "int"} N __attribute__((__vector_size__(4 * sizeof(T))));
        typedef T M __attribute__((__vector_size__(4 * sizeof(T))));
        return (Q){lanes}((const M*)p, N{{-1, -(dim > 1), -(dim > 2), 0}});
    #else
        Q q = 0;
        #pragma unroll
        for (int i = 0; i < dim; ++i) q[i] = p[i];
        return q;
    #endif
    }};
    auto store = [](Q q) __attribute__((always_inline)) {{
        wp::vec_t<dim, T> out;
        #pragma unroll
        for (int i = 0; i < dim; ++i) out.c[i] = q[i];
        return out;
    }};
    auto nearest = [&](V d) __attribute__((always_inline)) {{ return {nearest}; }};
    // the same of differences of coordinate j alone
    auto nearest_along = [&](V d, int j) __attribute__((always_inline)) {{ return {along}; }};
    """


#: The row of particle ``a`` itself, in both halves of a vector, its last lane times ``sign``: what is added there where
#: the rest is subtracted has the other sign. Expects ``all``, the packed rows, and ``vectors``, how many each has.
OWN_ROW = """
    const auto mine = [&](int m, T sign) {
        Q q = all[(size_t)a * vectors + m];
        q[3] *= sign;
        return both(q, q);
    };
"""

_PLAIN = """
    auto eight_weights = [&](int k) { V v; __builtin_memcpy(&v, w.data + k, sizeof(V)); return v; };
    auto one_weight = [&](int k) { return w.data[k]; };
"""


def _tilted(weight: str) -> str:
    """C++ of the weights of a pair from ``w`` and ``own``, for numbers and vectors alike."""
    return f"""
    auto combined = [](auto w, auto own) __attribute__((always_inline)) {{ return {weight}; }};
    auto eight_weights = [&](int k) __attribute__((always_inline)) {{
        V eight_w, eight_own;
        __builtin_memcpy(&eight_w, w.data + k, sizeof(V));
        __builtin_memcpy(&eight_own, own.data + k, sizeof(V));
        return combined(eight_w, eight_own);
    }};
    auto one_weight = [&](int k) {{ return combined(w.data[k], own.data[k]); }};
    """


_EIGHT = """
    int k = begin;
    for (; k + 8 <= end; k += 8) eight(index.data + k, eight_weights(k));
    if (k < end) {
        int some[8];
        V some_w = 0;
        #pragma unroll
        for (int i = 0; i < 8; ++i) {
            some[i] = k + i < end ? index.data[k + i] : a;
            if (k + i < end) some_w[i] = one_weight(k + i);
        }
        eight(some, some_w);
    }
"""

_TWO = """
    int k = begin;
    for (; k + 8 <= end; k += 8) {
        const V eight_w = eight_weights(k);
        const int* const b = index.data + k;
        #pragma unroll
        for (int i = 0; i < 4; ++i) two(b[i], b[i + 4], spread(eight_w, i), i);
    }
    for (; k < end; k += 2) {
        const bool last = k + 1 == end;
        two(index.data[k], last ? a : index.data[k + 1], both((Q)one_weight(k), last ? (Q)0 : (Q)one_weight(k + 1)), 0);
    }
"""

#: C++ that calls ``eight(indices, weights)`` for the neighbours of ``a``, eight at a time; where fewer are left, ``a``
#: itself with weight zero makes up the number. Expects begin, end, index and w among the arguments.
BY_EIGHT = _PLAIN + _EIGHT

#: The same with the larger of the tilted weights (M17) of both ends; expects ``own`` too.
BY_EIGHT_LARGER = _tilted("w + __builtin_elementwise_abs(w - own)") + _EIGHT

#: C++ that calls ``two(b, c, weights)`` for the neighbours of ``a``, two at a time; of an odd number the last one comes
#: with ``a`` itself at weight zero. Expects begin, end, index and w among the arguments.
BY_TWO = _PLAIN + _TWO

#: The same with the tilted weights (M17) of the other ends; expects ``own`` too.
BY_TWO_DUAL = _tilted("w + (w - own)") + _TWO
