"""Outermost particles of a body, and which of them each particle lies beneath."""

import itertools
from dataclasses import dataclass, field

import numpy as np

# Lengths below are in spacings. A particle is outermost unless another one is above it: within BLOCKING of the line
# along the normal, or as one of several that surround the line, as in layers that are staggered.
BLOCKING, LEAST_HEIGHT, HEIGHT = 0.75, 0.5, 2.2
# Least area vector of an outermost particle, over its face, and the part of it that faces a normal. In disordered
# bodies those of inner particles reach 0.4.
LARGE, FACING = 0.5, 0.05
# How far beneath its outermost particle the area vectors of a column reach, and how far beside.
DEPTH, BESIDE = 7.8, 1.2


@dataclass(frozen=True)
class Surface:
    """A body as faces are looked for in it.

    Attributes:
        x: initial positions [m], (n, dim). V: initial volumes [m^dim], (n,).
        spacing: mean particle spacing [m].
        s: initial area vectors [m^(dim−1)], (n, dim).
        outward: the same of weights without tilt (M17), which say where out is.
        exact: the vectors came with the body: they are the true ones, particle by particle.
        found: outermost particles that were looked for, by normal.
    """

    x: np.ndarray
    V: np.ndarray
    spacing: float
    s: np.ndarray
    outward: np.ndarray
    exact: bool
    found: dict[bytes, np.ndarray] = field(default_factory=dict)

    @property
    def size(self) -> np.ndarray:
        """Face of each particle [m^(dim−1)], (n,)."""
        return self.V ** (1.0 - 1.0 / self.x.shape[1])


def along(body: Surface, particles: np.ndarray) -> np.ndarray:
    """Directions of the area vectors of some particles, (k, dim)."""
    s = body.outward[particles]
    return s / np.linalg.norm(s, axis=1, keepdims=True)


def along_and_beside(body: Surface, a: np.ndarray, b: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far b lies from a along ``n``, (k,), and the vector beside that, (k, dim), in spacings."""
    away = (body.x[b] - body.x[a]) / body.spacing
    height = (away * n).sum(axis=1)
    return height, away - height[:, None] * n


def surface_particles(body: Surface) -> np.ndarray:
    """Particles with none above them along their own area vectors, sorted."""
    if b"" not in body.found:
        length = np.linalg.norm(body.outward, axis=1)
        skin = np.flatnonzero(length > (0.0 if body.exact else LARGE) * body.size)
        body.found[b""] = skin if body.exact else skin[~_blocked(body, skin, along(body, skin))]
    return body.found[b""]


def outermost(body: Surface, n: np.ndarray) -> np.ndarray:
    """Particles with none above them along ``n``, sorted."""
    key = n.tobytes()
    if key not in body.found:
        large = np.linalg.norm(body.outward, axis=1) > LARGE * body.size
        facing = body.outward @ n > FACING * body.size
        tops = np.flatnonzero(facing if body.exact else facing & large)
        normals = np.broadcast_to(n, (len(tops), len(n)))
        body.found[key] = tops if body.exact else tops[~_blocked(body, tops, normals)]
    return body.found[key]


def _blocked(body: Surface, candidates: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Whether other particles lie above the candidates along their normals ``n``, (k, dim); (k,) bool."""
    a, b = pairs(body.x[candidates], body.x, HEIGHT * body.spacing)
    height, beside = along_and_beside(body, candidates[a], b, n[a])
    across = np.linalg.norm(beside, axis=1)
    blocked = np.zeros(len(candidates), dtype=bool)
    blocked[a[(height > LEAST_HEIGHT) & (across < BLOCKING)]] = True
    around = (height > LEAST_HEIGHT - 0.1) & (height < 1.6) & (across < 1.5 * height)
    count = np.bincount(a[around], minlength=len(candidates))
    reach = np.bincount(a[around], across[around], minlength=len(candidates))
    each_axis = [np.bincount(a[around], row[around], minlength=len(candidates)) for row in beside.T]
    lopsided = np.linalg.norm(each_axis, axis=0) > 0.35 * reach
    return blocked | ((count > 1) & ~lopsided)


def nearest(body: Surface, tops: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each particle the place in ``tops`` of the nearest one, −1 if none, and its distance [m], (n,), (n,)."""
    which, distance = np.full(len(body.x), -1), np.full(len(body.x), np.inf)
    a, b = pairs(body.x[tops], body.x, DEPTH * body.spacing)
    away = np.linalg.norm(body.x[tops[a]] - body.x[b], axis=1)
    best = np.lexsort((away, b))
    first = best[np.unique(b[best], return_index=True)[1]]
    which[b[first]], distance[b[first]] = a[first], away[first]
    return which, distance


def column(body: Surface, tops: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each particle the place in ``tops`` of the one above it, −1 if none, and how deep it lies [m], (n,), (n,)."""
    above, depth = np.full(len(body.x), -1), np.full(len(body.x), np.inf)
    squash = BESIDE / DEPTH
    flat = body.x + np.outer(body.x @ n, n) * (squash - 1.0)
    a, b = pairs(flat[tops], flat, 1.5 * BESIDE * body.spacing)
    below, beside = along_and_beside(body, b, tops[a], n)
    across = np.linalg.norm(beside, axis=1)
    near = (below > -0.4) & (below < DEPTH) & (across < BESIDE)
    a, b, below, across = a[near], b[near], below[near], across[near]
    # the line above it counts for more than the distance: beside a step the deeper one is its own
    best = np.lexsort((across + 0.25 * np.abs(below), b))
    first = best[np.unique(b[best], return_index=True)[1]]
    above[b[first]], depth[b[first]] = a[first], below[first] * body.spacing
    above[tops], depth[tops] = np.arange(len(tops)), 0.0
    return above, depth


def pairs(x: np.ndarray, y: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Places (i, j) of all pairs with |x_i − y_j| < radius."""
    dim = x.shape[1]
    low = np.minimum(x.min(axis=0, initial=np.inf), y.min(axis=0, initial=np.inf))
    if not (len(x) and len(y)):
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    cell_x, cell_y = (np.floor((p - low) / radius).astype(np.int64) + 1 for p in (x, y))
    sides = np.maximum(cell_x.max(axis=0), cell_y.max(axis=0)) + 2
    strides = np.concatenate([[1], np.cumprod(sides[:-1])])
    code = cell_y @ strides
    order = np.argsort(code, kind="stable")
    code = code[order]
    first, second = [], []
    for offset in itertools.product((-1, 0, 1), repeat=dim):
        wanted = (cell_x + offset) @ strides
        begin, end = np.searchsorted(code, wanted), np.searchsorted(code, wanted, side="right")
        count = end - begin
        i = np.repeat(np.arange(len(x)), count)
        j = order[np.arange(len(i)) - np.repeat(np.cumsum(count) - count - begin, count)]
        near = ((x[i] - y[j]) ** 2).sum(axis=1) < radius**2
        first.append(i[near])
        second.append(j[near])
    return np.concatenate(first), np.concatenate(second)
