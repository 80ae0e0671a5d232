"""The interpolation N spanned by corrected values, and its transpose (docs/method.md §5): N_b(x_a) = V_b W̃_b(x_a)."""

import functools

import warp as wp

from ..execution import Launcher
from ..fields import neighbour_structure, structure
from ..space import Space, difference
from ..structs import NeighbourRows, ParticleArrays, ReferenceArrays
from ..weights import Weight
from ..weights.base import value
from .average import make_average
from .values import Values, corrected_value, make_value_correction


@functools.cache
def make_interpolate(weight: Weight, space: Space, components: int, transpose: bool) -> wp.Kernel:
    """Kernel: (N f)_a = Σ_b N_b(x_a) f_b, or with ``transpose`` (Nᵀ f)_a = Σ_c N_a(x_c) f_c, a itself included."""
    real, vec, row = space.real, space.vec, space.row(components)
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    separation, W_of, corrected = difference(space), value(weight, space), corrected_value(space)

    @wp.kernel(module="unique", enable_backward=False)
    def interpolate(
        first: int,
        reference: Reference,
        near: Neighbours,
        alpha: wp.array(dtype=real),
        beta: wp.array(dtype=vec),
        f: wp.array(dtype=row),
        out: wp.array(dtype=row),
    ):
        a = first + wp.tid()
        x_a, h_a, V_a = reference.x[a], reference.h[a], reference.V[a]
        alpha_a, beta_a = alpha[a], beta[a]
        total = f[a] * (V_a * alpha_a * W_of(real(0.0), h_a))
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            offset = separation(x_a, reference.x[b], near.box)
            W = W_of(wp.length(offset), real(0.5) * (h_a + reference.h[b]))
            if wp.static(transpose):
                total += f[b] * (V_a * corrected(alpha[b], beta[b], -offset, W))
            else:
                total += f[b] * (reference.V[b] * corrected(alpha_a, beta_a, offset, W))
        out[a] = total

    return interpolate


@functools.cache
def make_mass_diagonals(weight: Weight, space: Space) -> wp.Kernel:
    """Kernel: M^L_aa = Σ_c m_c N_a(x_c), lumped, and M^C_aa = Σ_c m_c N_a(x_c)², the diagonal of Nᵀ diag(m) N [kg]."""
    real, vec = space.real, space.vec
    Particles, Reference, Neighbours = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        neighbour_structure(space),
    )
    separation, W_of, corrected = difference(space), value(weight, space), corrected_value(space)

    @wp.kernel(module="unique", enable_backward=False)
    def mass_diagonals(
        first: int,
        particles: Particles,
        reference: Reference,
        near: Neighbours,
        alpha: wp.array(dtype=real),
        beta: wp.array(dtype=vec),
        lumped: wp.array(dtype=real),
        consistent: wp.array(dtype=real),
    ):
        a = first + wp.tid()
        x_a, h_a, V_a = reference.x[a], reference.h[a], reference.V[a]
        N = V_a * alpha[a] * W_of(real(0.0), h_a)
        lumped_a = particles.mass[a] * N
        consistent_a = lumped_a * N
        for k in range(near.start[a], near.stop[a], near.stride):
            c = near.index[k]
            offset = separation(reference.x[c], x_a, near.box)
            W = W_of(wp.length(offset), real(0.5) * (h_a + reference.h[c]))
            N = V_a * corrected(alpha[c], beta[c], offset, W)
            lumped_a += particles.mass[c] * N
            consistent_a += particles.mass[c] * N * N
        lumped[a] = lumped_a
        consistent[a] = consistent_a

    return mass_diagonals


class Interpolation:
    """N and Nᵀ on one reference; call ``refresh`` when the reference has changed.

    Args:
        values: Shepard() or Linear().
        space: dimension, precision, periodicity.
        weight: SPH weight of the neighbour lists.
        particles, reference, near: structs ``Particles``, ``Reference``, ``Neighbours``.
        device: Warp device.

    Attributes:
        alpha, beta: (n,) of real [-] and of vec [1/m], the corrections.
    """

    def __init__(
        self,
        values: Values,
        space: Space,
        weight: Weight,
        particles: ParticleArrays,
        reference: ReferenceArrays,
        near: NeighbourRows,
        device: wp.DeviceLike,
    ):
        n, self._launch = len(particles.mass), Launcher(device)
        self.values, self.space, self.weight, self.device = values, space, weight, device
        self.alpha = wp.zeros(n, dtype=space.real, device=device)
        self.beta = wp.zeros(n, dtype=space.vec, device=device)
        self.particles, self._arguments = particles, [reference, near, self.alpha, self.beta]

    def refresh(self) -> None:
        """Corrections of the present reference."""
        kernel = make_value_correction(self.weight, self.space, self.values.linear)
        self._launch(kernel, len(self.alpha), self._arguments)

    def apply(self, f: wp.array, out: wp.array) -> None:
        """``out`` ← N f for rows ``f`` (n,) of c reals."""
        kernel = make_interpolate(self.weight, self.space, wp.types.type_size(f.dtype), transpose=False)
        self._launch(kernel, len(f), [*self._arguments, f, out])

    def transpose(self, f: wp.array, out: wp.array) -> None:
        """``out`` ← Nᵀ f for rows ``f`` (n,) of c reals."""
        kernel = make_interpolate(self.weight, self.space, wp.types.type_size(f.dtype), transpose=True)
        self._launch(kernel, len(f), [*self._arguments, f, out])

    def average(self, f: wp.array, out: wp.array) -> None:
        """``out`` ← S(f) of M6 for rows ``f`` (n,) of c reals."""
        kernel = make_average(self.weight, self.space, wp.types.type_size(f.dtype))
        self._launch(kernel, len(f), [*self._arguments, f, out])

    def mass_diagonals(self, lumped: wp.array, consistent: wp.array) -> None:
        """M^L_aa and M^C_aa [kg] of the mass matrices lumped and consistent with N, (n,) each."""
        kernel = make_mass_diagonals(self.weight, self.space)
        self._launch(kernel, len(lumped), [self.particles, *self._arguments, lumped, consistent])
