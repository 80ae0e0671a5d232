"""Sums over one particle's row of neighbours, which the operators are made of: portable, or SIMD on the CPU.

Each factory returns a ``wp.func`` of (a, near, …); with ``simd`` it is the SIMD one, equal up to round-off.
"""

import functools

import warp as wp

from ..fields import neighbour_structure
from ..simd import BY_TWO, prelude
from ..space import Space, difference


@functools.cache
def laplacian_sum(space: Space, simd: bool) -> wp.Function:
    """``wp.func`` (a, near, f, diagonal) -> Σ_b w_ab (f_b − f_a), ``diagonal`` = Σ_b w_ab."""
    real, vec = space.real, space.vec
    Neighbours = neighbour_structure(space)
    if not simd:

        @wp.func
        def laplacian_sum(a: int, near: Neighbours, f: wp.array(dtype=vec), diagonal: wp.array(dtype=real)):
            f_a = f[a]
            total = vec()
            for k in range(near.start[a], near.stop[a], near.stride):
                total += (f[near.index[k]] - f_a) * near.w[k]
            return total

        return laplacian_sum

    snippet = f"""
    {prelude(Space(space.dim, space.real))}
    V sums[4] = {{0, 0, 0, 0}};
    auto two = [&](int b, int c, V w, int part) __attribute__((always_inline)) {{
        sums[part] += both(load(f.data[b].c), load(f.data[c].c)) * w;
    }};
    {BY_TWO}
    return store(fold((sums[0] + sums[1]) + (sums[2] + sums[3])));
    """

    @wp.func_native(snippet)
    def weighted_sum(
        a: int, begin: int, end: int, index: wp.array(dtype=wp.int32), w: wp.array(dtype=real), f: wp.array(dtype=vec)
    ) -> vec: ...

    @wp.func
    def laplacian_sum_simd(a: int, near: Neighbours, f: wp.array(dtype=vec), diagonal: wp.array(dtype=real)):
        return weighted_sum(a, near.start[a], near.start[a + 1], near.index, near.w, f) - f[a] * diagonal[a]

    return laplacian_sum_simd


@functools.cache
def outer_sum(space: Space, simd: bool, of_positions: bool) -> wp.Function:
    """``wp.func`` (a, near, f, x) -> Σ_b w_ab (f_b − f_a) ⊗ (x_b − x_a) of two fields of ``vec``, x positions, own w.

    With ``of_positions`` f are positions too, whose differences take the nearest image in a periodic box.
    """
    real, vec, mat = space.real, space.vec, space.mat
    Neighbours = neighbour_structure(space)
    separation = difference(space)
    if not simd:

        @wp.func
        def outer_sum(a: int, near: Neighbours, f: wp.array(dtype=vec), x: wp.array(dtype=vec)):
            f_a, x_a = f[a], x[a]
            sums = mat()
            for k in range(near.start[a], near.stop[a], near.stride):
                b = near.index[k]
                df = f[b] - f_a
                if wp.static(of_positions):
                    df = separation(f[b], f_a, near.box)
                sums += wp.outer(df, separation(x[b], x_a, near.box) * near.own[k])
            return sums

        return outer_sum

    snippet = f"""
    {prelude(space)}
    const Q f_one = load(f.data[a].c), x_one = load(x.data[a].c);
    const V f_a = both(f_one, f_one), x_a = both(x_one, x_one);
    V sums[dim];
    #pragma unroll
    for (int i = 0; i < dim; ++i) sums[i] = 0;
    auto two = [&](int b, int c, V w, int) __attribute__((always_inline)) {{
        const V df = {"nearest" if of_positions else ""}(both(load(f.data[b].c), load(f.data[c].c)) - f_a);
        const V dx = nearest(both(load(x.data[b].c), load(x.data[c].c)) - x_a) * w;
        #pragma unroll
        for (int i = 0; i < dim; ++i) sums[i] += spread(df, i) * dx;
    }};
    {BY_TWO}
    wp::mat_t<dim, dim, T> out;
    #pragma unroll
    for (int i = 0; i < dim; ++i) {{
        const Q row = fold(sums[i]);
        #pragma unroll
        for (int j = 0; j < dim; ++j) out.data[i][j] = row[j];
    }}
    return out;
    """

    @wp.func_native(snippet)
    def outer_row(
        a: int,
        begin: int,
        end: int,
        index: wp.array(dtype=int),
        w: wp.array(dtype=real),
        box: vec,
        f: wp.array(dtype=vec),
        x: wp.array(dtype=vec),
    ) -> mat: ...

    @wp.func
    def outer_sum_simd(a: int, near: Neighbours, f: wp.array(dtype=vec), x: wp.array(dtype=vec)):
        return outer_row(a, near.start[a], near.start[a + 1], near.index, near.own, near.box, f, x)

    return outer_sum_simd


@functools.cache
def slope_sum(space: Space, simd: bool) -> wp.Function:
    """``wp.func`` (a, near, f, x) -> Σ_b w_ab (f_b − f_a)(x_b − x_a) of a field of one real, x positions, own w."""
    real, vec, row = space.real, space.vec, space.row(1)
    Neighbours = neighbour_structure(space)
    separation = difference(space)
    if not simd:

        @wp.func
        def slope_sum(a: int, near: Neighbours, f: wp.array(dtype=row), x: wp.array(dtype=vec)):
            f_a, x_a = f[a], x[a]
            total = vec()
            for k in range(near.start[a], near.stop[a], near.stride):
                b = near.index[k]
                total += separation(x[b], x_a, near.box) * near.own[k] * (f[b][0] - f_a[0])
            return total

        return slope_sum

    snippet = f"""
    {prelude(space)}
    const Q x_one = load(x.data[a].c);
    const V x_a = both(x_one, x_one), f_a = (V)f.data[a].c[0];
    V sums[4] = {{0, 0, 0, 0}};
    auto two = [&](int b, int c, V w, int part) __attribute__((always_inline)) {{
        const V df = both((Q)f.data[b].c[0], (Q)f.data[c].c[0]) - f_a;
        sums[part] += nearest(both(load(x.data[b].c), load(x.data[c].c)) - x_a) * (df * w);
    }};
    {BY_TWO}
    return store(fold((sums[0] + sums[1]) + (sums[2] + sums[3])));
    """

    @wp.func_native(snippet)
    def slope_row(
        a: int,
        begin: int,
        end: int,
        index: wp.array(dtype=int),
        w: wp.array(dtype=real),
        box: vec,
        f: wp.array(dtype=row),
        x: wp.array(dtype=vec),
    ) -> vec: ...

    @wp.func
    def slope_sum_simd(a: int, near: Neighbours, f: wp.array(dtype=row), x: wp.array(dtype=vec)):
        return slope_row(a, near.start[a], near.start[a + 1], near.index, near.own, near.box, f, x)

    return slope_sum_simd


@functools.cache
def flux_sum(space: Space, simd: bool) -> wp.Function:
    """``wp.func`` (a, near, Q, x) -> Σ_b w_ab (Q_a + Q_b)(x_b − x_a) for a field of ``mat``."""
    real, vec, mat = space.real, space.vec, space.mat
    Neighbours = neighbour_structure(space)
    separation = difference(space)
    if not simd:

        @wp.func
        def flux_sum(a: int, near: Neighbours, Q: wp.array(dtype=mat), x: wp.array(dtype=vec)):
            Q_a, x_a = Q[a], x[a]
            total = vec()
            for k in range(near.start[a], near.stop[a], near.stride):
                b = near.index[k]
                total += (Q_a + Q[b]) @ (separation(x[b], x_a, near.box) * near.w[k])
            return total

        return flux_sum

    snippet = f"""
    {prelude(space)}
    const Q x_one = load(x.data[a].c);
    const V x_a = both(x_one, x_one);
    V Q_a[dim], sums[dim];
    #pragma unroll
    for (int j = 0; j < dim; ++j) {{
        const Q row = load(flux.data[a].data[j]);
        Q_a[j] = both(row, row);
        sums[j] = 0;
    }}
    auto two = [&](int b, int c, V w, int) __attribute__((always_inline)) {{
        const V dx = nearest(both(load(x.data[b].c), load(x.data[c].c)) - x_a) * w;
        #pragma unroll
        for (int i = 0; i < dim; ++i)
            sums[i] += (Q_a[i] + both(load(flux.data[b].data[i]), load(flux.data[c].data[i]))) * dx;
    }};
    {BY_TWO}
    wp::vec_t<dim, T> out;
    #pragma unroll
    for (int j = 0; j < dim; ++j) out.c[j] = total(sums[j]);
    return out;
    """

    @wp.func_native(snippet)
    def flux_row(
        a: int,
        begin: int,
        end: int,
        index: wp.array(dtype=int),
        w: wp.array(dtype=real),
        box: vec,
        flux: wp.array(dtype=mat),
        x: wp.array(dtype=vec),
    ) -> vec: ...

    @wp.func
    def flux_sum_simd(a: int, near: Neighbours, Q: wp.array(dtype=mat), x: wp.array(dtype=vec)):
        return flux_row(a, near.start[a], near.start[a + 1], near.index, near.w, near.box, Q, x)

    return flux_sum_simd
