"""What lies beside a liquid and takes part in its sums (M28)."""

from typing import Protocol

import warp as wp


class Wall(Protocol):
    """A wall of one medium; all that it does is to launch."""

    def renew(self) -> None:
        """Prepare for a new reference, whose L it changes."""

    def add_gradient(self, v: wp.array, share: float, out: wp.array) -> None:
        """Add a share of its part of ∇_k v [1/s], (n,) of mat, at velocities ``v`` [m/s], (n,) of vec."""


class Walls:
    """All walls of one medium."""

    def __init__(self) -> None:
        self._walls: list[Wall] = []

    def __bool__(self) -> bool:
        return bool(self._walls)

    def take(self, wall: Wall) -> None:
        """Have another one take part, from the present reference on."""
        self._walls.append(wall)
        wall.renew()

    def renew(self) -> None:
        """Prepare for a new reference."""
        for wall in self._walls:
            wall.renew()

    def add_gradient(self, v: wp.array, out: wp.array) -> None:
        """Add what all add to ∇_k v."""
        for wall in self._walls:
            wall.add_gradient(v, 1.0, out)

    def without(self, v: wp.array, gradient: wp.array, out: wp.array) -> wp.array:
        """∇_k v at ``v`` as if there were none: ``gradient``, or in ``out``."""
        if not self._walls:
            return gradient
        wp.copy(out, gradient)
        for wall in self._walls:
            wall.add_gradient(v, -1.0, out)
        return out
