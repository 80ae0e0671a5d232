"""Which outermost particles of other bodies are near each: rows found anew only when something moved far enough."""

import functools

import numpy as np
import warp as wp

from ..atomics import raise_to
from ..execution import Launcher
from ..operators.neighbours import QUERY_MARGIN
from ..space import Space
from .faces import REACH
from .law import rows_structure
from .skin import Skin

# How far beyond the range of forces rows reach, in spacings: a search lasts until a particle has moved half of that.
MARGIN = 1.0
# Range of forces, in spacings of the coarser body: across by the weight of the surface, along by the sum of two halves.
RANGE = float(np.hypot(2.0 * REACH, 1.0))


@functools.cache
def _make_moved(space: Space) -> wp.Kernel:
    """Kernel: the largest distance from where particles were, in their spacings."""
    real, vec = space.real, space.vec
    raise_largest = raise_to(real)

    @wp.kernel(module="unique", enable_backward=False)
    def find_moved(
        first: int,
        places: wp.array(dtype=wp.int32),
        x: wp.array(dtype=vec),
        half: wp.array(dtype=real),
        at: wp.array(dtype=vec),
        largest: wp.array(dtype=real),
    ):
        k = first + wp.tid()
        raise_largest(largest, wp.length(x[places[k]] - at[k]) / (real(2.0) * half[k]))

    return find_moved


@functools.cache
def _make_note(space: Space) -> wp.Kernel:
    """Kernel: where particles are, once more as 3-vectors for the grid."""
    real, vec, dim = space.real, space.vec, space.dim
    vec3 = wp.types.vector(length=3, dtype=real)

    @wp.kernel(module="unique", enable_backward=False)
    def note(
        first: int,
        places: wp.array(dtype=wp.int32),
        x: wp.array(dtype=vec),
        at: wp.array(dtype=vec),
        padded: wp.array(dtype=vec3),
    ):
        k = first + wp.tid()
        p = x[places[k]]
        at[k] = p
        q = vec3()
        for i in range(wp.static(dim)):
            q[i] = p[i]
        padded[k] = q

    return note


@functools.cache
def _make_search(space: Space, fill: bool) -> wp.Kernel:
    """Kernel: count a row, or (``fill``) write it sorted by index."""
    real = space.real
    vec3 = wp.types.vector(length=3, dtype=real)

    @wp.kernel(module="unique", enable_backward=False)
    def search(
        first: int,
        grid: wp.uint64,
        padded: wp.array(dtype=vec3),
        there: wp.array(dtype=wp.int32),
        bodies: wp.array(dtype=wp.int32),
        felt: wp.array2d(dtype=wp.int32),
        half: wp.array(dtype=real),
        longest: real,
        count: wp.array(dtype=wp.int32),
        start: wp.array(dtype=wp.int32),
        index: wp.array(dtype=wp.int32),
    ):
        k = first + wp.tid()
        n = int(0)
        row = int(0)
        if wp.static(fill):
            row = start[k]
        if there[k] == 1:
            reach = real(wp.static(RANGE + MARGIN))
            for m in wp.hash_grid_query(grid, padded[k], reach * longest * real(QUERY_MARGIN)):
                if there[m] == 1 and felt[bodies[k], bodies[m]] == 1:
                    spacing = real(2.0) * wp.max(half[k], half[m])
                    if wp.length(padded[m] - padded[k]) < reach * spacing:
                        if wp.static(fill):
                            i = row + n
                            while i > row and index[i - 1] > m:
                                index[i] = index[i - 1]
                                i = i - 1
                            index[i] = m
                        n = n + 1
        if wp.static(not fill):
            count[k] = n

    return search


class Nearby:
    """For each particle of a skin those of other bodies that forces may reach, in sorted rows.

    Rows hold more than is in range, and what is not adds nothing, so that forces do not depend on when they were found.

    Args:
        skin: its particles are numbered 0, 1, ….
        felt: whether two bodies feel each other, (bodies, bodies) of 0 and 1, symmetric.

    Attributes:
        rows: struct of ``start`` and ``index``, int32: row k is ``index[start[k]:start[k+1]]``.
        pairs: entries in the rows; where there are none nothing is near. searches: so far.
    """

    def __init__(self, skin: Skin, felt: np.ndarray):
        self.skin, self.space = skin, skin.space
        self.device = device = skin.places.device
        self._launch, space, k = Launcher(device), skin.space, len(skin.indices)
        self._felt = wp.array(felt, dtype=wp.int32, device=device)
        self.at = wp.zeros(k, dtype=space.vec, device=device)
        self._padded = wp.zeros(k, dtype=wp.types.vector(length=3, dtype=space.real), device=device)
        self._count = wp.zeros(k + 1, dtype=wp.int32, device=device)
        self.rows = rows_structure()()
        self.rows.start, self.rows.index = wp.zeros(k + 1, dtype=wp.int32, device=device), self._room(0)
        self._largest = wp.zeros(1, dtype=space.real, device=device)
        spacing = 2.0 * skin.half.numpy()
        self._longest = float(spacing.max())
        # Two particles may near each other by as much as the shorter spacing
        self._allowed = 0.5 * MARGIN * float(spacing.min()) / self._longest
        side = int(np.clip(2 ** round(np.log2(max(k, 1)) / space.dim), 8, 128))
        sides = [side if axis < space.dim else 1 for axis in range(3)]
        self._grid = wp.HashGrid(*sides, device=device, dtype=space.real)
        self.pairs, self.searches, self._stale = 0, 0, True

    def _room(self, pairs: int) -> wp.array:
        return wp.zeros(pairs, dtype=wp.int32, device=self.device)

    def forget(self) -> None:
        """Have the next look search, for what is outermost has changed, or where it is."""
        self._stale = True

    def moved(self, x: wp.array, at: wp.array) -> bool:
        """Whether a particle is far from where it was; reads the device."""
        self._largest.zero_()
        arguments = [self.skin.places, x, self.skin.half, at, self._largest]
        self._launch(_make_moved(self.space), len(at), arguments)
        return not float(self._largest.numpy()[0]) <= self._allowed

    def look(self, x: wp.array) -> None:
        """See that the rows hold all pairs in range at ``x`` [m], (n,) of vec by place; reads the device."""
        if self._stale or self.moved(x, self.at):
            self._search(x)

    def _search(self, x: wp.array) -> None:
        skin, k = self.skin, len(self.at)
        self._launch(_make_note(self.space), k, [skin.places, x, self.at, self._padded])
        self._grid.build(self._padded, (RANGE + MARGIN) * self._longest * QUERY_MARGIN)
        self._fill(False)
        wp.utils.array_scan(self._count, self.rows.start, inclusive=False)
        self.pairs = int(self.rows.start[k:].numpy()[0])
        if self.pairs > len(self.rows.index):
            self.rows.index = self._room(self.pairs + self.pairs // 4)
        if self.pairs:
            self._fill(True)
            skin.want(self.rows.start)
        self._stale, self.searches = False, self.searches + 1

    def _fill(self, fill: bool) -> None:
        skin = self.skin
        arguments = [self._grid.id, self._padded, skin.there, skin.bodies, self._felt, skin.half, self._longest]
        arguments += [self._count, self.rows.start, self.rows.index]
        self._launch(_make_search(self.space, fill), len(self.at), arguments)
