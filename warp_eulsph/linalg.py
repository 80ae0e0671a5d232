"""Small dense matrices in 1-D, 2-D and 3-D as ``wp.func`` (Warp has no 1×1 determinant or inverse)."""

import functools

import warp as wp

from .space import Space


@functools.cache
def det(space: Space) -> wp.Function:
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
def inverse(space: Space) -> wp.Function:
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
def reciprocal_cube_root(real: type) -> wp.Function:
    """``wp.func`` x^(−1/3), NaN unless x > 0.

    On the CPU from a guess by the bits of x, 3 % off, twice y ← y (1 − c)^(−1/3), c = 1 − x y³, to third order in c;
    that leaves two thirds of a unit in the last place. A call of ``pow``, in the midst of matrices held in registers,
    took half the time of the kernels of stress and energy.
    """
    word, guess = {wp.float64: ("long long", "0x553ee96246f67eef"), wp.float32: ("int", "0x54a1f5bd")}[real]
    name, root = ("double", "rcbrt") if real is wp.float64 else ("float", "rcbrtf")

    @wp.func_native(f"""
    typedef {name} T;
    #if defined(__CUDA_ARCH__)
    T y = {root}(x);
    #else
    unsigned {word} bits;
    __builtin_memcpy(&bits, &x, sizeof(T));
    bits = {guess} - bits / 3;
    T y;
    __builtin_memcpy(&y, &bits, sizeof(T));
    #pragma unroll
    for (int round = 0; round < 2; ++round) {{
        const T c = 1 - (x * y) * (y * y);
        y += y * c * (T(1.0 / 3.0) + c * (T(2.0 / 9.0) + c * T(14.0 / 81.0)));
    }}
    #endif
    return x > 0 ? y : T(NAN);
    """)
    def reciprocal_cube_root(x: real) -> real: ...

    return reciprocal_cube_root


@functools.cache
def reciprocal_power(real: type) -> wp.Function:
    """``wp.func`` x^(−p), p > 0: by products where p is a whole number up to 16: a third of the time of ``pow``."""

    @wp.func
    def reciprocal_power(x: real, p: real) -> real:
        n = int(p)
        if real(n) != p or n > 16:
            return wp.pow(x, -p)
        square = real(1.0) / x
        out = real(1.0)
        while n > 0:
            if n % 2 == 1:
                out *= square
            square *= square
            n = n // 2
        return out

    return reciprocal_power


@functools.cache
def stretch_of_volume(space: Space) -> wp.Function:
    """``wp.func`` J^(1/d), the stretch that alike in all directions makes the volume ratio J; 0 where J ≤ 0."""
    real, dim, root = space.real, space.dim, reciprocal_cube_root(space.real)

    @wp.func
    def stretch_of_volume(J: real) -> real:
        stretch = real(J)
        if real(0.0) >= J:
            return real(0.0)
        if wp.static(dim == 2):
            stretch = wp.sqrt(stretch)
        if wp.static(dim == 3):
            stretch *= root(J) * root(J)
        return stretch

    return stretch_of_volume


@functools.cache
def cofactor(space: Space) -> wp.Function:
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
def symmetric_bounds(space: Space) -> wp.Function:
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
def spread_of_invariants(space: Space) -> wp.Function:
    """``wp.func`` deviation·√(d−1) of the eigenvalues of A Aᵀ, as in ``symmetric_bounds``, from |A|² and |cof A|²."""
    real = space.real
    if space.dim == 1:

        @wp.func
        def no_spread(A_A: real, C_C: real, J: real) -> real:
            return real(0.0)

        return no_spread

    share, second = (space.dim - 1) / space.dim, 2.0 * space.dim / (space.dim - 1)

    @wp.func
    def spread_of_invariants(A_A: real, C_C: real, J: real) -> real:
        of_pairs = J * J
        if wp.static(space.dim == 3):
            of_pairs = C_C
        return real(share) * wp.sqrt(wp.max(A_A * A_A - real(second) * of_pairs, real(0.0)))

    return spread_of_invariants


@functools.cache
def stretch_bounds(space: Space) -> wp.Function:
    """``wp.func`` bounds (least, largest) of the squared principal stretches of A, the eigenvalues of A Aᵀ.

    Those of ``symmetric_bounds``, from the invariants of the product instead of the product.
    """
    real, mat, pair, share = space.real, space.mat, space.row(2), 1.0 / space.dim
    determinant, cof, spread_of = det(space), cofactor(space), spread_of_invariants(space)

    @wp.func
    def stretch_bounds(A: mat) -> pair:
        C = cof(A)
        mean = wp.ddot(A, A) * real(share)
        spread = spread_of(wp.ddot(A, A), wp.ddot(C, C), determinant(A))
        return pair(mean - spread, mean + spread)

    return stretch_bounds


@functools.cache
def largest_shortening(space: Space) -> wp.Function:
    """``wp.func`` bound of the largest squared principal stretch of A⁻¹, without the inverse.

    Exact of multiples of I, such as those of liquids, whose spread would be the root of round-off.
    """
    real, mat, share, dim = space.real, space.mat, 1.0 / space.dim, space.dim
    determinant, cof, spread_of = det(space), cofactor(space), spread_of_invariants(space)

    @wp.func
    def largest_shortening(A: mat) -> real:
        D = A - wp.identity(n=wp.static(dim), dtype=real) * A[0, 0]
        if wp.ddot(D, D) == real(0.0):
            return real(1.0) / (A[0, 0] * A[0, 0])
        # A⁻¹ = (cof A)ᵀ/J and cof A⁻¹ = Aᵀ/J
        C = cof(A)
        rate = real(1.0) / determinant(A)
        A_A, C_C = wp.ddot(C, C) * rate * rate, wp.ddot(A, A) * rate * rate
        return A_A * real(share) + spread_of(A_A, C_C, rate)

    return largest_shortening


@functools.cache
def symmetric_eigen(space: Space, most: int = 8) -> wp.Function:
    """``wp.func`` (A) -> (eigenvectors as columns, eigenvalues) by cyclic Jacobi rotations, ``most`` sweeps."""
    dim, real, mat, vec = space.dim, space.real, space.mat, space.vec
    sweeps = most if dim > 1 else 0  # Jacobi converges quadratically: 3×3 matrices reach round-off in 4 to 6 sweeps

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
