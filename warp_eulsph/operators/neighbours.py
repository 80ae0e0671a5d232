"""Neighbour lists: a search once per reference, then rows that every sum walks."""

import functools
import logging
from collections.abc import Sequence

import numpy as np
import warp as wp

from ..execution import Launcher, simd
from ..fields import neighbour_structure
from ..space import Space, vector_type
from ..structs import NeighbourRows
from ..weights import Weight
from .cells import Cells
from .grid_search import GridSearch, make_longest
from .slices import SLICE, Slices, places_taken

log = logging.getLogger(__name__)

# Pairs are numbered by 32-bit integers.
MOST_PAIRS = 2**31 - 1


@functools.cache
def _make_pad(space: Space, first_component: int) -> wp.Kernel:
    """Kernel: positions as components of 3-vectors from ``first_component`` on, wrapped into the periodic box."""
    real, vec, dim = space.real, space.vec, space.dim
    vec3 = wp.types.vector(length=3, dtype=real)

    @wp.kernel(module="unique", enable_backward=False)
    def pad(first: int, x: wp.array(dtype=vec), box: vec, out: wp.array(dtype=vec3)):
        a = first + wp.tid()
        p = vec3()
        for i in range(wp.static(dim)):
            along = x[a][i]
            if box[i] > real(0.0):
                along = along - box[i] * wp.floor(along / box[i])
            p[i + first_component] = along
        out[a] = p

    return pad


@functools.cache
def _make_check_room(space: Space) -> wp.Kernel:
    """Kernel of one thread: stop a running batch of steps where the host must act before the lists can be filled."""
    real, vec, dim = space.real, space.vec, space.dim

    @wp.kernel(module="unique", enable_backward=False)
    def check_room(
        total: wp.array(dtype=wp.int32),
        capacity: int,
        h_max: wp.array(dtype=real),
        support: real,
        box: vec,
        running: wp.array(dtype=wp.int32),
        waiting: wp.array(dtype=wp.int32),
    ):
        fits = total[0] >= 0 and total[0] <= capacity  # below 0 the sum ran over
        for i in range(wp.static(dim if space.periodic else 0)):
            fits = fits and (box[i] == real(0.0) or box[i] >= real(2.0) * support * h_max[0])
        if running[0] != 0 and not fits:
            running[0] = 0
            waiting[0] = 1

    return check_room


class NeighbourLists:
    """Symmetric neighbour lists of one particle set, rebuilt in place; grows when a configuration needs more room.

    Two particles are neighbours when they are of the same body and closer than support · (h_a + h_b)/2.

    Args:
        space: dimension, precision, periodicity.
        weight: its support radius bounds the lists.
        h: smoothing lengths [m], (n,); those of the moment count at each ``build``.
        body: body numbers, (n,).
        box: lengths of the periodic box [m], zero where open.
        device: Warp device.
        tilted: whether the weights of a pair's two ends differ (M17).
    """

    def __init__(
        self,
        space: Space,
        weight: Weight,
        h: wp.array,
        body: wp.array,
        box: Sequence[float],
        device: wp.DeviceLike,
        tilted: bool = False,
    ):
        self.space, self.device, self._launch = space, device, Launcher(device)
        self.h, self.body, self.box, self._tilted = h, body, space.vec(*box), tilted
        n = len(h)
        self.support, self._in_cells = weight.support, simd(device)
        self.cells: Cells | None = None
        self.grid: GridSearch | None = None
        self._h_max = wp.zeros(1, dtype=space.real, device=device)
        self._slices = None if self._in_cells else Slices(n, device)
        self._equip()
        self.rows: NeighbourRows = neighbour_structure(space)()
        self.rows.box = self.box
        self.rows.start = wp.zeros(n + 1, dtype=wp.int32, device=device)
        self.rows.stride = 1 if self._slices is None else SLICE
        self.rows.stop = self.rows.start[1:] if self._slices is None else wp.zeros(n, dtype=wp.int32, device=device)
        self._waiting = wp.zeros(1, dtype=wp.int32, device=device)
        self._total = self.rows.start[n:]
        self._builds = 0
        self._reserve(0)

    def _equip(self) -> None:
        """Allocate what a search needs besides the lists."""
        n, space, device = len(self.h), self.space, self.device
        self.padded = wp.zeros(n, dtype=vector_type(3, space.real), device=device)
        self.count = wp.zeros(n + 1, dtype=wp.int32, device=device)
        if self._slices is None:
            self.cells = Cells(space, self.support, self.h, self.body, self.box, device)
        else:
            among = self.h, self._h_max, self.body, self.box
            self.grid = GridSearch(space, self.support, *among, self.count, self._slices.longest, device)

    def release(self) -> None:
        """Free what a search needs besides the lists; the next search allocates it again."""
        self._launch.forget()
        if self._slices is not None:
            self._slices.release()
        self.cells = self.grid = self.padded = self.count = None

    @property
    def capacity(self) -> int:
        """Places for pairs that there are."""
        return len(self.rows.index)

    @property
    def room(self) -> int:
        """Places that the rows take: their pairs, and in slices what fills rows up; reads the device.

        Raises:
            ValueError: more than can be numbered.
        """
        room = int(self._total.numpy()[0])
        if room < 0:  # the sum of the counts ran over
            raise ValueError(self._too_many(2.0**31))
        return room

    @property
    def lengths(self) -> np.ndarray:
        """Neighbours of each particle, (n,); reads the device."""
        return (self.rows.stop.numpy() - self.rows.start.numpy()[:-1]) // self.rows.stride

    @property
    def pairs(self) -> int:
        """Directed pairs (a, b) in the lists; reads the device."""
        return int(self.lengths.sum()) if self.room else 0

    def of_pairs(self, array: wp.array) -> np.ndarray:
        """``rows.index``, ``w`` or ``own`` row by row without what fills slices up, (pairs,); reads the device."""
        lengths = self.lengths
        behind = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        return array.numpy()[np.repeat(self.rows.start.numpy()[:-1], lengths) + self.rows.stride * behind]

    @property
    def waiting(self) -> bool:
        """Whether ``check_room`` stopped a batch of steps until ``make_room`` is called; reads the device."""
        return bool(self._waiting.numpy()[0])

    def _reserve(self, pairs: int) -> None:
        self._launch.forget()
        self.rows.index = wp.zeros(pairs, dtype=wp.int32, device=self.device)
        self.rows.w = wp.zeros(pairs, dtype=self.space.real, device=self.device)
        self.rows.own = wp.zeros_like(self.rows.w) if self._tilted else self.rows.w

    def build(self, x: wp.array) -> None:
        """Find the neighbours in configuration ``x`` [m], (n,) of vec; ``rows.w`` is left to be computed."""
        self.count_neighbours(x)
        self.sum_counts()
        if self.room > self.capacity:  # not where the rows of before are found again, in whatever order
            self.make_room()
        self.fill(x)

    def count_neighbours(self, x: wp.array) -> None:
        """How many neighbours each particle has in ``x``; launches only, as is all of ``build`` but ``make_room``."""
        n = len(x)
        if self.padded is None:
            self._equip()
        if not self._in_cells or self.space.periodic:
            self._h_max.zero_()
            self._launch(make_longest(self.space), n, [self.h, self._h_max])
        last = 3 - self.space.dim if self._in_cells else 0
        self._launch(_make_pad(self.space, last), n, [x, self.box, self.padded])
        self._scratch = self.rows.w
        if self.cells is not None:
            self.cells.sort(self.padded)
            self._search_cells(fill=False)
        elif self.grid is not None:
            if self._builds == 0:
                self._measure()
            self.grid.sort(self.padded, self._longest)
            self.grid.count(self.padded, x, self._scratch)

    def sum_counts(self) -> None:
        """Where each row begins and stops; may be repeated."""
        if self._slices is None:
            wp.utils.array_scan(self.count, self.rows.start, inclusive=False)
        else:
            self._slices.lay(self.count, self.rows)

    def check_room(self, running: wp.array) -> None:
        """Stop a batch of steps (``running`` ← 0) when the lists have no room for the rows; launches only."""
        arguments = [self._total, self.capacity, self._h_max, self.support, self.box, running, self._waiting]
        self._launch.once(_make_check_room(self.space), 1, arguments)

    def make_room(self) -> None:
        """Grow the lists if the rows need it; reads the device.

        Raises:
            ValueError: a periodic box shorter than twice the support radius, or more pairs than can be numbered.
        """
        self._measure()
        lengths = self.count.numpy()[:-1]  # exactly: the sum on the device may have run over
        room = int(lengths.sum(dtype=np.int64)) if self._slices is None else places_taken(lengths)
        if room > MOST_PAIRS:
            raise ValueError(self._too_many(room))
        # Exactly what the first configuration needs, which may be the only one; from the second on a quarter more than
        # needed, so that a moving reference grows its lists seldom.
        if room > self.capacity or self._builds == 1:
            self._reserve(room + (room // 4 if self._builds else 0))
            log.debug("neighbour lists grew to %d pairs", self.capacity)
        self._waiting.zero_()
        self._builds += 1

    def _too_many(self, pairs: float) -> str:
        return (
            f"neighbour lists number at most {MOST_PAIRS} pairs, {len(self.h)} particles have {pairs:.4g} or more; use "
            "fewer particles or a smaller dilation"
        )

    def fill(self, x: wp.array) -> None:
        """Write the rows, for which there is room."""
        if self.grid is not None:
            self.grid.fill(self.padded, x, self.rows)
        else:
            self._search_cells(fill=True)

    def _search_cells(self, fill: bool) -> None:
        assert self.cells is not None  # one or the other is made
        self.cells.search(self.padded, self.count, self.rows.start, self.rows.index, self._scratch, fill)

    def _measure(self) -> None:
        """Note the largest smoothing length of the last count; reads the device."""
        if self._in_cells and not self.space.periodic:
            return
        self._longest = float(self._h_max.numpy()[0])  # cells of the next grid: any size is right, this one is fast
        for i, length in enumerate(float(length) for length in self.box):
            if 0.0 < length < 2.0 * self.support * self._longest:
                raise ValueError(
                    f"periodic box length along axis {i} must be at least twice the support radius "
                    f"({2 * self.support * self._longest:.6g} m), got {length:.6g} m; enlarge the box or refine"
                )
