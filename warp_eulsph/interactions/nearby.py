"""Which outermost particles are near each that it may touch: rows found anew only when something moved far enough."""

import functools
from typing import Any

import numpy as np
import warp as wp

from ..execution import Launcher
from ..operators.grid_search import QUERY_MARGIN
from ..space import Space
from ..structs import ClockArrays, StateArrays
from .faces import REACH, alike_vectors
from .law import rows_structure
from .moved import Moved
from .skin import Skin

# How far beyond the range of the law rows reach, in spacings: a search lasts until two have moved so far relative to
# each other.
MARGIN = 1.0
# Range of the law, in spacings of the coarser body: across by the weight of the surface, along two sums of two halves,
# which is where the rate looks for what may touch in a step.
RANGE = float(np.hypot(2.0 * REACH, 2.0))
# Range of forces alone.
TOUCH = float(np.hypot(2.0 * REACH, 1.0))


@functools.cache
def matter_structure(space: Space) -> Any:
    """``wp.struct`` of what is known of a skin's particles in the reference.

    Place [m], way out, spacing [m], radius of the support of weights [m], and how far it is torn off (``Skin.torn``).
    """

    @wp.struct
    class Matter:
        X: wp.array(dtype=space.vec)
        outward: wp.array(dtype=space.vec)
        spacing: wp.array(dtype=space.real)
        support: wp.array(dtype=space.real)
        torn: wp.array(dtype=wp.int32)

    return Matter


@functools.cache
def _make_pad(space: Space) -> wp.Kernel:
    """Kernel: places as 3-vectors, for the grid."""
    real, vec, dim = space.real, space.vec, space.dim
    vec3 = wp.types.vector(length=3, dtype=real)

    @wp.kernel(module="unique", enable_backward=False)
    def pad(first: int, at: wp.array(dtype=vec), padded: wp.array(dtype=vec3)):
        k = first + wp.tid()
        q = vec3()
        for i in range(wp.static(dim)):
            q[i] = at[k][i]
        padded[k] = q

    return pad


@functools.cache
def _strangers(space: Space) -> wp.Function:
    """``wp.func`` whether two outermost particles may touch, by their places and ways out in the reference.

    Of other bodies all may, felt = 1. Of one (felt = 2) those that do not feel each other by weights, nor would by the
    law in the reference, and of those so near that rows would hold them there the ones across a gap, which lie before
    each other and do not look the same way. What a crack let go feels nobody by weights, and who lies beside one looks
    all ways.
    """
    real, Matter, alike = space.real, matter_structure(space), alike_vectors(space)

    @wp.func
    def strangers(matter: Matter, k: int, m: int, felt: int) -> bool:
        if felt < 2:
            return felt == 1
        torn = wp.max(matter.torn[k], matter.torn[m])
        if torn == 2:
            return True
        d = matter.X[m] - matter.X[k]
        apart = wp.length(d)
        spacing = wp.max(matter.spacing[k], matter.spacing[m])
        known = wp.max(real(0.5) * (matter.support[k] + matter.support[m]), real(TOUCH) * spacing)
        if apart < known:
            return False
        if torn == 0 and apart < real(wp.static(RANGE + MARGIN)) * spacing:
            before = wp.dot(d, matter.outward[k]) > real(0.0) and wp.dot(d, matter.outward[m]) < real(0.0)
            return before and not alike(matter.outward[k], matter.outward[m])
        return True

    return strangers


@functools.cache
def _make_search(space: Space, fill: bool) -> wp.Kernel:
    """Kernel: count a row, or (``fill``) write it sorted by index."""
    real, Matter, strangers = space.real, matter_structure(space), _strangers(space)
    vec3 = wp.types.vector(length=3, dtype=real)

    @wp.kernel(module="unique", enable_backward=False)
    def search(
        first: int,
        grid: wp.uint64,
        padded: wp.array(dtype=vec3),
        there: wp.array(dtype=wp.int32),
        bodies: wp.array(dtype=wp.int32),
        felt: wp.array2d(dtype=wp.int32),
        matter: Matter,
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
                if there[m] == 1 and strangers(matter, k, m, felt[bodies[k], bodies[m]]):
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
    """For each particle of a skin those that forces may reach, of other bodies or across a gap, in sorted rows.

    Rows hold more than is in range, and what is not adds nothing, so that forces do not depend on when they were found.

    Args:
        skin: its particles are numbered 0, 1, ….
        felt: whether two bodies feel each other, (bodies, bodies), symmetric: 0 no, 1 yes, 2 where they are one piece
            of matter, such as a body and itself.
        matter: struct of ``matter_structure``.

    Attributes:
        rows: struct of ``start`` and ``index``, int32: row k is ``index[start[k]:start[k+1]]``.
        pairs: entries in the rows; where there are none nothing is near. searches: so far.
    """

    def __init__(self, skin: Skin, felt: np.ndarray, matter: Any):
        self.skin, self.space = skin, skin.space
        self.device = device = skin.places.device
        self._launch, space, k = Launcher(device), skin.space, len(skin.indices)
        self._matter = matter
        self._felt = wp.array(felt, dtype=wp.int32, device=device)
        self._padded = wp.zeros(k, dtype=wp.types.vector(length=3, dtype=space.real), device=device)
        self._count = wp.zeros(k + 1, dtype=wp.int32, device=device)
        self.rows = rows_structure()()
        self.rows.start, self.rows.index = wp.zeros(k + 1, dtype=wp.int32, device=device), self._room(0)
        spacing = 2.0 * skin.half.numpy()
        self._longest = float(spacing.max())
        self.moved = Moved(space, skin.places, MARGIN * float(spacing.min()))
        side = int(np.clip(2 ** round(np.log2(max(k, 1)) / space.dim), 8, 128))
        sides = [side if axis < space.dim else 1 for axis in range(3)]
        self._grid = wp.HashGrid(*sides, device=device, dtype=space.real)
        self.pairs, self.searches = 0, 0

    def _room(self, pairs: int) -> wp.array:
        return wp.zeros(pairs, dtype=wp.int32, device=self.device)

    def forget(self) -> None:
        """Have the next look search, for what is outermost has changed, or where it is."""
        self.moved.forget()

    def look(self, state: StateArrays, clock: ClockArrays, ahead: float = 0.0) -> None:
        """See that rows hold all in range at ``state``, and ``ahead`` last steps later; reads the device."""
        if self.moved(state, clock, ahead):
            self._search(state.x)

    def _search(self, x: wp.array) -> None:
        skin, k = self.skin, len(self.skin.indices)
        self.moved.note(x)
        self._launch(_make_pad(self.space), k, [self.moved.at, self._padded])
        self._grid.build(self._padded, (RANGE + MARGIN) * self._longest * QUERY_MARGIN)
        self._fill(False)
        wp.utils.array_scan(self._count, self.rows.start, inclusive=False)
        self.pairs = int(self.rows.start[k:].numpy()[0])
        if self.pairs > len(self.rows.index):
            self.rows.index = self._room(self.pairs + self.pairs // 4)
        if self.pairs:
            self._fill(True)
            skin.want(self.rows.start)
        self.searches += 1

    def _fill(self, fill: bool) -> None:
        skin = self.skin
        arguments = [self._grid.id, self._padded, skin.there, skin.bodies, self._felt, self._matter]
        arguments += [skin.half, self._longest]
        arguments += [self._count, self.rows.start, self.rows.index]
        self._launch(_make_search(self.space, fill), len(self._padded), arguments)
