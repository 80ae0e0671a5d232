"""Corrected gradient (M4): exact for linear fields on any cloud, edges and corners included."""

import functools

import warp as wp

from ..fields import neighbour_structure, structure
from ..space import Space, difference
from .row_sums import outer_sum, slope_sum


@functools.cache
def make_gradient(space: Space, components: int, simd: bool = False) -> wp.Kernel:
    """Kernel: ∇f_a = Σ_b V_b g_ab (f_b − f_a) ⊗ ξ L_a, for rows f of ``components`` reals (M4).

    ξ joins the balanced positions of the particles (M13), their positions where nothing is balanced. ``simd`` has a
    meaning for rows of one real or ``dim`` reals only.
    """
    row, row_gradient = space.row(components), space.row_gradient(components)
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    separation = difference(space)
    if components == space.dim:
        sum_of = outer_sum(space, simd, of_positions=False)

        @wp.kernel(module="unique", enable_backward=False)
        def vector_gradient(
            first: int,
            reference: Reference,
            near: Neighbours,
            f: wp.array(dtype=row),
            out: wp.array(dtype=row_gradient),
        ):
            a = first + wp.tid()
            out[a] = sum_of(a, near, f, reference.balanced) @ reference.L[a]

        return vector_gradient

    if components == 1:
        slope_of = slope_sum(space, simd)

        @wp.kernel(module="unique", enable_backward=False)
        def scalar_gradient(
            first: int,
            reference: Reference,
            near: Neighbours,
            f: wp.array(dtype=row),
            out: wp.array(dtype=row_gradient),
        ):
            a = first + wp.tid()
            slope = slope_of(a, near, f, reference.balanced)
            sums = row_gradient()
            for i in range(wp.static(space.dim)):
                sums[0, i] = slope[i]
            out[a] = sums @ reference.L[a]

        return scalar_gradient

    @wp.kernel(module="unique", enable_backward=False)
    def gradient(
        first: int, reference: Reference, near: Neighbours, f: wp.array(dtype=row), out: wp.array(dtype=row_gradient)
    ):
        a = first + wp.tid()
        x_a = reference.balanced[a]
        f_a = f[a]
        sums = row_gradient()
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            xi = separation(reference.balanced[b], x_a, near.box)
            sums += wp.outer(f[b] - f_a, xi * near.own[k])
        out[a] = sums @ reference.L[a]

    return gradient


@functools.cache
def make_finish(space: Space) -> wp.Kernel:
    """Kernel: ∇f_a, for f of ``vec``, from its sums, in place: times L_a (M4)."""
    mat, Reference = space.mat, structure(space, "Reference")

    @wp.kernel(module="unique", enable_backward=False)
    def finish_gradient(first: int, reference: Reference, out: wp.array(dtype=mat)):
        a = first + wp.tid()
        out[a] = out[a] @ reference.L[a]

    return finish_gradient
