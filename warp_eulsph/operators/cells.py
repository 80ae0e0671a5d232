"""Neighbour search on the CPU by SIMD: particles sorted into cells, then each particle's cells by rows of eight.

The lists are those of the portable search in ``neighbours.py``. Cells fill the box around all particles; along the last
axis they are contiguous, so that a particle looks at a few runs of candidates.
"""

import functools

import warp as wp

from ..execution import Launcher
from ..fields import integers_of
from ..simd import prelude
from ..space import Space
from .cell_search import MARGIN, make_search

# Candidates are read eight at a time, beyond the last one too.
SPARE = 8
CELLS_PER_PARTICLE = 4
TRIMS = 6
# Along x, y, z: wide columns, short cells along them, so that few columns are opened and few candidates are in vain.
CELLS_PER_SUPPORT = (1, 1, 3)


@functools.cache
def _make_frame(space: Space) -> wp.Kernel:
    """Kernel of one thread: the box around the places, and cells that fill it.

    ``frame`` becomes (origin x, y, z; cells per metre along x, y, z; largest h), ``sides`` the number of cells along
    each axis, at most ``most`` altogether. Where the box would need more, because fragments fly far away, it is drawn
    around the bulk: what lies within two standard deviations, several times over; the outermost cells take the rest.
    """
    real = space.real
    vec3 = wp.types.vector(length=3, dtype=real)
    divisions = ", ".join(map(str, CELLS_PER_SUPPORT))
    snippet = f"""
    {prelude(Space(space.dim, space.real))}
    T longest = 0;
    for (int a = 0; a < n; ++a) longest = h.data[a] > longest ? h.data[a] : longest;
    T rate[3], divisions[3] = {{{divisions}}};
    for (int i = 0; i < 3; ++i) rate[i] = divisions[i] / (T({MARGIN}) * support * longest);
    T from[3], to[3], low[3], high[3];
    for (int i = 0; i < 3; ++i) {{ from[i] = -__builtin_huge_val(); to[i] = __builtin_huge_val(); }}
    int count[3];
    auto cells = [&]() {{
        double all = 1;
        for (int i = 0; i < 3; ++i) {{
            const T along = (high[i] - low[i]) * rate[i];
            count[i] = along < T(1 << 20) ? (int)along + 1 : 1 << 20;
            all *= count[i];
        }}
        return all;
    }};
    for (int trims = 0;; ++trims) {{
        double sum[3] = {{0, 0, 0}}, squares[3] = {{0, 0, 0}}, inside = 0;
        for (int i = 0; i < 3; ++i) {{ low[i] = to[i]; high[i] = from[i]; }}
        for (int a = 0; a < n; ++a) {{
            const T* x = place.data[a].c;
            bool within = true;
            for (int i = 3 - dim; i < 3; ++i) within = within && x[i] >= from[i] && x[i] <= to[i];
            if (!within) continue;
            inside += 1;
            for (int i = 3 - dim; i < 3; ++i) {{
                low[i] = x[i] < low[i] ? x[i] : low[i];
                high[i] = x[i] > high[i] ? x[i] : high[i];
                sum[i] += x[i];
                squares[i] += double(x[i]) * x[i];
            }}
        }}
        for (int i = 0; i < 3 - dim; ++i) low[i] = high[i] = 0;
        if (cells() <= most || trims == {TRIMS}) break;
        for (int i = 3 - dim; i < 3; ++i) {{
            const double mean = sum[i] / inside, variance = squares[i] / inside - mean * mean;
            const T reach = 2 * __builtin_sqrt(variance > 0 ? variance : 0);
            from[i] = T(mean) - reach;
            to[i] = T(mean) + reach;
        }}
    }}
    for (int tries = 0; tries < 100 && cells() > most; ++tries)
        for (int i = 0; i < 3; ++i) rate[i] *= T(0.5);
    if (!(cells() <= most)) count[0] = count[1] = count[2] = 1;  // places that are no numbers
    for (int i = 0; i < 3; ++i) {{ frame.data[i] = low[i]; frame.data[3 + i] = rate[i]; sides.data[i] = count[i]; }}
    frame.data[6] = longest;
    """

    @wp.func_native(snippet)
    def fill_frame(
        n: int,
        place: wp.array(dtype=vec3),
        h: wp.array(dtype=real),
        support: real,
        most: int,
        frame: wp.array(dtype=real),
        sides: wp.array(dtype=int),
    ): ...

    @wp.kernel(module="unique", enable_backward=False)
    def frame_cells(
        place: wp.array(dtype=vec3),
        h: wp.array(dtype=real),
        support: real,
        most: int,
        frame: wp.array(dtype=real),
        sides: wp.array(dtype=int),
    ):
        fill_frame(place.shape[0], place, h, support, most, frame, sides)

    return frame_cells


@functools.cache
def _make_assign(space: Space) -> wp.Kernel:
    """Kernel: the cell that each particle lies in."""
    real = space.real
    vec3 = wp.types.vector(length=3, dtype=real)

    @wp.kernel(module="unique", enable_backward=False)
    def assign(
        first: int,
        place: wp.array(dtype=vec3),
        frame: wp.array(dtype=real),
        sides: wp.array(dtype=int),
        cell: wp.array(dtype=int),
    ):
        a = first + wp.tid()
        number = int(0)
        for i in range(3):
            along = (place[a][i] - frame[i]) * frame[3 + i]
            number = number * sides[i] + wp.clamp(int(along), 0, sides[i] - 1)
        cell[a] = number

    return assign


@functools.cache
def _make_sort() -> wp.Kernel:
    """Kernel of one thread: a stable counting sort; cell c holds ``order[begin[c]:begin[c+1]]``."""

    @wp.func_native("""
    const int cells = sides.data[0] * sides.data[1] * sides.data[2];
    for (int c = 0; c <= cells; ++c) begin.data[c] = 0;
    for (int a = 0; a < n; ++a) ++begin.data[cell.data[a] + 1];
    for (int c = 0; c < cells; ++c) begin.data[c + 1] += begin.data[c];
    for (int a = 0; a < n; ++a) order.data[begin.data[cell.data[a]]++] = a;
    for (int c = cells; c > 0; --c) begin.data[c] = begin.data[c - 1];
    begin.data[0] = 0;
    """)
    def counting_sort(
        n: int,
        cell: wp.array(dtype=int),
        sides: wp.array(dtype=int),
        begin: wp.array(dtype=int),
        order: wp.array(dtype=int),
    ): ...

    @wp.kernel(module="unique", enable_backward=False)
    def sort(
        cell: wp.array(dtype=int), sides: wp.array(dtype=int), begin: wp.array(dtype=int), order: wp.array(dtype=int)
    ):
        counting_sort(cell.shape[0], cell, sides, begin, order)

    return sort


@functools.cache
def _make_collect(space: Space) -> wp.Kernel:
    """Kernel: place, smoothing length and body in the order of the cells, each in a row of its own."""
    real = space.real
    vec3 = wp.types.vector(length=3, dtype=real)

    @wp.kernel(module="unique", enable_backward=False)
    def collect(
        first: int,
        order: wp.array(dtype=int),
        place: wp.array(dtype=vec3),
        h: wp.array(dtype=real),
        body: wp.array(dtype=int),
        columns: wp.array2d(dtype=real),
    ):
        j = first + wp.tid()
        a = order[j]
        for i in range(3):
            columns[i, j] = place[a][i]
        columns[3, j] = h[a]
        columns[4, j] = real(body[a])

    return collect


class Cells:
    """Particles sorted into cells, and the search among them; everything is allocated once.

    Args:
        space: dimension, precision, periodicity.
        support: support radius of the weight in smoothing lengths.
        h: smoothing lengths [m], (n,); those of the moment count at each search.
        body: body numbers, (n,).
        box: lengths of the periodic box [m], zero where open; ``vec``.
        device: the CPU.
    """

    def __init__(self, space: Space, support: float, h: wp.array, body: wp.array, box: wp.array, device: wp.DeviceLike):
        n = len(h)
        self.space, self.support, self.h, self.body, self.box, self.device = space, support, h, body, box, device
        self._launch = Launcher(device)
        self._scratch: wp.array | None = None
        self._room: wp.array | None = None
        self._stride = 0
        self._most = CELLS_PER_PARTICLE * n + 64
        self._frame = wp.zeros(7, dtype=space.real, device=device)
        self._sides = wp.zeros(3, dtype=int, device=device)
        self._cell = wp.zeros(n, dtype=int, device=device)
        self._begin = wp.zeros(self._most + 1, dtype=int, device=device)
        self._order = wp.zeros(n + SPARE, dtype=int, device=device)
        self._columns = wp.zeros((5, n + SPARE), dtype=space.real, device=device)

    def sort(self, place: wp.array) -> None:
        """Sort the particles at ``place`` [m], (n,) of 3-vectors whose last components are the coordinates."""
        n = len(place)
        arguments = [place, self.h, self.support, self._most, self._frame, self._sides]
        self._launch.once(_make_frame(self.space), 1, arguments)
        self._launch(_make_assign(self.space), n, [place, self._frame, self._sides, self._cell])
        self._launch.once(_make_sort(), 1, [self._cell, self._sides, self._begin, self._order])
        self._launch(_make_collect(self.space), n, [self._order, place, self.h, self.body, self._columns])

    def search(
        self, place: wp.array, count: wp.array, start: wp.array, index: wp.array, scratch: wp.array, fill: bool
    ) -> None:
        """Count the neighbours of each particle, or (``fill``) write them into the rows that ``start`` gives.

        ``scratch``, (k,) of reals, is to be left alone between the two: the count keeps there what it finds, as far as
        it goes.
        """
        if scratch is not self._scratch:
            self._launch.forget()  # launches with arrays that the lists have outgrown
            self._scratch, self._room = scratch, integers_of(scratch)
            # Rows inside a body are longer than the mean; rows that lie far apart would be slow to read
            self._stride = min(len(self._room), len(scratch) * 5 // 4) // len(place)
        arguments = [place, self.h, self.body, self.box, self.support, self._frame, self._sides]
        arguments += [self._begin, self._order, self._columns, count, start, index, self._room, self._stride]
        self._launch(make_search(self.space, fill), len(place), arguments)
