"""Boxes: particles within cells that fill them, or at the cells' corners with exact surface vectors."""

from collections.abc import Sequence

import numpy as np

from ..checks import real_number
from ..memory import check_room
from .filling import Filling, Lattice

# Particles are numbered by 32-bit integers.
MOST_PARTICLES = 2**31 - 1


def box(
    lower: Sequence[float],
    upper: Sequence[float],
    spacing: float,
    *,
    filling: Filling = Lattice(),
    jitter: float = 0.0,
    seed: int = 0,
) -> tuple[np.ndarray, float]:
    """Particles in equal cells that fill a box exactly; on the default lattice one at the centre of each.

    The spacing is adjusted along each axis, so that a whole number of cells divides the length.

    Args:
        lower: lower corner [m], (dim,).
        upper: upper corner [m], (dim,).
        spacing: wanted spacing [m], the dim-th root of a particle's volume.
        filling: Lattice(), BodyCentred() or Staggered().
        jitter: largest random displacement along each axis over the spacing there, in [0, 0.5).
        seed: of the jitter.

    Returns:
        Positions [m], (n, dim), on a lattice the last axis fastest, and the volume of one particle [m^dim].

    Raises:
        ValueError: corners of unequal or wrong length, a spacing that leaves an axis without a cell or asks for more
            particles than can be numbered, or a jitter out of range.
        MemoryError: more particles than there is memory for.
    """
    if not 0.0 <= jitter < 0.5:
        raise ValueError(f"jitter must be in [0, 0.5) spacings, got {jitter}; 0.1 is irregular already")
    places, lengths = filling.cell(np.size(lower) if np.size(lower) in (1, 2, 3) else 1)
    low, step, cells = _cells(lower, upper, spacing, lengths, len(places))
    centres = (_grid([np.arange(n) for n in cells])[:, None, :] + places).reshape(-1, len(cells))
    if jitter > 0.0:
        shift = np.random.default_rng(seed).uniform(-jitter, jitter, centres.shape)
        centres = centres + shift / lengths
    return low + centres * step, float(np.prod(step)) / len(places)


def nodes(lower: Sequence[float], upper: Sequence[float], spacing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Particles at the corners of equal cells that fill a box exactly: the outermost lie on its surface.

    Volumes are those of the cells' shares, half at faces, a quarter at edges. The surface vectors satisfy the
    divergence theorem with these positions, Σ s_a = 0 and Σ x_a ⊗ s_a = V I, so that M10 and M11 act on the true
    surface (see ``Body.surface``).

    Args:
        lower: lower corner [m], (dim,).
        upper: upper corner [m], (dim,).
        spacing: wanted spacing [m], adjusted as in ``box``.

    Returns:
        Positions [m], (n, dim), the last axis fastest; volumes [m^dim], (n,); outward area vectors [m^(dim−1)],
        (n, dim).

    Raises:
        ValueError: as ``box``.
    """
    low, step, cells = _cells(lower, upper, spacing)
    ranks = _grid([np.arange(n + 1) for n in cells])
    outward = (ranks == cells).astype(float) - (ranks == 0).astype(float)
    shares = step * np.where(outward == 0.0, 1.0, 0.5)
    volume = shares.prod(axis=1)
    return low + ranks * step, volume, outward * (volume[:, None] / shares)


def _cells(
    lower: Sequence[float], upper: Sequence[float], spacing: float, lengths: np.ndarray | float = 1.0, each: int = 1
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lower corner [m], cell lengths [m] and number of cells along each axis.

    ``lengths`` are those of a cell over the spacing, ``each`` the particles in it.
    """
    low, high = np.array(lower, dtype=float, ndmin=1), np.array(upper, dtype=float, ndmin=1)
    if low.shape != high.shape or low.ndim != 1 or low.size not in (1, 2, 3):
        raise ValueError(f"lower and upper must both have 1, 2 or 3 components, got {lower} and {upper}")
    if not (np.isfinite(real_number(spacing, "spacing")) and spacing > 0.0):
        raise ValueError(f"spacing must be positive and finite, got {spacing} m")
    length = high - low
    cells = np.rint(length / (spacing * lengths))
    if not np.isfinite(length).all() or (cells < 1).any():
        axis = int(np.argmin(np.where(np.isfinite(cells), cells, -1)))
        raise ValueError(
            f"every axis must hold at least one cell, got length {length[axis]:.6g} m along axis {axis} at spacing "
            f"{spacing:.6g} m; order the corners or refine"
        )
    if not cells.prod() * each <= MOST_PARTICLES:
        raise ValueError(
            f"a body must have at most {MOST_PARTICLES} particles, got {cells.prod() * each:.3g} at spacing "
            f"{spacing:.6g} m; increase it"
        )
    check_room(float((cells + 1).prod() * each), 5.0 * low.size, "a box")  # ranks, centres, places, and what is kept
    return low, length / cells, cells.astype(int)


def _grid(axes: list[np.ndarray]) -> np.ndarray:
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
