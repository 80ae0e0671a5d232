"""Smoothing that reproduces linear fields everywhere and keeps mass-weighted sums (M7)."""

import functools

import warp as wp

from ..fields import neighbour_structure, structure
from ..space import Space, difference


@functools.cache
def make_linear_exact(space: Space, components: int) -> wp.Kernel:
    """Kernel: S_a(f) = f_a + θ Σ_b ω_ab [f_b − f_a − ½(∇f_a + ∇f_b) ξ], ω_ab = m_b g_ab / max(row_a, row_b) (M7).

    m_a ω_ab is symmetric, hence Σ m_a S_a(f) = Σ m_a f_a to round-off.
    """
    real, row, row_gradient = space.real, space.row(components), space.row_gradient(components)
    Particles, Reference, Neighbours = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        neighbour_structure(space),
    )
    separation = difference(space)

    @wp.kernel(module="unique", enable_backward=False)
    def linear_exact(
        first: int,
        particles: Particles,
        reference: Reference,
        near: Neighbours,
        theta: real,
        f: wp.array(dtype=row),
        gradient: wp.array(dtype=row_gradient),
        out: wp.array(dtype=row),
    ):
        a = first + wp.tid()
        x_a = reference.x[a]
        f_a = f[a]
        gradient_a = gradient[a]
        row_a = reference.row[a]
        change = row()
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            xi = separation(reference.x[b], x_a, near.box)
            omega = particles.mass[b] / reference.V[b] * near.w[k] / wp.max(row_a, reference.row[b])
            change += (f[b] - f_a - (gradient_a + gradient[b]) @ (xi * real(0.5))) * omega
        out[a] = f_a + change * theta

    return linear_exact
