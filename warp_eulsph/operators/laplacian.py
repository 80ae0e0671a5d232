"""Graph Laplacian of the neighbour list, and conjugate gradients on it."""

import functools

import numpy as np
import warp as wp

from ..execution import Launcher
from ..fields import neighbour_structure, structure
from ..reduce import Sum
from ..space import Space
from ..structs import NeighbourRows, ReferenceArrays


@functools.cache
def _make_apply(space: Space) -> wp.Kernel:
    real, vec = space.real, space.vec
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def apply_laplacian(
        first: int,
        reference: Reference,
        near: Neighbours,
        f: wp.array(dtype=vec),
        out: wp.array(dtype=vec),
        diagonal: wp.array(dtype=real),
        product: wp.array(dtype=vec),
    ):
        a = first + wp.tid()
        f_a = f[a]
        total = vec()
        weights = real(0.0)
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            omega = near.w[k]
            weights += omega
            total += (f_a - f[b]) * omega
        out[a] = total * reference.V[a]
        diagonal[a] = weights * reference.V[a]
        product[a] = wp.cw_mul(f_a, out[a])

    return apply_laplacian


@functools.cache
def safe_ratio(space: Space) -> wp.Function:
    """``wp.func`` component-wise n/d, zero where d is zero: a converged direction stops moving."""
    real, vec, dim = space.real, space.vec, space.dim

    @wp.func
    def safe_ratio(numerator: vec, denominator: vec) -> vec:
        ratio = vec()
        for i in range(wp.static(dim)):
            if denominator[i] != real(0.0):
                ratio[i] = numerator[i] / denominator[i]
        return ratio

    return safe_ratio


@functools.cache
def _make_advance(space: Space, start: bool) -> wp.Kernel:
    """Kernel: x and residual along the search direction (or the first residual), preconditioned residual.

    At the start ``Ap`` becomes what round-off is measured against: the right-hand side, r∘r/diagonal, which a warm
    start does not shrink, and the terms of the sums it came from, diagonal · h each, which it may be the rest of.
    """
    real, vec, dim = space.real, space.vec, space.dim
    roundoff = float(np.finfo(space.numpy).eps) ** 2
    ratio = safe_ratio(space)

    @wp.kernel(module="unique", enable_backward=False)
    def advance(
        first: int,
        scale: wp.array(dtype=vec),
        rz: wp.array(dtype=vec),
        pAp: wp.array(dtype=vec),
        h: wp.array(dtype=real),
        diagonal: wp.array(dtype=real),
        Ap: wp.array(dtype=vec),
        p: wp.array(dtype=vec),
        x: wp.array(dtype=vec),
        r: wp.array(dtype=vec),
        z: wp.array(dtype=vec),
        product: wp.array(dtype=vec),
    ):
        a = first + wp.tid()
        if wp.static(start):
            rhs = r[a]
            r[a] = r[a] - Ap[a]
            Ap[a] = vec()
            if diagonal[a] > real(0.0):
                terms = vec(diagonal[a] * h[a])
                Ap[a] = (wp.cw_mul(rhs, rhs) + wp.cw_mul(terms, terms)) / diagonal[a]
        else:
            alpha = ratio(rz[0], pAp[0])
            for i in range(wp.static(dim)):
                # Below round-off the directions decay to the constants, on which the Laplacian is singular.
                if rz[0][i] <= real(roundoff) * scale[0][i]:
                    alpha[i] = real(0.0)
            x[a] = x[a] + wp.cw_mul(alpha, p[a])
            r[a] = r[a] - wp.cw_mul(alpha, Ap[a])
        z_a = vec()
        if diagonal[a] > real(0.0):
            z_a = r[a] / diagonal[a]
        z[a] = z_a
        product[a] = wp.cw_mul(r[a], z_a)
        if wp.static(start):
            p[a] = z_a

    return advance


@functools.cache
def _make_turn(space: Space) -> wp.Kernel:
    """Kernel: the next search direction."""
    vec = space.vec
    ratio = safe_ratio(space)

    @wp.kernel(module="unique", enable_backward=False)
    def turn(
        first: int, rz: wp.array(dtype=vec), rz_old: wp.array(dtype=vec), z: wp.array(dtype=vec), p: wp.array(dtype=vec)
    ):
        a = first + wp.tid()
        p[a] = z[a] + wp.cw_mul(ratio(rz[0], rz_old[0]), p[a])

    return turn


class LaplacianSolver:
    """Σ_b ω_ab (ψ_a − ψ_b) = d_a with ω_ab = V_a V_b g_ab, one right-hand side per direction (M11).

    Preconditioned conjugate gradients with a fixed number of iterations and no host reads; ``psi`` keeps the last
    solution as the next first guess.
    """

    def __init__(self, space: Space, n: int, device: wp.DeviceLike):
        self.space, self.device, self._launch = space, device, Launcher(device)
        vector = functools.partial(wp.zeros, dtype=space.vec, device=device)
        self.psi, self.residual = vector(n), vector(n)
        self._p, self._Ap, self._z, self._product = vector(n), vector(n), vector(n), vector(n)
        self._diagonal = wp.zeros(n, dtype=space.real, device=device)
        self._scale, self._rz, self._rz_old, self._pAp = vector(1), vector(1), vector(1), vector(1)
        self._sum = Sum(space.vec, n, device)

    def solve(self, reference: ReferenceArrays, near: NeighbourRows, body: range, iterations: int) -> None:
        """Improve ``psi`` of one body's particles for the right-hand side in ``residual``, which becomes the residual.

        Bodies are solved one by one: step lengths shared between them would let one feel the other.
        """
        own = slice(body.start, body.stop)
        self._apply(reference, near, body, self.psi)
        self._advance(reference, body, start=True)
        self._sum(self._Ap[own], self._scale)
        self._sum(self._product[own], self._rz)
        for _ in range(iterations):
            self._apply(reference, near, body, self._p)
            self._sum(self._product[own], self._pAp)
            self._advance(reference, body, start=False)
            self._rz, self._rz_old = self._rz_old, self._rz
            self._sum(self._product[own], self._rz)
            turn = [self._rz, self._rz_old, self._z, self._p]
            self._launch(_make_turn(self.space), len(body), turn, body.start)

    def _apply(self, reference: ReferenceArrays, near: NeighbourRows, body: range, f: wp.array) -> None:
        arguments = [reference, near, f, self._Ap, self._diagonal, self._product]
        self._launch(_make_apply(self.space), len(body), arguments, body.start)

    def _advance(self, reference: ReferenceArrays, body: range, start: bool) -> None:
        scalars = [self._scale, self._rz, self._pAp]
        vectors = [self._Ap, self._p, self.psi, self.residual, self._z, self._product]
        arguments = [*scalars, reference.h, self._diagonal, *vectors]
        self._launch(_make_advance(self.space, start), len(body), arguments, body.start)
