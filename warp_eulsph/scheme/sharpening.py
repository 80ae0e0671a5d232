"""Sharpened gradients: one step of defect correction on M4, its adjoint on M5, where the arrangement stays (M23)."""

import functools
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..execution import Launcher
from ..fields import neighbour_structure, structure
from ..operators.row_sums import outer_sum
from ..simd import BY_TWO, BY_TWO_DUAL, four_of, packed_rows, prelude
from ..space import Space, difference
from .reference import Configuration


@dataclass(frozen=True)
class Sharpening:
    """∇̃f = ∇f + ⅓ (∇f − S∇f), S∇f_a = Σ_b V_b g_ab (∇f_b ξ) ⊗ L_a ξ, and its exact adjoint in the force (M23).

    What the corrected gradient misses of a smooth field is of the second order, and M4 sees it itself: of the jumps
    that two particles' gradients leave between them, r_ab = f_b − f_a − ½(∇f_a + ∇f_b)ξ, it takes 3/2 of its own error,
    whatever the weights. Two thirds of the gradient of r added to ∇f leave an error of the fourth order inside, and a
    third to two thirds of the first-order error at free faces: waves disperse less, and coarse bodies are as stiff as
    they should be. Linear fields stay exact, and by the adjoint energy and both momenta.

    It acts where the arrangement does not move, at the price of two more sums over neighbours per step and of a step
    shorter by a sixth.
    """


#: Of ∇f − S∇f, the gradient of r times 2: half of 2/3.
SHARE = 1.0 / 3.0


@functools.cache
def pack_columns(space: Space) -> wp.Function:
    """``wp.func`` (a, R, x, rows): columns of a matrix, each with a coordinate of x beside it, into row a."""
    real, vec, mat, dim = space.real, space.vec, space.mat, space.dim

    @wp.func
    def pack_columns(a: int, R: mat, x: vec, rows: wp.array2d(dtype=real)):
        for j in range(wp.static(dim)):
            rows[a, 4 * j + 3] = x[j]
            for i in range(wp.static(dim)):
                rows[a, 4 * j + i] = R[i, j]

    return pack_columns


@functools.cache
def unpack_columns(space: Space) -> wp.Function:
    """``wp.func`` (rows, a) -> the matrix and the x of row a (``pack_columns``)."""
    real, vec, mat, dim, four = space.real, space.vec, space.mat, space.dim, four_of(space)

    @wp.func
    def unpack_columns(rows: wp.array2d(dtype=real), a: int):
        R, x = mat(), vec()
        for j in range(wp.static(dim)):
            column = four(rows, a, j)
            x[j] = column[3]
            for i in range(wp.static(dim)):
                R[i, j] = column[i]
        return R, x

    return unpack_columns


@functools.cache
def turned_sum(space: Space, simd: bool, dual: bool) -> wp.Function:
    """``wp.func`` (a, near, rows, x) -> Σ_b w (R_b ξ) ⊗ ξ, R_b a matrix in packed rows with x; w own or ``dual`` (M17).

    Rows hold the columns of R, each with a coordinate of x beside it (``pack_columns``).
    """
    real, vec, mat = space.real, space.vec, space.mat
    Neighbours, separation = neighbour_structure(space), difference(space)
    if not simd:
        unpack = unpack_columns(space)

        @wp.func
        def turned_sum(a: int, near: Neighbours, rows: wp.array2d(dtype=real), x: wp.array(dtype=vec)):
            x_a = x[a]
            sums = mat()
            for k in range(near.start[a], near.stop[a], near.stride):
                R_b, x_b = unpack(rows, near.index[k])
                xi = separation(x_b, x_a, near.box)
                w = near.own[k]
                if wp.static(dual):
                    w = near.w[k] + (near.w[k] - w)
                sums += wp.outer(R_b @ xi, xi * w)
            return sums

        return turned_sum

    snippet = f"""
    {prelude(space)}
    const Q* const all = (const Q*)rows.data;
    T x_a[dim];
    V sums[dim], more[dim];
    #pragma unroll
    for (int j = 0; j < dim; ++j) {{
        x_a[j] = all[(size_t)a * dim + j][3];
        sums[j] = more[j] = 0;
    }}
    auto two = [&](int b, int c, V w, int part) __attribute__((always_inline)) {{
        V turned = 0, xi[dim];
        #pragma unroll
        for (int j = 0; j < dim; ++j) {{
            const V R = both(all[(size_t)b * dim + j], all[(size_t)c * dim + j]);
            xi[j] = nearest_along(spread(R, 3) - x_a[j], j);
            turned += R * xi[j];
        }}
        turned *= w;
        #pragma unroll
        for (int j = 0; j < dim; ++j) {{
            if (part % 2) more[j] += turned * xi[j];
            else sums[j] += turned * xi[j];
        }}
    }};
    {BY_TWO_DUAL if dual else BY_TWO}
    wp::mat_t<dim, dim, T> out;
    #pragma unroll
    for (int j = 0; j < dim; ++j) {{
        const Q column = fold(sums[j] + more[j]);
        #pragma unroll
        for (int i = 0; i < dim; ++i) out.data[i][j] = column[i];
    }}
    return out;
    """

    @wp.func_native(snippet)
    def turned_row(
        a: int,
        begin: int,
        end: int,
        index: wp.array(dtype=int),
        w: wp.array(dtype=real),
        own: wp.array(dtype=real),
        box: vec,
        rows: wp.array2d(dtype=real),
    ) -> mat: ...

    if dual:

        @wp.func
        def turned_sum_dual(a: int, near: Neighbours, rows: wp.array2d(dtype=real), x: wp.array(dtype=vec)):
            return turned_row(a, near.start[a], near.start[a + 1], near.index, near.w, near.own, near.box, rows)

        return turned_sum_dual

    @wp.func
    def turned_sum_own(a: int, near: Neighbours, rows: wp.array2d(dtype=real), x: wp.array(dtype=vec)):
        return turned_row(a, near.start[a], near.start[a + 1], near.index, near.own, near.own, near.box, rows)

    return turned_sum_own


@functools.cache
def make_pack(space: Space) -> wp.Kernel:
    """Kernel: Π = Q Lᵀ (M5) into packed rows."""
    real, mat, pack_matrix = space.real, space.mat, pack_columns(space)
    Reference = structure(space, "Reference")

    @wp.kernel(module="unique", enable_backward=False)
    def pack(first: int, reference: Reference, Q: wp.array(dtype=mat), rows: wp.array2d(dtype=real)):
        a = first + wp.tid()
        pack_matrix(a, Q[a] @ wp.transpose(reference.L[a]), reference.x[a], rows)

    return pack


@functools.cache
def _make_gradient(space: Space, simd: bool) -> wp.Kernel:
    """Kernel: ∇f (M4) into packed rows."""
    real, vec = space.real, space.vec
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    sum_of, pack = outer_sum(space, simd, of_positions=False), pack_columns(space)

    @wp.kernel(module="unique", enable_backward=False)
    def gradient_rows(
        first: int, reference: Reference, near: Neighbours, f: wp.array(dtype=vec), rows: wp.array2d(dtype=real)
    ):
        a = first + wp.tid()
        pack(a, sum_of(a, near, f, reference.x) @ reference.L[a], reference.x[a], rows)

    return gradient_rows


@functools.cache
def _make_sharpen(space: Space, simd: bool) -> wp.Kernel:
    """Kernel: ∇̃f of ∇f in packed rows (M23)."""
    real, mat, dim = space.real, space.mat, space.dim
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    sum_of = turned_sum(space, simd, dual=False)

    @wp.kernel(module="unique", enable_backward=False)
    def sharpen(
        first: int, reference: Reference, near: Neighbours, rows: wp.array2d(dtype=real), out: wp.array(dtype=mat)
    ):
        a = first + wp.tid()
        smooth = sum_of(a, near, rows, reference.x) @ reference.L[a]
        plain = mat()
        for i in range(wp.static(dim)):
            for j in range(wp.static(dim)):
                plain[i, j] = rows[a, 4 * j + i]
        out[a] = plain + (plain - smooth) * real(SHARE)

    return sharpen


@functools.cache
def _make_stress(space: Space, simd: bool, packed: bool) -> wp.Kernel:
    """Kernel: Π̃ = Q̃ Lᵀ with Q̃ = Q + ⅓ (Q − Σ_b V_b g_ba (Π_b ξ) ⊗ ξ), the adjoint of ∇̃ (M23).

    Into ``packed`` rows, or into an array.
    """
    real, mat = space.real, space.mat
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    sum_of, pack = turned_sum(space, simd, dual=True), pack_columns(space)

    @wp.kernel(module="unique", enable_backward=False)
    def sharpen_stress(
        first: int,
        reference: Reference,
        near: Neighbours,
        Q: wp.array(dtype=mat),
        rows: wp.array2d(dtype=real),
        out: wp.array2d(dtype=real),
        Pi: wp.array(dtype=mat),
    ):
        a = first + wp.tid()
        sharp = Q[a] + (Q[a] - sum_of(a, near, rows, reference.x)) * real(SHARE)
        Pi_a = sharp @ wp.transpose(reference.L[a])
        if wp.static(packed):
            pack(a, Pi_a, reference.x[a], out)
        else:
            Pi[a] = Pi_a

    return sharpen_stress


class Sharpener:
    """M23 at work on a reference whose arrangement stays.

    Args:
        within: rows whose memory it may use (``packed_rows``), which are made anew before they are read again.

    Attributes:
        stress_rows: Π̃ in packed rows, after ``stress``.
    """

    def __init__(
        self, space: Space, configuration: Configuration, n: int, device: wp.DeviceLike, within: wp.array | None = None
    ):
        self.space, self.configuration, self._launch = space, configuration, Launcher(device)
        rows = packed_rows(space, 2 * n, space.dim, device, within)
        self._rows, self.stress_rows = rows[:n], rows[n:]
        self._no_Pi = wp.zeros(0, dtype=space.mat, device=device)

    def gradient(self, f: wp.array, out: wp.array) -> None:
        """``out`` ← ∇̃f of ``f``, both of vec and mat, (n,)."""
        reference, near, simd = self.configuration.fields, self.configuration.near, self.configuration.simd
        self._launch(_make_gradient(self.space, simd), len(f), [reference, near, f, self._rows])
        self._launch(_make_sharpen(self.space, simd), len(f), [reference, near, self._rows, out])

    def stress(self, Q: wp.array) -> None:
        """Π̃ from Q, (n,) of mat, into ``stress_rows``."""
        self._sharpen(Q, self._no_Pi, self.configuration.simd, packed=True)

    def unit(self) -> wp.array:
        """Π̃ of a unit stress, (n,) of mat, whose dual divergence is −e_a."""
        n = len(self._rows)
        Q = wp.full(n, np.eye(self.space.dim), dtype=self.space.mat, device=self._rows.device)
        Pi = wp.zeros_like(Q)
        self._sharpen(Q, Pi, simd=False, packed=False)
        self._launch.forget()  # Q, which would stay with its launches
        return Pi

    def _sharpen(self, Q: wp.array, Pi: wp.array, simd: bool, packed: bool) -> None:
        reference, near, n = self.configuration.fields, self.configuration.near, len(Q)
        self._launch(make_pack(self.space), n, [reference, Q, self._rows])
        arguments = [reference, near, Q, self._rows, self.stress_rows, Pi]
        self._launch(_make_stress(self.space, simd, packed), n, arguments)
