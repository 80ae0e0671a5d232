"""Neighbour search by portable kernels: what a hash grid holds in the cells around, then rows put in order.

A row is kept as it is met when it is counted. Where all rows fit into what the lists had room for, they are not looked
for again; each entry then finds its place by itself.
"""

import functools
from typing import Any

import numpy as np
import warp as wp

from ..atomics import raise_to
from ..execution import Launcher
from ..fields import integers_of
from ..space import Space, difference
from ..structs import NeighbourRows
from .slices import SLICE

# Cell coordinates are rounded, distances are tested exactly: a query a little too wide misses nothing.
QUERY_MARGIN = 1.001
# Places are numbered by 32-bit integers.
MOST_PLACES = 2**31 - 1
#: Entries of a row that find their places at a time, in registers.
AT_A_TIME = 16


@functools.cache
def make_longest(space: Space) -> wp.Kernel:
    """Kernel: the largest smoothing length."""
    real = space.real
    raise_longest = raise_to(real)

    @wp.kernel(module="unique", enable_backward=False)
    def find_longest(first: int, h: wp.array(dtype=real), h_max: wp.array(dtype=real)):
        raise_longest(h_max, h[first + wp.tid()])

    return find_longest


@functools.cache
def _neighbours(space: Space) -> wp.Function:
    """``wp.func`` whether b is in the row of a, which looks from its image at p."""
    real, vec, dim = space.real, space.vec, space.dim
    vec3 = wp.types.vector(length=3, dtype=real)
    separation = difference(space)

    @wp.func
    def neighbours(
        a: int,
        b: int,
        p: vec3,
        padded: wp.array(dtype=vec3),
        x: wp.array(dtype=vec),
        h: wp.array(dtype=real),
        box: vec,
        support: real,
    ) -> bool:
        # The query returns whole cells: in a small box it meets b from several images
        nearest = bool(True)
        for i in range(wp.static(dim if space.periodic else 0)):
            if box[i] > real(0.0):
                nearest = nearest and wp.abs(padded[b][i] - p[i]) < real(0.5) * box[i]
        return nearest and wp.length(separation(x[b], x[a], box)) < support * real(0.5) * (h[a] + h[b])

    return neighbours


@functools.cache
def _make_search(space: Space, fill: bool) -> wp.Kernel:
    """Kernel: count a row's neighbours, and keep the row in ``found`` while there is ``room``; or with ``fill`` write
    it there, where it belongs, unless all were kept. In the order in which they are met.
    """
    real, vec, dim = space.real, space.vec, space.dim
    vec3 = wp.types.vector(length=3, dtype=real)
    is_neighbour = _neighbours(space)
    images = 3 if space.periodic else 1
    shifts_y, shifts_z = (images if dim > 1 else 1), (images if dim > 2 else 1)
    lowest = -1 if space.periodic else 0

    @wp.kernel(module="unique", enable_backward=False)
    def search(
        first: int,
        grid: wp.uint64,
        padded: wp.array(dtype=vec3),
        x: wp.array(dtype=vec),
        h: wp.array(dtype=real),
        body: wp.array(dtype=wp.int32),
        box: vec,
        support: real,
        h_max: wp.array(dtype=real),
        count: wp.array(dtype=wp.int32),
        start: wp.array(dtype=wp.int32),
        longest: wp.array(dtype=wp.int32),
        room: int,
        found: wp.array(dtype=wp.int32),
    ):
        a = first + wp.tid()
        reach = support * real(0.5) * (h[a] + h_max[0]) * real(QUERY_MARGIN)
        n, row, most = int(0), (a // SLICE) * SLICE * room + a % SLICE, room
        # Dynamic bounds: unrolled, the 27 copies of the query in 3-D take 13 s to compile
        images_x = int(wp.static(images))
        images_y = int(wp.static(shifts_y))
        images_z = int(wp.static(shifts_z))
        if wp.static(fill):
            row, most = int(start[a]), int(count[a])
            if longest[0] <= room:
                images_x = int(0)
        for ix in range(images_x):
            for iy in range(images_y):
                for iz in range(images_z):
                    p = padded[a]
                    shift = wp.vec3i(ix + lowest, iy + lowest, iz + lowest)
                    inside = bool(True)
                    for i in range(wp.static(dim if space.periodic else 0)):
                        if shift[i] != 0:
                            p[i] = p[i] + box[i] * real(shift[i])
                            inside = inside and box[i] > real(0.0) and p[i] > -reach and p[i] < box[i] + reach
                    if inside:
                        for b in wp.hash_grid_query(grid, p, reach, body[a]):
                            if b != a and is_neighbour(a, b, p, padded, x, h, box, support):
                                if n < most:
                                    found[row + n * SLICE] = b
                                n = n + 1
        if wp.static(not fill):
            count[a] = n

    return search


@functools.cache
def _make_order() -> wp.Kernel:
    """Kernel: rows as they were met, kept or filled, sorted into ``index``: the place of each entry is how many of its
    row are smaller.

    Of n entries each is read n / ``AT_A_TIME`` times; to shift them into place, one after another, takes n/4 reads and
    writes of each, of which every one waits for the last.
    """

    # C++, for entries and ranks to stay in registers
    @wp.func_native(f"""
    const bool was_kept = longest.data[0] <= room;
    const int* const from = was_kept ? kept.data + slot : found.data + start;
    const int all = n * {SLICE};
    for (int i = 0; i < all; i += {AT_A_TIME * SLICE}) {{
        int entry[{AT_A_TIME}], rank[{AT_A_TIME}];
        #pragma unroll
        for (int m = 0; m < {AT_A_TIME}; ++m) {{
            entry[m] = i + m * {SLICE} < all ? from[i + m * {SLICE}] : 0;
            rank[m] = 0;
        }}
        for (int k = 0; k < all; k += {SLICE}) {{
            const int other = from[k];
            #pragma clang loop vectorize(enable) unroll(disable)
            for (int m = 0; m < {AT_A_TIME}; ++m) rank[m] += other < entry[m];
        }}
        #pragma unroll
        for (int m = 0; m < {AT_A_TIME}; ++m)
            if (i + m * {SLICE} < all) index.data[start + rank[m] * {SLICE}] = entry[m];
    }}
    """)
    def rank_row(
        n: int,
        slot: int,
        start: int,
        room: int,
        longest: wp.array(dtype=wp.int32),
        kept: wp.array(dtype=wp.int32),
        found: wp.array(dtype=wp.int32),
        index: wp.array(dtype=wp.int32),
    ): ...

    @wp.kernel(module="unique", enable_backward=False)
    def order(
        first: int,
        count: wp.array(dtype=wp.int32),
        start: wp.array(dtype=wp.int32),
        longest: wp.array(dtype=wp.int32),
        room: int,
        kept: wp.array(dtype=wp.int32),
        found: wp.array(dtype=wp.int32),
        index: wp.array(dtype=wp.int32),
    ):
        a = first + wp.tid()
        rank_row(count[a], (a // SLICE) * SLICE * room + a % SLICE, start[a], room, longest, kept, found, index)

    return order


class GridSearch:
    """Particles in the cells of a hash grid, and the search among them.

    Args:
        space: dimension, precision, periodicity.
        support: support radius of the weight in smoothing lengths.
        h: smoothing lengths [m], (n,); those of the moment count at each search.
        h_max: the largest of them, (1,).
        body: body numbers, (n,).
        box: lengths of the periodic box [m], zero where open; ``vec``.
        count: lengths of the rows, (n + 1,), written when they are counted.
        longest: the length of the longest, (1,), known when they are filled.
        device: Warp device.

    Attributes:
        room: neighbours of each particle that there was room to keep when they were counted.
    """

    def __init__(
        self,
        space: Space,
        support: float,
        h: wp.array,
        h_max: wp.array,
        body: wp.array,
        box: wp.array,
        count: wp.array,
        longest: wp.array,
        device: wp.DeviceLike,
    ):
        self.space, self._width, self._launch, n = space, support * QUERY_MARGIN, Launcher(device), len(h)
        side = int(np.clip(2 ** round(np.log2(max(n, 1)) / space.dim), 8, 256))
        sides = [side if i < space.dim else 1 for i in range(3)]
        self._grid = wp.HashGrid(*sides, device=device, dtype=space.real)
        self._groups = body if len(np.unique(body.numpy())) > 1 else None  # to look for a group's own costs more
        self._among, self._lengths, self._longest = [h, body, box, support, h_max], count, longest
        self._scratch: wp.array | None = None
        self._start = wp.zeros(0, dtype=wp.int32, device=device)

    def sort(self, place: wp.array, longest: float) -> None:
        """Sort the particles at ``place`` [m], (n,) of 3-vectors, into cells that suit a ``longest`` h."""
        self._grid.build(place, self._width * longest, groups=self._groups)

    def count(self, place: wp.array, x: wp.array, scratch: wp.array) -> None:
        """Count the neighbours of each particle, and keep them in ``scratch``, (k,) of reals, as far as it goes.

        It is to be left alone until the rows are filled.
        """
        if scratch is not self._scratch:
            self._launch.forget()  # launches with arrays that the lists have outgrown
            self._scratch, self._kept = scratch, integers_of(scratch)
            self.room = min(len(self._kept), MOST_PLACES) // (-(-len(x) // SLICE) * SLICE)
        self._launch(_make_search(self.space, fill=False), len(x), self._arguments(place, x, self._start, self._kept))

    def fill(self, place: wp.array, x: wp.array, rows: NeighbourRows) -> None:
        """Write the rows, for which there is room; ``rows.w``, as long as they are, is used as scratch."""
        found = self._kept if rows.w is self._scratch else integers_of(rows.w)
        self._launch(_make_search(self.space, fill=True), len(x), self._arguments(place, x, rows.start, found))
        arguments = [self._lengths, rows.start, self._longest, self.room, self._kept, found, rows.index]
        self._launch(_make_order(), len(x), arguments)

    def _arguments(self, place: wp.array, x: wp.array, start: wp.array, found: wp.array) -> list[Any]:
        return [self._grid.id, place, x, *self._among, self._lengths, start, self._longest, self.room, found]
