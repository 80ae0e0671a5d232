"""Small dense matrices in 1-D, 2-D and 3-D as ``wp.func`` (Warp has no 1×1 determinant or inverse)."""

import functools
from typing import Any

import warp as wp

from .space import Space


@functools.cache
def det(space: Space) -> Any:
    """``wp.func`` det(A)."""
    real, mat = space.real, space.mat

    if space.dim == 1:

        @wp.func
        def det1(A: mat) -> real:
            return A[0, 0]

        return det1

    @wp.func
    def det(A: mat) -> real:
        return wp.determinant(A)

    return det


@functools.cache
def inverse(space: Space) -> Any:
    """``wp.func`` A⁻¹."""
    real, mat = space.real, space.mat

    if space.dim == 1:

        @wp.func
        def inverse1(A: mat) -> mat:
            return mat(real(1.0) / A[0, 0])

        return inverse1

    @wp.func
    def inverse(A: mat) -> mat:
        return wp.inverse(A)

    return inverse


@functools.cache
def cofactor(space: Space) -> Any:
    """``wp.func`` cof(A) = det(A) A⁻ᵀ, defined for singular A too; maps area vectors (Nanson)."""
    real, mat = space.real, space.mat

    if space.dim == 1:

        @wp.func
        def cofactor1(A: mat) -> mat:
            return mat(real(1.0))

        return cofactor1

    if space.dim == 2:

        @wp.func
        def cofactor2(A: mat) -> mat:
            return mat(A[1, 1], -A[1, 0], -A[0, 1], A[0, 0])

        return cofactor2

    vec = space.vec

    @wp.func
    def cofactor3(A: mat) -> mat:
        a = vec(A[0, 0], A[0, 1], A[0, 2])
        b = vec(A[1, 0], A[1, 1], A[1, 2])
        c = vec(A[2, 0], A[2, 1], A[2, 2])
        return wp.matrix_from_rows(wp.cross(b, c), wp.cross(c, a), wp.cross(a, b))

    return cofactor3


@functools.cache
def symmetric_bounds(space: Space) -> Any:
    """``wp.func`` bounds (least, largest) of the eigenvalues of a symmetric matrix.

    Wolkowicz & Styan (1980): mean ∓ deviation·√(d−1); exact in 1-D and 2-D, and for equal eigenvalues.
    """
    real, mat, pair = space.real, space.mat, space.row(2)
    d, others = float(space.dim), float(space.dim - 1)

    @wp.func
    def symmetric_bounds(A: mat) -> pair:
        mean = wp.trace(A) / real(d)
        variance = wp.max(wp.ddot(A, A) / real(d) - mean * mean, real(0.0))
        spread = wp.sqrt(variance * real(others))
        return pair(mean - spread, mean + spread)

    return symmetric_bounds


@functools.cache
def symmetric_eigen(space: Space) -> Any:
    """``wp.func`` (A) -> (eigenvectors as columns, eigenvalues) by cyclic Jacobi rotations."""
    dim, real, mat, vec = space.dim, space.real, space.mat, space.vec
    sweeps = 8 if dim > 1 else 0  # Jacobi converges quadratically: 3×3 matrices reach round-off in 4 to 6 sweeps

    @wp.func
    def symmetric_eigen(A: mat):
        D = A
        R = wp.identity(n=wp.static(dim), dtype=real)
        rounds = int(sweeps)  # not unrolled, which takes a second to compile
        for _ in range(rounds):
            for p in range(wp.static(dim - 1)):
                for q in range(p + 1, wp.static(dim)):
                    if D[p, q] != real(0.0):
                        tau = (D[q, q] - D[p, p]) / (real(2.0) * D[p, q])
                        t = real(1.0) / (wp.abs(tau) + wp.sqrt(real(1.0) + tau * tau))
                        if tau < real(0.0):
                            t = -t
                        c = real(1.0) / wp.sqrt(real(1.0) + t * t)
                        rotation = wp.identity(n=wp.static(dim), dtype=real)
                        rotation[p, p] = c
                        rotation[q, q] = c
                        rotation[p, q] = t * c
                        rotation[q, p] = -t * c
                        D = wp.transpose(rotation) @ D @ rotation
                        R = R @ rotation
        values = vec()
        for i in range(wp.static(dim)):
            values[i] = D[i, i]
        return R, values

    return symmetric_eigen
