"""Bodies that lie in each other: they do not feel it, so somebody should say so."""

import logging
import math
import time
from collections.abc import Collection, Sequence
from itertools import combinations, pairwise, product
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
        groups, pairs = groups_of(bodies), combinations(range(len(bodies)), 2)
        self._left = [(i, j) for i, j in pairs if groups[i] != groups[j] and len(matter[i]) and len(matter[j])]
        felt = {frozenset(two) for two in touching}
        self._left = [(i, j) for i, j in self._left if frozenset((self.names[i], self.names[j])) not in felt]
        self._looked, self._due, self._rest = 0, 0.0, 0.0  # step, time [s], the clock on the wall [s]

    def look(self, x: np.ndarray, t: float, step: int, speed: float = math.inf) -> list[str]:
        """A line for each two bodies that overlap or touch at positions ``x`` [m], (n, dim), and did not before.

        ``speed`` is the largest of any particle [m/s].
        """
        x = x - self._box * np.floor(np.divide(x, self._box, out=np.zeros_like(x), where=self._box > 0.0))
        places = [x[numbers] for numbers, _ in self._matter]
        spacing = [spacing for _, spacing in self._matter]
        when = f" by t = {t:.6g} s, step {step}" if step else ""
        lines, gap, start = [], math.inf, time.perf_counter()
        for i, j in list(self._left):
            apart = _gap(places[i], places[j], self._shifts) - TOUCHING * max(spacing[i].max(), spacing[j].max())
            gap = min(gap, max(apart, 0.0))
            if apart > 0.0 or start < self._rest:
                continue
            one, other = (places[i], spacing[i]), (places[j], spacing[j])
            within = [_near(*one, *other, self._shifts), _near(*other, *one, -self._shifts)]
            if any(near.any() for near in within):
                self._left.remove((i, j))
                names = [f"{near.sum()} particles of {self.names[k]!r}" for k, near in zip((i, j), within, strict=True)]
                lines.append(
                    f"bodies {self.names[i]!r} and {self.names[j]!r} overlap or touch{when}: {' and '.join(names)} lie "
                    f"within {TOUCHING} spacings of one of the other; bodies do not feel each other, they pass through,"
                    " unless bonded=... makes them one or an interaction acts between them"
                )
        if gap == 0.0 and start >= self._rest:
            end = time.perf_counter()
            self._rest = end + (end - start) / SHARE
        self._looked, self._due = step, t + 0.25 * gap / max(speed, 1e-300)
        return lines

    def look_now_and_then(self, simulation: Any) -> None:
        """Log what ``look`` finds, if it is time for it."""
        if not self._left or simulation.steps < self._looked + LEAST:
            return
        if simulation.t < self._due and simulation.steps < self._looked + MOST:
            return
        speed = simulation.diagnostics.extrema(simulation.stepper.U)[2]
        for line in self.look(simulation.x, simulation.t, simulation.steps, speed):
            log.warning("%s", line)


def _gap(x: np.ndarray, y: np.ndarray, shifts: np.ndarray) -> float:
    """The largest distance along an axis between the boxes around x and y, or the nearest image of y."""
    (low, high), (lower, upper) = ((places.min(axis=0), places.max(axis=0)) for places in (x, y))
    apart = np.maximum(lower + shifts - high, low - upper - shifts).max(axis=1)
    return float(apart.min())


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
