"""Dimension and precision: the types every kernel is built from."""

import functools
from dataclasses import dataclass

import numpy as np
import warp as wp


@functools.cache
def vector_type(length: int, real: type) -> type:
    """Warp vector type of ``length`` components; cached, because Warp makes a new class per call."""
    return wp.types.vector(length=length, dtype=real)


@functools.cache
def matrix_type(rows: int, columns: int, real: type) -> type:
    """Warp matrix type; cached, because Warp makes a new class per call."""
    return wp.types.matrix(shape=(rows, columns), dtype=real)


@dataclass(frozen=True)
class Space:
    """Dimension, scalar type and periodicity; hashable, so that kernel factories are cached by it.

    Args:
        dim: 1 (uniaxial strain), 2 (plane strain) or 3.
        real: ``wp.float32`` or ``wp.float64``.
        periodic: whether differences of positions take the nearest image in the box.
    """

    dim: int
    real: type = wp.float64
    periodic: bool = False

    def __post_init__(self) -> None:
        if self.dim not in (1, 2, 3):
            raise ValueError(f"dimension must be 1, 2 or 3, got {self.dim}")
        if self.real not in (wp.float32, wp.float64):
            raise ValueError(f"real must be wp.float32 or wp.float64, got {self.real}")

    @property
    def vec(self) -> type:
        """Vector of ``dim`` reals."""
        return vector_type(self.dim, self.real)

    @property
    def mat(self) -> type:
        """Matrix of ``dim`` × ``dim`` reals."""
        return matrix_type(self.dim, self.dim, self.real)

    def row(self, components: int) -> type:
        """Row of ``components`` reals, the value of a field in an operator."""
        return vector_type(components, self.real)

    def row_gradient(self, components: int) -> type:
        """Gradient of a row: ``components`` × ``dim`` reals."""
        return matrix_type(components, self.dim, self.real)

    @property
    def numpy(self) -> type:
        """The numpy scalar type of ``real``."""
        return np.float32 if self.real is wp.float32 else np.float64


@functools.cache
def difference(space: Space) -> wp.Function:
    """``wp.func`` (to, from, box) -> to − from, nearest image where the box length is positive."""
    real, vec = space.real, space.vec

    if not space.periodic:

        @wp.func
        def difference(to: vec, start: vec, box: vec) -> vec:
            return to - start

        return difference

    dim = space.dim

    @wp.func
    def nearest_difference(to: vec, start: vec, box: vec) -> vec:
        d = to - start
        for i in range(wp.static(dim)):
            if box[i] > real(0.0):
                d[i] = d[i] - box[i] * wp.round(d[i] / box[i])
        return d

    return nearest_difference
