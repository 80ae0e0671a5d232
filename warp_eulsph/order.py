"""The order of particles in memory: neighbours in space should be neighbours there."""

import numpy as np


def spatial_order(x: np.ndarray, spacing: float) -> np.ndarray:
    """Indices that sort particles by cells of three spacings, row by row; (n,).

    Lattices come in such an order. Particles in another one, from a mesh or a random process, make steps several times
    slower: sort them, and all that is given for each, before they become a ``Body``::

        order = es.spatial_order(x, spacing)
        body = es.Body(x=x[order], volume=volume[order], ...)

    What was read from the simulation is put back by ``result[np.argsort(order)]``.

    Args:
        x: positions [m], (n, dim).
        spacing: about the distance of neighbours [m].

    Raises:
        ValueError: positions not (n, dim), or a spacing that is not positive.
    """
    x = np.asarray(x, dtype=float)
    if x.ndim != 2 or not np.isfinite(x).all():
        raise ValueError(f"x must be finite and have shape (n, dim), got {x.shape}")
    if not (np.isfinite(spacing) and spacing > 0.0):
        raise ValueError(f"spacing must be positive and finite, got {spacing}")
    cells = np.floor((x - x.min(axis=0)) / (3.0 * spacing)).astype(np.int64)
    return np.lexsort(cells.T[::-1])
