"""Compact second derivative (Brookshaw 1985): it sees the saw-tooth that a gradient taken twice annihilates."""

import functools

import warp as wp

from ..fields import neighbour_structure, structure
from ..space import Space, difference


@functools.cache
def make_second_derivative(space: Space, components: int) -> wp.Kernel:
    """Kernel: ∇²f_a = 2 Σ_b V_b g_ab (f_b − f_a − ∇f_a·ξ) / (tr K_a / d), for rows f of ``components`` reals.

    K_a is that of M3. Zero for linear fields, at boundaries too; all pairs count with the same sign, so that no
    oscillation cancels. On three particles in 1-D it is (f₊ + f₋ − 2f)/dx²; where K = K I it is the Laplacian of
    every quadratic field.
    """
    real, row, row_gradient = space.real, space.row(components), space.row_gradient(components)
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    separation, d = difference(space), float(space.dim)

    @wp.kernel(module="unique", enable_backward=False)
    def second_derivative(
        first: int,
        reference: Reference,
        near: Neighbours,
        f: wp.array(dtype=row),
        gradient: wp.array(dtype=row_gradient),
        out: wp.array(dtype=row),
    ):
        a = first + wp.tid()
        x_a = reference.x[a]
        f_a = f[a]
        gradient_a = gradient[a]
        sums = row()
        trace = real(0.0)
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            xi = separation(reference.x[b], x_a, near.box)
            sums += (f[b] - f_a - gradient_a @ xi) * near.w[k]
            trace += near.w[k] * wp.dot(xi, xi)
        curvature = row()
        if trace > real(0.0):
            curvature = sums * (real(2.0) * real(d) / trace)
        out[a] = curvature

    return second_derivative
