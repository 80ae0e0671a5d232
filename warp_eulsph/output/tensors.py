"""Tensors of plane and uniaxial strain in three dimensions."""

import numpy as np


def padded(tensors: np.ndarray, diagonal: float) -> np.ndarray:
    """Tensors (n, dim, dim) as (n, 3, 3), with ``diagonal`` on the missing part of the diagonal."""
    n, dim = tensors.shape[:2]
    full = np.zeros((n, 3, 3), dtype=tensors.dtype)
    full[:, range(dim, 3), range(dim, 3)] = diagonal
    full[:, :dim, :dim] = tensors
    return full
