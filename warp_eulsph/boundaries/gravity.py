"""Weight."""

import math
from dataclasses import dataclass

import numpy as np

from .base import Assembly, Boundary
from .body_force import BodyForce, BoundBodyForce


@dataclass(frozen=True)
class Gravity(Boundary):
    """Weight, downwards along the last axis: −y in 2-D, −z in 3-D; another direction by ``BodyForce``.

    Args:
        g: acceleration [m/s²].
        body: name of the body, all by default.

    Raises:
        ValueError: g not finite.
    """

    g: float = 9.81
    body: str | None = None

    def __post_init__(self) -> None:
        if not math.isfinite(self.g):
            raise ValueError(f"Gravity: g must be finite, got {self.g}; give it in m/s²")

    def bind(self, assembly: Assembly) -> BoundBodyForce:
        weight = np.zeros(assembly.space.dim)
        weight[-1] = -self.g
        return BodyForce(weight, body=self.body).bind(assembly)
