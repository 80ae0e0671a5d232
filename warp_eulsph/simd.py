"""What SIMD kernels share: packed rows, and the C++ that their loops over neighbours are made of.

A SIMD kernel is a Warp kernel whose loop over neighbours is C++ with vectors of four reals (``wp.func_native`` and
clang's vector types), for the CPU only. It reads what it needs of a neighbour from one *packed row*: a few vectors of
four, aligned, so that a neighbour costs a few loads. Sums run in the order of the lists, in up to four parts.
"""

import functools
from typing import Any

import warp as wp

from .space import Space

LANES = 4
ALIGNMENT = 64  # bytes, a cache line


def packed_rows(space: Space, n: int, vectors: int, device: Any) -> wp.array:
    """Zeroed rows of ``vectors`` times four reals for ``n`` particles, (n, 4 · vectors), on a cache line's boundary."""
    size, item = n * vectors * LANES, wp.types.type_size_in_bytes(space.real)
    room = wp.zeros(size + ALIGNMENT // item, dtype=space.real, device=device)
    skip = (-(room.ptr or 0) % ALIGNMENT) // item
    return room[skip : skip + size].reshape((n, vectors * LANES))


@functools.cache
def prelude(space: Space) -> str:
    """C++ before a loop: the types T and V (vector of four), loads and stores of ``vec``, sums over lanes, images.

    Expects ``box`` (vec) among the arguments of the function where space is periodic.
    """
    real = "double" if space.real is wp.float64 else "float"
    image = ""
    if space.periodic:
        image = f"""
        V image_box = 0, image_rate = 0;
        #pragma unroll
        for (int i = 0; i < {space.dim}; ++i) {{
            image_box[i] = box.c[i];
            image_rate[i] = box.c[i] > 0 ? 1 / box.c[i] : 0;
        }}
        """
    nearest = "d - image_box * __builtin_elementwise_rint(d * image_rate)" if space.periodic else "d"
    return f"""
    #pragma clang fp contract(fast)
    typedef {real} T;
    typedef {real} V __attribute__((ext_vector_type(4)));
    constexpr int dim = {space.dim};
    {image}
    auto load = [](const T* p) __attribute__((always_inline)) {{
        V v = 0;
        #pragma unroll
        for (int i = 0; i < dim; ++i) v[i] = p[i];
        return v;
    }};
    auto store = [](V v) __attribute__((always_inline)) {{
        wp::vec_t<dim, T> out;
        #pragma unroll
        for (int i = 0; i < dim; ++i) out.c[i] = v[i];
        return out;
    }};
    auto nearest = [&](V d) __attribute__((always_inline)) {{ return {nearest}; }};
    // the components of four vectors: x of all four, y of all four, ...
    auto turn = [](const V* p, V* out) __attribute__((always_inline)) {{
        V a = __builtin_shufflevector(p[0], p[1], 0, 4, 2, 6), b = __builtin_shufflevector(p[0], p[1], 1, 5, 3, 7);
        V c = __builtin_shufflevector(p[2], p[3], 0, 4, 2, 6), d = __builtin_shufflevector(p[2], p[3], 1, 5, 3, 7);
        out[0] = __builtin_shufflevector(a, c, 0, 1, 4, 5);
        out[1] = __builtin_shufflevector(b, d, 0, 1, 4, 5);
        out[2] = __builtin_shufflevector(a, c, 2, 3, 6, 7);
        out[3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
    }};
    // sums over the first dim lanes of each of four vectors
    auto lane_sums = [&](const V* p) __attribute__((always_inline)) {{
        V c[4];
        turn(p, c);
        V s = c[0];
        #pragma unroll
        for (int i = 1; i < dim; ++i) s += c[i];
        return s;
    }};
    """


#: C++ that calls ``four(indices, weights)`` for the neighbours of ``a``, four at a time; where fewer are left, ``a``
#: itself with weight zero makes up the number. Expects begin, end, index and w among the arguments.
BY_FOUR = """
    int k = begin;
    for (; k + 4 <= end; k += 4) {
        V four_w;
        __builtin_memcpy(&four_w, w.data + k, sizeof(V));
        four(index.data + k, four_w);
    }
    if (k < end) {
        int some[4] = {a, a, a, a};
        V some_w = 0;
        #pragma unroll
        for (int i = 0; i < 3; ++i) {
            if (k + i < end) {
                some[i] = index.data[k + i];
                some_w[i] = w.data[k + i];
            }
        }
        four(some, some_w);
    }
"""
