"""What lies beside a liquid and takes part in its sums (M28)."""

from typing import Protocol

import warp as wp


class Wall(Protocol):
    """A wall of one medium; all that it does is to launch."""

    def renew(self) -> None:
        """Prepare for a new reference, whose L it changes."""

    def add_gradient(self, v: wp.array, out: wp.array) -> None:
        """Add its part of ∇_k v [1/s], (n,) of mat, at velocities ``v`` [m/s], (n,) of vec."""


class Walls:
    """All walls of one medium.

    Attributes:
        bare: the last ∇_k v [1/s] that they were added to, without them, (n,) of mat.
    """

    def __init__(self, gradient: type, n: int, device: wp.DeviceLike) -> None:
        self._walls: list[Wall] = []
        self._n, self._device = n, device
        self.bare = wp.zeros(0, dtype=gradient, device=device)

    def __bool__(self) -> bool:
        return bool(self._walls)

    def take(self, wall: Wall) -> None:
        """Have another one take part, from the present reference on."""
        if not self._walls:
            self.bare = wp.zeros(self._n, dtype=self.bare.dtype, device=self._device)
        self._walls.append(wall)
        wall.renew()

    def renew(self) -> None:
        """Prepare for a new reference."""
        for wall in self._walls:
            wall.renew()

    def add_gradient(self, v: wp.array, out: wp.array) -> None:
        """Add what all add to ∇_k v."""
        if self._walls:
            wp.copy(self.bare, out)
        for wall in self._walls:
            wall.add_gradient(v, out)

    def without(self, gradient: wp.array) -> wp.array:
        """The last of these ∇_k v, ``gradient``, as if there were none."""
        return self.bare if self._walls else gradient
