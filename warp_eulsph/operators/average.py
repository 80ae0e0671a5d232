"""The paper's smoothing (§4.2): the corrected average over the neighbours, the particle itself left out (M6)."""

import functools

import warp as wp

from ..fields import neighbour_structure, structure
from ..space import Space, difference
from ..weights import Weight
from ..weights.base import value
from .correction import CUTOFF
from .values import corrected_value


@functools.cache
def make_average(weight: Weight, space: Space, components: int) -> wp.Kernel:
    """Kernel: S_a(f) = Σ_{b≠a} N_b(x_a) f_b / (1 − N_a(x_a)) with the corrections α, β of N (M6).

    The denominator is the share of the neighbours. It vanishes for linear values when all neighbours lie on one side
    (1-D): below ``CUTOFF`` the particle keeps its own value.
    """
    real, vec, row = space.real, space.vec, space.row(components)
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    separation, W_of, corrected = difference(space), value(weight, space), corrected_value(space)

    @wp.kernel(module="unique", enable_backward=False)
    def average(
        first: int,
        reference: Reference,
        near: Neighbours,
        alpha: wp.array(dtype=real),
        beta: wp.array(dtype=vec),
        f: wp.array(dtype=row),
        out: wp.array(dtype=row),
    ):
        a = first + wp.tid()
        x_a, h_a = reference.x[a], reference.h[a]
        alpha_a, beta_a = alpha[a], beta[a]
        total = row()
        share = real(0.0)
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            offset = separation(x_a, reference.x[b], near.box)
            W = W_of(wp.length(offset), real(0.5) * (h_a + reference.h[b]))
            N_b = reference.V[b] * corrected(alpha_a, beta_a, offset, W)
            total += f[b] * N_b
            share += N_b
        average_a = f[a]
        if share > real(CUTOFF):
            average_a = total / share
        out[a] = average_a

    return average
