"""Bodies that lie in each other: they do not feel it, so somebody should say so."""

import logging
import math
import time
from collections.abc import Collection, Sequence
from itertools import pairwise, product
from typing import Any

import numpy as np

from .body import Body, groups_of

log = logging.getLogger(__name__)

# Faces that touch have their particles a spacing apart, and √1.5 of it where lattices are shifted against each other.
TOUCHING = 1.25
# Steps between two later looks, at least and at most.
LEAST, MOST = 8, 100
# Comparing places takes no more than this share of the time of a run.
SHARE = 0.02
# Pairs in memory at once.
_BLOCK = 200_000


class Encounters:
    """Tells when two bodies overlap or touch, once for each two: at the start, or later when they have come to it.

    Later it looks as soon as boxes around them can have met at twice the present speeds. Where boxes meet, places are
    compared, which takes a small share of the time of a run. Once all have been told nobody looks any more.

    Args:
        bodies: at the start.
        ghosts: which of all particles are mirror ghosts, (n,) bool, which are no matter.
        box: lengths of the periodic box [m], 0 where it is open.
        touching: names of two bodies that an interaction keeps apart, which nobody need be told of.
    """

    def __init__(
        self,
        bodies: Sequence[Body],
        ghosts: np.ndarray,
        box: Sequence[float],
        touching: Collection[tuple[str, str]] = (),
    ):
        self.names = [body.name for body in bodies]
        ends = np.cumsum([0, *(len(body.x) for body in bodies)])
        matter = [np.flatnonzero(~ghosts[first:last]) + first for first, last in pairwise(ends)]
        spacing = np.concatenate([body.spacing for body in bodies])
        self._matter = [(numbers, spacing[numbers]) for numbers in matter]
        self._box = np.array(box, dtype=float)
        self._shifts = np.array(list(product(*[(-length, 0.0, length) if length > 0.0 else (0.0,) for length in box])))
        there, group = np.array([len(numbers) > 0 for numbers in matter]), np.array(groups_of(bodies))
        pairs = np.stack(np.triu_indices(len(bodies), 1), axis=1)
        self._left = pairs[(group[pairs[:, 0]] != group[pairs[:, 1]]) & there[pairs].all(axis=1)]
        for two in touching:
            felt = np.isin(self._left, [k for k, name in enumerate(self.names) if name in two]).all(axis=1)
            self._left = self._left[~felt]
        self._looked, self._due, self._rest = 0, 0.0, 0.0  # step, time [s], the clock on the wall [s]

    def look(self, x: np.ndarray, t: float, step: int, speed: float = math.inf) -> list[str]:
        """A line for each two bodies that overlap or touch at positions ``x`` [m], (n, dim), and did not before.

        ``speed`` is the largest of any particle [m/s].
        """
        x = x - self._box * np.floor(np.divide(x, self._box, out=np.zeros_like(x), where=self._box > 0.0))
        places = [x[numbers] for numbers, _ in self._matter]
        spacing = [spacing for _, spacing in self._matter]
        when = f" by t = {t:.6g} s, step {step}" if step else ""
        lines, told, start = [], [], time.perf_counter()
        apart = self._apart(places)
        gap = max(float(apart.min(initial=math.inf)), 0.0)
        for k in np.flatnonzero(apart <= 0.0) if start >= self._rest else ():
            i, j = self._left[k]
            one, other = (places[i], spacing[i]), (places[j], spacing[j])
            within = [_near(*one, *other, self._shifts), _near(*other, *one, -self._shifts)]
            if any(near.any() for near in within):
                told.append(k)
                names = [f"{near.sum()} particles of {self.names[k]!r}" for k, near in zip((i, j), within, strict=True)]
                lines.append(
                    f"bodies {self.names[i]!r} and {self.names[j]!r} overlap or touch{when}: {' and '.join(names)} lie "
                    f"within {TOUCHING} spacings of one of the other; bodies do not feel each other, they pass through,"
                    " unless bonded=... makes them one or an interaction acts between them"
                )
        self._left = np.delete(self._left, told, axis=0)
        if gap == 0.0 and start >= self._rest:
            end = time.perf_counter()
            self._rest = end + (end - start) / SHARE
        self._looked, self._due = step, t + 0.25 * gap / max(speed, 1e-300)
        return lines

    def _apart(self, places: Sequence[np.ndarray]) -> np.ndarray:
        """How far the boxes around each two bodies left, or their nearest images, are from touching [m], (k,).

        Along the axis where that is most.
        """
        first, second = self._left.T
        low, high = (
            np.array([end(x, axis=0) if len(x) else x.sum(axis=0) for x in places]) for end in (np.min, np.max)
        )
        reach = TOUCHING * np.array([spacing.max() if len(spacing) else 0.0 for _, spacing in self._matter])
        apart = np.full(len(self._left), math.inf)
        for shift in self._shifts:
            across = np.maximum(low[second] + shift - high[first], low[first] - high[second] - shift).max(axis=1)
            apart = np.minimum(apart, across)
        return apart - np.maximum(reach[first], reach[second])

    def look_now_and_then(self, simulation: Any) -> None:
        """Log what ``look`` finds, if it is time for it."""
        if not len(self._left) or simulation.steps < self._looked + LEAST:
            return
        if simulation.t < self._due and simulation.steps < self._looked + MOST:
            return
        speed = simulation.diagnostics.extrema(simulation.stepper.U)[2]
        for line in self.look(simulation.x, simulation.t, simulation.steps, speed):
            log.warning("%s", line)


def _near(x: np.ndarray, spacing: np.ndarray, y: np.ndarray, other: np.ndarray, shifts: np.ndarray) -> np.ndarray:
    """Which particles x have one of y, or of its images, within reach of the mean of both spacings; (n,) bool."""
    found = np.zeros(len(x), dtype=bool)
    if not len(x) or not len(y):
        return found
    reach = TOUCHING * 0.5 * float(spacing.max() + other.max())
    for shift in shifts:
        image = y + shift
        inside = np.flatnonzero(~found & _in_box(x, image, reach))
        those = np.flatnonzero(_in_box(image, x, reach))
        if inside.size and those.size:
            found[inside] = _search(x[inside], spacing[inside], image[those], other[those], reach)
    return found


def _in_box(x: np.ndarray, y: np.ndarray, margin: float) -> np.ndarray:
    """Which of x lie in the box around y and a margin."""
    return ((x >= y.min(axis=0) - margin) & (x <= y.max(axis=0) + margin)).all(axis=1)


def _search(x: np.ndarray, spacing: np.ndarray, y: np.ndarray, other: np.ndarray, reach: float) -> np.ndarray:
    """``_near`` by cells of the side ``reach``; those of y are sorted by their number."""
    low = np.minimum(x.min(axis=0), y.min(axis=0))
    cells_x, cells_y = (np.floor((places - low) / reach).astype(np.int64) + 1 for places in (x, y))
    sides = np.maximum(cells_x.max(axis=0), cells_y.max(axis=0)) + 2
    place = np.concatenate([np.cumprod(sides[:0:-1])[::-1], [1]]).astype(np.int64)
    numbers = cells_y @ place
    order = np.argsort(numbers, kind="stable")
    numbers = numbers[order]
    found = np.zeros(len(x), dtype=bool)
    for step in product((-1, 0, 1), repeat=x.shape[1]):
        wanted = (cells_x + np.array(step)) @ place
        first, last = np.searchsorted(numbers, wanted), np.searchsorted(numbers, wanted, side="right")
        for part in _blocks(np.flatnonzero(~found & (last > first)), last - first):
            counts = (last - first)[part]
            a = np.repeat(part, counts)
            within = np.arange(len(a)) - np.repeat(np.cumsum(counts) - counts, counts)
            b = order[np.repeat(first[part], counts) + within]
            distance = np.linalg.norm(x[a] - y[b], axis=1)
            found[a[distance < TOUCHING * 0.5 * (spacing[a] + other[b])]] = True
    return found


def _blocks(particles: np.ndarray, counts: np.ndarray) -> list[np.ndarray]:
    """The particles in pieces that have at most about ``_BLOCK`` candidates."""
    ends = np.cumsum(counts[particles])
    return np.split(particles, np.searchsorted(ends, np.arange(_BLOCK, ends[-1] if len(ends) else 0, _BLOCK)))
