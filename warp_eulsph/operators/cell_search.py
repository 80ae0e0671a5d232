"""The search for one particle's neighbours among particles sorted into cells (``cells.py``), eight at a time."""

import functools

import warp as wp

from ..simd import prelude
from ..space import Space

# Cell coordinates are rounded, distances are tested exactly: a query a little too wide misses nothing.
MARGIN = 1.001
# Columns of cells that a particle reaches into, at most four along two axes; where there are more, in several goes.
MOST_RUNS = 16

# Of each choice of eight the numbers of the chosen ones, a byte each from the lowest on.
_CHOSEN = ", ".join(
    f"{sum(i << (8 * k) for k, i in enumerate(i for i in range(8) if bits >> i & 1))}ull" for bits in range(256)
)

_TYPES = f"""
    typedef T X __attribute__((ext_vector_type(8)));
    typedef int I __attribute__((ext_vector_type(8)));
    typedef bool B __attribute__((ext_vector_type(8)));
    // write the chosen ones of eight; up to eight places are overwritten
    auto append = [](int* to, I b, unsigned char bits) __attribute__((always_inline)) {{
    #if defined(__AVX512VL__)
        b = (I)__builtin_ia32_compresssi256_mask(b, I{{}}, bits);
        __builtin_memcpy(to, &b, sizeof(I));
    #elif defined(__AVX2__)
        static const unsigned long long chosen[256] = {{{_CHOSEN}}};
        typedef unsigned char Bytes __attribute__((ext_vector_type(8)));
        Bytes which;
        __builtin_memcpy(&which, chosen + bits, sizeof(Bytes));
        b = (I)__builtin_ia32_permvarsi256(b, __builtin_convertvector(which, I));
        __builtin_memcpy(to, &b, sizeof(I));
    #else
        for (; bits; bits &= bits - 1) *to++ = b[__builtin_ctz(bits)];
    #endif
    }};
"""
# C++ of one particle's search: ``found(b, bits)`` is called with eight candidates b, and a bit for each of
# them that is a neighbour.
_LOOK = """
    const size_t width = columns.strides[0] / sizeof(T);
    const T* column[5];
    for (int i = 0; i < 5; ++i) column[i] = columns.data + i * width;
    const T h_a = h.data[a], own = T(body.data[a]);
    const T* const rate = frame.data + 3;
    const T reach = T(0.5) * support * (h_a + frame.data[6]) * T(MARGIN);
    const int* side = sides.data;
    auto clamped = [](T x, int most) { x = x > 0 ? x : T(0); return x < T(most) ? (int)x : most; };
    T per_cell[3];
    for (int i = 0; i < 3; ++i) per_cell[i] = 1 / (rate[i] * rate[i]);
    // distance of x from slab c of axis i, squared; the outermost slabs have no end
    auto outside = [&](T x, int i, int c) {
        const T along = (x - frame.data[i]) * rate[i], below = T(c) - along, above = along - T(c + 1);
        const T out = c > 0 && below > 0 ? below : c < side[i] - 1 && above > 0 ? above : T(0);
        return out * out * per_cell[i];
    };
    // the candidates from j to last
    auto look_at = [&](const T* p, int j, int last) __attribute__((always_inline)) {
        for (; j < last; j += 8) {
            X rr = 0, c;
            for (int i = 3 - dim; i < 3; ++i) {
                __builtin_memcpy(&c, column[i] + j, sizeof(X));
                c -= p[i];
                rr += c * c;
            }
            __builtin_memcpy(&c, column[3] + j, sizeof(X));
            c = (c + h_a) * (T(0.5) * support);
            auto hit = rr < c * c;
            __builtin_memcpy(&c, column[4] + j, sizeof(X));
            hit &= c == own;
            I b;
            __builtin_memcpy(&b, order.data + j, sizeof(I));
            const B near = __builtin_convertvector(hit, B), other = __builtin_convertvector(b != a, B);
            unsigned char near_bits, other_bits;
            __builtin_memcpy(&near_bits, &near, 1);
            __builtin_memcpy(&other_bits, &other, 1);
            const unsigned char all = last - j >= 8 ? 255 : (1 << (last - j)) - 1;
            found(b, near_bits & other_bits & all);
        }
    };
    auto look = [&](const T* p) __attribute__((always_inline)) {
        int c0[3], c1[3];
        for (int i = 0; i < 3; ++i) {
            c0[i] = clamped((p[i] - reach - frame.data[i]) * rate[i], side[i] - 1);
            c1[i] = clamped((p[i] + reach - frame.data[i]) * rate[i], side[i] - 1);
        }
        // first where the runs of candidates are, then the candidates: the one does not wait for the other
        int from[MOST_RUNS], to[MOST_RUNS], runs = 0;
        auto look_at_runs = [&]() __attribute__((always_inline)) {
            for (int run = 0; run < runs; ++run) look_at(p, from[run], to[run]);
            runs = 0;
        };
        for (int x = c0[0]; x <= c1[0]; ++x) {
            const T dx = dim > 2 ? outside(p[0], 0, x) : T(0);
            for (int y = c0[1]; y <= c1[1]; ++y) {
                const T left = reach * reach - dx - (dim > 1 ? outside(p[1], 1, y) : T(0));
                const T half = __builtin_sqrt(left > 0 ? left : T(0));
                const int first = (x * side[1] + y) * side[2];
                const int z0 = clamped((p[2] - half - frame.data[2]) * rate[2], side[2] - 1);
                const int z1 = clamped((p[2] + half - frame.data[2]) * rate[2], side[2] - 1);
                from[runs] = begin.data[first + z0];
                to[runs] = begin.data[first + z1 + 1];
                runs += left >= 0;
                if (runs == MOST_RUNS) look_at_runs();
            }
        }
        look_at_runs();
    };
"""
_OPEN = "look(place.data[a].c);"
# In a periodic box, the particle's images that can reach into it look too.
_PERIODIC = """
    for (int x = dim > 2 ? -1 : 0; x <= (dim > 2 ? 1 : 0); ++x)
        for (int y = dim > 1 ? -1 : 0; y <= (dim > 1 ? 1 : 0); ++y)
            for (int z = -1; z <= 1; ++z) {
                const int shift[3] = {x, y, z};
                T p[3];
                bool inside = true;
                for (int i = 0; i < 3; ++i) {
                    p[i] = place.data[a].c[i];
                    if (i < 3 - dim || shift[i] == 0) continue;
                    const T length = box.c[i - 3 + dim];
                    p[i] += shift[i] * length;
                    inside = inside && length > 0 && p[i] > -reach && p[i] < length + reach;
                }
                if (inside) look(p);
            }
"""
_COUNT = """
    int* const kept = scratch.data + (size_t)a * stride;
    int n = 0;
    auto found = [&](I b, unsigned char bits) __attribute__((always_inline)) {
        if (n + 8 <= stride) append(kept + n, b, bits);
        n += __builtin_popcount(bits);
    };
    {search}
    count.data[a] = n;
"""
# A row is put in order by ranks: the rank of an index is the number of smaller ones. Rows that the count has no room
# for are searched again, long ones sorted by insertion.
_FILL = """
    constexpr int room = 512;
    int* const row = index.data + start.data[a];
    const int size = start.data[a + 1] - start.data[a];
    int some[room + 16], n = 0;
    auto found = [&](I b, unsigned char bits) __attribute__((always_inline)) {
        if (size <= room) {
            append(some + n, b, bits);
            n += __builtin_popcount(bits);
            return;
        }
        for (; bits; bits &= bits - 1) {
            int k = n++;
            for (; k > 0 && row[k - 1] > b[__builtin_ctz(bits)]; --k) row[k] = row[k - 1];
            row[k] = b[__builtin_ctz(bits)];
        }
    };
    if (size <= room && size + 8 <= stride) {
        __builtin_memcpy(some, scratch.data + (size_t)a * stride, size * sizeof(int));
    } else {
        auto search_again = [&]() __attribute__((noinline)) { {search} };
        search_again();
        if (size > room) return;
    }
    if (size == 0) return;
    typedef short H __attribute__((ext_vector_type(16)));
    constexpr int vectors = 5;  // ranked at a time
    short key[room + 16 * vectors], rank[room + 16 * vectors];
    int wide = 0;
    for (int i = 0; i < size; ++i) {
        const int away = some[i] - a;
        key[i] = short(away);
        wide |= (away + 32768) >> 16;
    }
    if (wide == 0) {  // nearly always: 16 bits tell them apart, and a vector holds 16
        for (int v = 0; v < size; v += 16 * vectors) {
            H x[vectors], r[vectors];
            __builtin_memcpy(x, key + v, sizeof(x));
            #pragma unroll
            for (int i = 0; i < vectors; ++i) r[i] = 0;
            for (int j = 0; j < size; ++j) {
                #pragma unroll
                for (int i = 0; i < vectors; ++i) r[i] -= x[i] > key[j];
            }
            __builtin_memcpy(rank + v, r, sizeof(r));
        }
        for (int i = 0; i < size; ++i) row[rank[i]] = some[i];
    } else {
        for (int i = 0; i < size; ++i) {
            int rank = 0;
            for (int j = 0; j < size; ++j) rank += some[j] < some[i];
            row[rank] = some[i];
        }
    }
"""


@functools.cache
def make_search(space: Space, fill: bool) -> wp.Kernel:
    """Kernel: count a row's neighbours, or (``fill``) write them sorted by index."""
    real, vec = space.real, space.vec
    vec3 = wp.types.vector(length=3, dtype=real)
    search = _LOOK + (_PERIODIC if space.periodic else _OPEN)
    action = (_FILL if fill else _COUNT).replace("{search}", search)
    constants = f"constexpr T MARGIN = {MARGIN};\nconstexpr int MOST_RUNS = {MOST_RUNS};\n"
    snippet = prelude(Space(space.dim, space.real)) + constants + _TYPES + action

    @wp.func_native(snippet)
    def find(
        a: int,
        place: wp.array(dtype=vec3),
        h: wp.array(dtype=real),
        body: wp.array(dtype=int),
        box: vec,
        support: real,
        frame: wp.array(dtype=real),
        sides: wp.array(dtype=int),
        begin: wp.array(dtype=int),
        order: wp.array(dtype=int),
        columns: wp.array2d(dtype=real),
        count: wp.array(dtype=int),
        start: wp.array(dtype=int),
        index: wp.array(dtype=int),
        scratch: wp.array(dtype=int),
        stride: int,
    ): ...

    @wp.kernel(module="unique", enable_backward=False)
    def search_cells(
        first: int,
        place: wp.array(dtype=vec3),
        h: wp.array(dtype=real),
        body: wp.array(dtype=int),
        box: vec,
        support: real,
        frame: wp.array(dtype=real),
        sides: wp.array(dtype=int),
        begin: wp.array(dtype=int),
        order: wp.array(dtype=int),
        columns: wp.array2d(dtype=real),
        count: wp.array(dtype=int),
        start: wp.array(dtype=int),
        index: wp.array(dtype=int),
        scratch: wp.array(dtype=int),
        stride: int,
    ):
        a = first + wp.tid()
        find(a, place, h, body, box, support, frame, sides, begin, order, columns, count, start, index, scratch, stride)

    return search_cells
