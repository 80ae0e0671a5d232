"""Bodies that lie in each other: they do not feel it, so somebody should say so."""

import itertools
from collections.abc import Sequence

import numpy as np

from .body import Body, groups_of

# Faces that touch have their particles a spacing apart, and √1.5 of it where lattices are shifted against each other.
TOUCHING = 1.25
# Pairs in memory at once.
_BLOCK = 200_000


def overlaps(bodies: Sequence[Body], ghosts: Sequence[np.ndarray], box: Sequence[float]) -> list[str]:
    """A line for each two bodies that overlap or touch, with how many particles.

    Args:
        bodies: at the start.
        ghosts: which particles of each body are mirror ghosts, (n,) bool, which are no matter.
        box: lengths of the periodic box [m], 0 where it is open.
    """
    matter = [(body.x[~ghost], body.spacing[~ghost]) for body, ghost in zip(bodies, ghosts, strict=True)]
    shifts = np.array(list(itertools.product(*[(-length, 0.0, length) if length > 0.0 else (0.0,) for length in box])))
    lines = []
    groups = groups_of(bodies)
    for (i, one), (j, other) in itertools.combinations(enumerate(matter), 2):
        if groups[i] == groups[j]:
            continue
        within = [_near(*one, *other, shifts), _near(*other, *one, -shifts)]
        if any(near.any() for near in within):
            names = [f"{near.sum()} particles of {bodies[k].name!r}" for k, near in zip((i, j), within, strict=True)]
            lines.append(
                f"bodies {bodies[i].name!r} and {bodies[j].name!r} overlap or touch: {' and '.join(names)} lie within "
                f"{TOUCHING} spacings of one of the other; bodies do not feel each other, they pass through, unless "
                "bonded=... makes them one or an interaction acts between them"
            )
    return lines


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
    for step in itertools.product((-1, 0, 1), repeat=x.shape[1]):
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
