"""Any shape that knows how deep a point lies in it: filled with a lattice cut to it, and relaxed if asked."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..checks import real_number
from .filling import Filling
from .lattice import box
from .relaxation import Relaxation

# A point within this share of a spacing of the surface counts as outside, whatever its last bits say.
ON_SURFACE = 1e-6
# Particles that hold so much more or less than spacing^dim each: the shape is not resolved.
COARSE = 1.5


@dataclass(frozen=True)
class Solid:
    """A shape.

    Args:
        lower: lower corner of a box around it [m], (dim,).
        upper: upper corner [m], (dim,).
        volume: of the shape [m^dim]; None takes that of the particles of the filling that lie in it.
        depth: positions [m], (k, dim) -> distance to the surface [m], positive inside, (k,), and the unit vectors
            along which it grows, (k, dim); at edges those of one of the faces.
        beneath: the same for positions that lie inside, where it is faster to know that; ``depth`` otherwise.
    """

    lower: np.ndarray
    upper: np.ndarray
    volume: float | None
    depth: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    beneath: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]] | None = None

    def fill(
        self, spacing: float, filling: Filling, relaxation: Relaxation | None, who: str
    ) -> tuple[np.ndarray, np.ndarray]:
        """Positions [m], (n, dim), of the particles of a filled box that lie inside, and equal volumes [m^dim], (n,).

        The volumes sum to that of the shape; ``who`` is named in errors.

        Raises:
            ValueError: a spacing that is not positive, or too coarse for the shape.
        """
        if not (np.isfinite(real_number(spacing, f"{who}: spacing")) and spacing > 0.0):
            raise ValueError(f"{who}: spacing must be positive and finite, got {spacing} m")
        x, cell = box(self.lower.tolist(), self.upper.tolist(), spacing, filling=filling)
        x = x[self.depth(x)[0] > ON_SURFACE * spacing]
        volume = len(x) * cell if self.volume is None else self.volume
        share = volume / max(len(x), 1) / spacing ** x.shape[1]
        if len(x) == 0 or not 1.0 / COARSE < share < COARSE:
            raise ValueError(
                f"{who}: a spacing of {spacing:.6g} m is too coarse, {len(x)} particles would have to hold "
                f"{'what is inside' if self.volume is None else f'{volume:.6g} m^{x.shape[1]}'}; use at least two "
                "spacings across the thinnest part"
            )
        if relaxation is not None:
            x = relaxation.relax(x, volume / len(x), self.depth, self.beneath or self.depth)
        return x, np.full(len(x), volume / len(x))
