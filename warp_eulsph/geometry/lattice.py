"""Cell-centred lattices."""

from collections.abc import Sequence

import numpy as np


def box(
    lower: Sequence[float], upper: Sequence[float], spacing: float, *, jitter: float = 0.0, seed: int = 0
) -> tuple[np.ndarray, float]:
    """Particles at the centres of equal cells that fill a box exactly.

    The spacing is adjusted along each axis, so that a whole number of cells divides the length.

    Args:
        lower: lower corner [m], (dim,).
        upper: upper corner [m], (dim,).
        spacing: wanted spacing [m].
        jitter: largest random displacement along each axis over the spacing there, in [0, 0.5).
        seed: of the jitter.

    Returns:
        Positions [m], (n, dim), the last axis fastest, and the volume of one cell [m^dim].

    Raises:
        ValueError: corners of unequal or wrong length, a spacing that leaves an axis without a cell, or a jitter out
            of range.
    """
    low, high = np.array(lower, dtype=float, ndmin=1), np.array(upper, dtype=float, ndmin=1)
    if low.shape != high.shape or low.ndim != 1 or low.size not in (1, 2, 3):
        raise ValueError(f"lower and upper must both have 1, 2 or 3 components, got {lower} and {upper}")
    if not (np.isfinite(spacing) and spacing > 0.0):
        raise ValueError(f"spacing must be positive and finite, got {spacing} m")
    if not 0.0 <= jitter < 0.5:
        raise ValueError(f"jitter must be in [0, 0.5) spacings, got {jitter}; 0.1 is irregular already")
    length = high - low
    cells = np.rint(length / spacing)
    if not np.isfinite(length).all() or (cells < 1).any():
        axis = int(np.argmin(np.where(np.isfinite(cells), cells, -1)))
        raise ValueError(
            f"every axis must hold at least one cell, got length {length[axis]:.6g} m along axis {axis} at spacing "
            f"{spacing:.6g} m; order the corners or refine"
        )
    step = length / cells
    ranks = np.stack(np.meshgrid(*(np.arange(n) for n in cells.astype(int)), indexing="ij"), axis=-1)
    centres = ranks.reshape(-1, low.size) + 0.5
    if jitter > 0.0:
        centres = centres + np.random.default_rng(seed).uniform(-jitter, jitter, centres.shape)
    return low + centres * step, float(np.prod(step))
