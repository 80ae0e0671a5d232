"""The tie of positions to deformation gradients (M16): a penalty on what no corrected gradient sees."""

import functools
import math
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..execution import Launcher
from ..fields import neighbour_structure, structure
from ..simd import BY_TWO, packed_rows, prelude
from ..space import Space, difference
from .flux import Flux
from .reference import Configuration


@dataclass(frozen=True)
class Tie:
    """Pair energy ¼ Σ_a Σ_b χ Ē V_a w_ab |r_ab|², r_ab = ξ_ab − ½(F_a + F_b) ξ⁰_ab, its adjoint in the stress (M16).

    Positions may run away from F in modes that a gradient averages out (hourglass modes), and irregular arrangements
    push particles about in them. r vanishes for linear fields, and for quadratic ones as far as F is exact there.
    Both momenta and energy are exact; what is stored in the tie comes back (``energy()["tied"]``).

    It acts where the arrangement does not move, whose initial positions are the labels ξ⁰.

    Args:
        stiffness: χ, over Ē, the modulus of pressure waves M or 4μ, whichever is less: M where Poisson's ratio is ⅓.
            Beyond that volume would resist what the tie is to hold, and coarse bodies lock. At 1 it raises the highest
            frequency of a body, and so the cost of a run, by less than a tenth (``tests/test_tie.py``); stiffer ties
            make coarse bodies stiffer, and their F worse near edges (docs/method.md, §7).
    """

    stiffness: float = 0.5

    def __post_init__(self) -> None:
        if not (math.isfinite(self.stiffness) and 0.0 < self.stiffness <= 1.0):
            raise ValueError(
                f"tie stiffness must be in (0, 1], got {self.stiffness}; 0.5 is the tested value, tie=None has none"
            )

    def build(self, space: Space, flux: Flux, moving: list[bool], device: Any) -> "TiedPairs | None":
        """Allocate for the bodies of ``flux`` that do not move; None where all do."""
        return None if all(moving) else TiedPairs(self, space, flux, moving, device)


@functools.cache
def _make_pack(space: Space) -> Any:
    """Kernel: rows of four of displacement and of the columns of −½(F − I), side by side."""
    real, vec, mat, dim = space.real, space.vec, space.mat, space.dim
    Reference = structure(space, "Reference")

    @wp.kernel(module="unique", enable_backward=False)
    def pack(
        first: int,
        reference: Reference,
        x: wp.array(dtype=vec),
        F: wp.array(dtype=mat),
        rows: wp.array2d(dtype=real),
    ):
        a = first + wp.tid()
        u, H = x[a] - reference.x[a], F[a] - wp.identity(n=wp.static(dim), dtype=real)
        for i in range(wp.static(dim)):
            rows[a, i] = u[i]
            for j in range(wp.static(dim)):
                rows[a, 4 + 4 * j + i] = H[i, j] * real(-0.5)

    return pack


@functools.cache
def _tied_sums(space: Space, simd: bool) -> Any:
    """``wp.func`` (a, near, X, rows) -> (Σ_b w_ab r_ab, Σ_b w_ab r_ab ⊗ ξ⁰_ab), r from displacements (M16)."""
    real, vec, mat, dim = space.real, space.vec, space.mat, space.dim
    Neighbours, separation = neighbour_structure(space), difference(space)
    if not simd:

        @wp.func
        def tied_sums(a: int, near: Neighbours, X: wp.array(dtype=vec), rows: wp.array2d(dtype=real)):
            X_a = X[a]
            force = vec()
            couple = mat()
            for k in range(near.start[a], near.start[a + 1]):
                b = near.index[k]
                xi = separation(X[b], X_a, near.box)
                r = vec()
                for i in range(wp.static(dim)):
                    r[i] = rows[b, i] - rows[a, i]
                    for j in range(wp.static(dim)):
                        r[i] = r[i] + (rows[a, 4 + 4 * j + i] + rows[b, 4 + 4 * j + i]) * xi[j]
                r = r * near.w[k]
                force += r
                couple += wp.outer(r, xi)
            return force, couple

        return tied_sums

    both_sums = wp.types.matrix(shape=(dim + 1, dim), dtype=real)
    snippet = f"""
    {prelude(space)}
    const Q* const all = (const Q*)rows.data;
    auto row = [&](int b, int m) __attribute__((always_inline)) {{ return all[(size_t)b * (1 + dim) + m]; }};
    const Q X_one = load(X.data[a].c);
    const V X_a = both(X_one, X_one), u_a = both(row(a, 0), row(a, 0));
    V H_a[dim], sums[dim], force = 0;
    #pragma unroll
    for (int j = 0; j < dim; ++j) {{
        H_a[j] = both(row(a, 1 + j), row(a, 1 + j));
        sums[j] = 0;
    }}
    auto two = [&](int b, int c, V w, int) __attribute__((always_inline)) {{
        const V xi = nearest(both(load(X.data[b].c), load(X.data[c].c)) - X_a);
        V r = both(row(b, 0), row(c, 0)) - u_a;
        #pragma unroll
        for (int j = 0; j < dim; ++j) r += (H_a[j] + both(row(b, 1 + j), row(c, 1 + j))) * spread(xi, j);
        r *= w;
        force += r;
        #pragma unroll
        for (int i = 0; i < dim; ++i) sums[i] += spread(r, i) * xi;
    }};
    {BY_TWO}
    wp::mat_t<dim + 1, dim, T> out;
    const Q f = fold(force);
    #pragma unroll
    for (int j = 0; j < dim; ++j) out.data[dim][j] = f[j];
    #pragma unroll
    for (int i = 0; i < dim; ++i) {{
        const Q q = fold(sums[i]);
        #pragma unroll
        for (int j = 0; j < dim; ++j) out.data[i][j] = q[j];
    }}
    return out;
    """

    @wp.func_native(snippet)
    def tied_row(
        a: int,
        begin: int,
        end: int,
        index: wp.array(dtype=int),
        w: wp.array(dtype=real),
        box: vec,
        X: wp.array(dtype=vec),
        rows: wp.array2d(dtype=real),
    ) -> both_sums: ...

    @wp.func
    def tied_sums_simd(a: int, near: Neighbours, X: wp.array(dtype=vec), rows: wp.array2d(dtype=real)):
        out = tied_row(a, near.start[a], near.start[a + 1], near.index, near.w, near.box, X, rows)
        couple = mat()
        for i in range(wp.static(dim)):
            couple[i] = out[i]
        return out[wp.static(dim)], couple

    return tied_sums_simd


@functools.cache
def _make_tie(space: Space, simd: bool, dual: bool) -> Any:
    """Kernel: force of the tie, and its stress −½ χ Ē Σ_b w_ab r_ab ⊗ ξ⁰_ab, added to Q (M16)."""
    real, Reference, Neighbours = space.real, structure(space, "Reference"), neighbour_structure(space)
    Flux, Forces = structure(space, "Flux"), structure(space, "Forces")
    sums_of = _tied_sums(space, simd)

    @wp.kernel(module="unique", enable_backward=False)
    def tie(
        first: int,
        reference: Reference,
        near: Neighbours,
        rows: wp.array2d(dtype=real),
        modulus: real,
        flux: Flux,
        forces: Forces,
    ):
        a = first + wp.tid()
        force, couple = sums_of(a, near, reference.x, rows)
        forces.tie[a] = force * (modulus * reference.V[a])
        flux.tie[a] = couple * (real(-0.5) * modulus)
        flux.Q[a] = flux.Q[a] + flux.tie[a]
        if wp.static(dual):
            flux.Pi[a] = flux.Q[a] @ wp.transpose(reference.L[a])

    return tie


class TiedPairs:
    """M16 at work on the bodies that do not move."""

    def __init__(self, option: Tie, space: Space, flux: Flux, moving: list[bool], device: Any):
        self.space, self.flux, self._launch = space, flux, Launcher(device)
        n = len(flux.fields.Q)
        self._tied = [
            (body, option.stiffness * (min(M, 4.0 * mu) if space.dim > 1 else M))
            for body, (M, mu), moves in zip(flux.bodies, flux.moduli(), moving, strict=True)
            if not moves
        ]
        self._rows = packed_rows(space, n, 1 + space.dim, device)
        flux.fields.tie = wp.zeros(n, dtype=space.mat, device=device)

    def compute(self, configuration: Configuration, state: Any, forces: Any) -> None:
        """The tie's force [N] at x and F of ``state``, and its stress, which is added to Q."""
        reference, near, flux = configuration.fields, configuration.near, self.flux.fields
        kernel = _make_tie(self.space, configuration.simd, len(flux.Pi) > 0)
        for body, _ in self._tied:
            self._launch(_make_pack(self.space), len(body), [reference, state.x, state.F, self._rows], body.start)
        for body, modulus in self._tied:
            self._launch(kernel, len(body), [reference, near, self._rows, modulus, flux, forces], body.start)
