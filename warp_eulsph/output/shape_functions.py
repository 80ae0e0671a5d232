"""Values of particles at any points: corrected sums over the particles around, exact for linear fields."""

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..execution import launch
from ..space import Space
from ..weights import Weight
from ..weights.base import value

# Neighbours whose moments are worse conditioned hardly span the space: what they extrapolate is noise.
_WORST_CONDITION = 1e8


@dataclass(frozen=True)
class ShapeFunctions:
    """Shares of the particles in the values at points, N_b(p) = V_b W̃_b(p) (docs/method.md §2).

    Attributes:
        inside: which points have enough particles around them, (m,) bool.
        point, particle: numbers of the pairs, in order of the points, (k,) each; of points inside only.
        share: N_b(p) [-], (k,); they sum to 1 at each point.
    """

    inside: np.ndarray
    point: np.ndarray
    particle: np.ndarray
    share: np.ndarray

    def apply(self, values: np.ndarray) -> np.ndarray:
        """A field of the particles, (n, …), at the points: (m, …), not-a-number outside."""
        m, rows = len(self.inside), np.asarray(values, dtype=float).reshape(len(values), -1)
        sums = [np.bincount(self.point, self.share * column[self.particle], minlength=m) for column in rows.T]
        found = np.where(self.inside[:, None], np.stack(sums, axis=1), np.nan)
        return found.reshape(m, *values.shape[1:])


def shape_functions(
    points: np.ndarray,
    x: np.ndarray,
    volume: np.ndarray,
    h: np.ndarray,
    weight: Weight,
    *,
    body: np.ndarray | None = None,
    box: Sequence[float] = (),
) -> ShapeFunctions:
    """Shape functions of particles at points, exact for linear fields.

    A point is inside where a particle is nearer than its smoothing length and the particles within reach span the
    space: values are extrapolated up to a smoothing length beyond the outermost particles, which the surface is within.

    Args:
        points: [m], (m, dim).
        x: positions of the particles [m], (n, dim).
        volume: their volumes [m^dim], (n,).
        h: their smoothing lengths [m], (n,).
        weight: SPH weight.
        body: their bodies, (n,); only the body of the particle that is nearest, in smoothing lengths, counts at a
            point. One body if None.
        box: lengths [m] of a periodic box with a corner at the origin, 0 where it is open; all open if empty.
    """
    points, x, volume, h = (np.asarray(given, dtype=float) for given in (points, x, volume, h))
    points, x, source = _unfolded(points, x, weight.support * h.max(), box)
    volume, h, body = volume[source], h[source], None if body is None else body[source]
    i, b = _pairs(points, x, weight.support * h.max())
    r = np.linalg.norm(x[b] - points[i], axis=1)
    nearest = np.full(len(points), np.inf)
    np.minimum.at(nearest, i, r / h[b])
    kept = r < weight.support * h[b]
    if body is not None:
        closest, of = r / h[b] == nearest[i], np.zeros(len(points), dtype=body.dtype)
        of[i[closest]] = body[b[closest]]
        kept &= body[b] == of[i]
    i, b, r = i[kept], b[kept], r[kept]
    weights = volume[b] * _weights(r, h[b], weight, x.shape[1])
    # Offsets in units of a smoothing length, so that the condition of their moments is a number of its own
    length = np.bincount(i, h[b], minlength=len(points)) / np.bincount(i, minlength=len(points)).clip(1)
    spanned, share = _corrected(i, (x[b] - points[i]) / length[i, None], weights, len(points))
    inside = spanned & (nearest < 1.0)
    kept = inside[i]
    return ShapeFunctions(inside, i[kept], source[b[kept]], share[kept])


def _corrected(i: np.ndarray, offset: np.ndarray, weights: np.ndarray, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Which of ``m`` points have neighbours that span the space, and the corrected share of each pair.

    With moments M = Σ_b w_b p_b p_bᵀ of p_b = (1, x_b − x_i), share b is w_b p_b·M⁻¹ (1, 0): it reproduces the
    constant and the coordinates, so all linear fields.
    """
    basis = np.concatenate([np.ones((len(i), 1)), offset], axis=1)
    size = basis.shape[1]
    moments = np.empty((m, size, size))
    for row, column in itertools.product(range(size), repeat=2):
        moments[:, row, column] = np.bincount(i, weights * basis[:, row] * basis[:, column], minlength=m)
    spanned = np.bincount(i, minlength=m) >= size
    spanned[spanned] = np.linalg.cond(moments[spanned]) < _WORST_CONDITION
    first = np.zeros((m, size))
    first[spanned] = np.linalg.inv(moments[spanned])[:, :, 0]
    return spanned, weights * np.einsum("kr,kr->k", basis, first[i])


def _pairs(points: np.ndarray, x: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of points and particles nearer than ``reach`` [m] to each other, in order: (k,) each."""
    dim, low = x.shape[1], x.min(axis=0)
    cell = np.floor((x - low) / reach).astype(np.int64)
    last = cell.max(axis=0)
    # Points beyond the cells next to those of particles have no neighbours, wherever they are.
    home = np.floor(np.clip((points - low) / reach, -2, last + 2)).astype(np.int64)
    strides = np.cumprod([1, *(last[:-1] + 7)])
    keys = cell @ strides
    order = np.argsort(keys, kind="stable")
    keys, x = keys[order], x[order]
    found = []
    for step in itertools.product((-1, 0, 1), repeat=dim - 1):
        row = (home + np.array([0, *step])) @ strides  # three cells along the first axis follow each other
        first, end = np.searchsorted(keys, row - 1), np.searchsorted(keys, row + 1, side="right")
        count = end - first
        i = np.repeat(np.arange(len(points)), count)
        k = np.arange(count.sum()) + np.repeat(first - (np.cumsum(count) - count), count)
        near = np.square(x[k] - points[i]).sum(axis=1) < reach**2
        found.append((i[near], order[k[near]]))
    i, b = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.lexsort((b, i))
    return i[order], b[order]


def _unfolded(
    points: np.ndarray, x: np.ndarray, reach: float, box: Sequence[float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, and particles with their periodic images within ``reach`` [m] of the box; whose images they are."""
    points, x, source = points.copy(), x.copy(), np.arange(len(x))
    for axis, length in enumerate(box):
        if length > 0.0:
            points[:, axis] %= length
            x[:, axis] %= length
            for beyond, shift in ((x[:, axis] < reach, length), (x[:, axis] > length - reach, -length)):
                image = x[: len(beyond)][beyond]
                image[:, axis] += shift
                x, source = np.concatenate([x, image]), np.concatenate([source, source[: len(beyond)][beyond]])
    return points, x, source


@functools.cache
def _make_weigh(weight: Weight, space: Space) -> wp.Kernel:
    """Kernel: W(r, h) of each distance."""
    real, W_of = space.real, value(weight, space)

    @wp.kernel(module="unique", enable_backward=False)
    def weigh(first: int, r: wp.array(dtype=real), h: wp.array(dtype=real), out: wp.array(dtype=real)):
        i = first + wp.tid()
        out[i] = W_of(r[i], h[i])

    return weigh


def _weights(r: np.ndarray, h: np.ndarray, weight: Weight, dim: int) -> np.ndarray:
    """W(r, h) [1/m^dim] of distances and smoothing lengths [m], (k,) each, on the CPU in double precision."""
    given = [wp.array(values, dtype=wp.float64, device="cpu") for values in (r, h)]
    out = wp.zeros(len(r), dtype=wp.float64, device="cpu")
    launch(_make_weigh(weight, Space(dim, wp.float64)), len(r), [*given, out], "cpu")
    return out.numpy()
