"""Particles on concentric circles, finer towards the middle."""

import math
from collections.abc import Sequence
from numbers import Integral

import numpy as np

from ..memory import check_room
from .shapes import hollow, point


def annulus(centre: Sequence[float], inner: float, outer: float, rings: int) -> tuple[np.ndarray, np.ndarray]:
    """Particles on staggered circles between two radii, 2-D: the conformal image of a square lattice.

    Radii in geometric progression make the cells square everywhere; their size grows with the radius.

    Args:
        centre: [m], (2,).
        inner: inner radius [m].
        outer: outer radius [m].
        rings: number of circles.

    Returns:
        Positions [m], (n, 2), circle by circle, the innermost first, and areas [m²], (n,), with the exact sum.

    Raises:
        ValueError: wrong shapes, lengths that are not positive, inner not below outer, fewer than two circles.
        MemoryError: more particles than there is memory for.
    """
    middle = point("annulus", centre, 2)
    hollow("annulus", inner, outer)
    if not isinstance(rings, Integral) or rings < 2:
        raise ValueError(f"annulus: rings must be at least 2, got {rings}; a whole number")
    edges = inner * (outer / inner) ** (np.arange(rings + 1) / rings)
    around = round(2.0 * math.pi * rings / math.log(outer / inner))
    check_room(float(rings) * around, 10.0, "annulus")
    radii = np.sqrt(edges[1:] * edges[:-1])
    angles = 2.0 * math.pi / around * (np.arange(around)[None, :] + 0.5 * (np.arange(rings)[:, None] % 2))
    x = np.stack([radii[:, None] * np.cos(angles), radii[:, None] * np.sin(angles)], axis=-1).reshape(-1, 2)
    return middle + x, np.repeat(math.pi * (edges[1:] ** 2 - edges[:-1] ** 2) / around, around)
