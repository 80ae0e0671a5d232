"""Tensors of plane and uniaxial strain in three dimensions."""

import numpy as np


def padded(tensors: np.ndarray, diagonal: float) -> np.ndarray:
    """Tensors (n, dim, dim) as (n, 3, 3), with ``diagonal`` on the missing part of the diagonal."""
    n, dim = tensors.shape[:2]
    full = np.zeros((n, 3, 3), dtype=tensors.dtype)
    full[:, range(dim, 3), range(dim, 3)] = diagonal
    full[:, :dim, :dim] = tensors
    return full


def first_piola(stress: np.ndarray, F: np.ndarray) -> np.ndarray:
    """P = J σ F⁻ᵀ [Pa] of Cauchy stresses σ, (n, 3, 3), and F, (n, dim, dim), missing stretches 1: (n, 3, 3)."""
    full = padded(F, 1.0)
    P: np.ndarray = np.linalg.det(full)[:, None, None] * stress @ np.linalg.inv(full).transpose(0, 2, 1)
    return P
