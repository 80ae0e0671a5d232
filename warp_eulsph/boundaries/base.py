"""What a boundary condition declares, and how regions select particles."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..order import Order
from ..space import Space

#: A predicate of initial positions (n, dim) -> (n,) bool, a boolean mask (n,), or an array of indices.
Region = Callable[[np.ndarray], np.ndarray] | np.ndarray | Sequence[int]


@dataclass(frozen=True)
class Assembly:
    """What a condition needs to know of the particles it acts on.

    Attributes:
        space: dimension and precision.
        device: Warp device.
        X: initial positions [m], (n, dim).
        particles: struct ``Particles``.
        bodies: name of a body -> its range of particle indices.
        order: gives arrays of places for indices, for particles move in memory (see ``Bound.sortable``).
        surface_given: the bodies came with their area vectors.
    """

    space: Space
    device: Any
    X: np.ndarray
    particles: Any
    bodies: dict[str, range]
    order: Order
    surface_given: bool = False

    def select(self, region: Region | None, body: str | None, who: str) -> np.ndarray:
        """Sorted indices of the region's particles, (k,) int32.

        Raises:
            ValueError: unknown body, wrong shape, indices out of range, or nothing selected.
        """
        n = len(self.X)
        if body is not None and body not in self.bodies:
            raise ValueError(f"{who}: body must be one of {sorted(self.bodies)}, got {body!r}")
        chosen = np.zeros(n, dtype=bool)
        if region is None:
            chosen[:] = True
        elif callable(region):
            mask = np.asarray(region(self.X))
            if mask.shape != (n,) or mask.dtype != bool:
                raise ValueError(
                    f"{who}: a region predicate must return ({n},) bool for positions of shape {self.X.shape}, "
                    f"got {mask.shape} {mask.dtype}; write for example lambda X: X[:, 0] < 0.1"
                )
            chosen |= mask
        else:
            indices = np.asarray(region)
            if indices.dtype == bool:
                if indices.shape != (n,):
                    raise ValueError(f"{who}: a region mask must have shape ({n},), got {indices.shape}")
            elif indices.size and (
                not np.issubdtype(indices.dtype, np.integer) or indices.min() < 0 or indices.max() >= n
            ):
                raise ValueError(f"{who}: region indices must be integers in [0, {n}), got {indices}")
            chosen[indices if indices.size else slice(0)] = True
        if body is not None:
            outside = np.ones(n, dtype=bool)
            outside[self.bodies[body]] = False
            chosen &= ~outside
        selected = np.flatnonzero(chosen).astype(np.int32)
        if selected.size == 0:
            low, high = self.X.min(axis=0), self.X.max(axis=0)
            raise ValueError(
                f"{who}: the region selects no particle; positions lie in {low} to {high} m, "
                f"bodies are {sorted(self.bodies)}"
            )
        return selected


class Boundary(ABC):
    """A condition as the user states it; ``bind`` makes the part that acts.

    A new condition is one file: this declaration and its ``Bound``.
    """

    @abstractmethod
    def bind(self, assembly: Assembly) -> "Bound":
        """Select particles and allocate."""


class Bound:
    """A condition at work; override what it does.

    Attributes:
        indices: numbers of the particles it acts on, (k,) int32.
        recordable: whether ``impose`` and ``load`` launch kernels and nothing else, so that a graph can repeat them.
        sortable: whether particles may be sorted in memory: it finds them by arrays of ``Assembly.order.places_of``,
            what it holds for all of them comes from ``Assembly.order.carry``, the rest goes by ``indices``.
    """

    indices: np.ndarray
    recordable: bool = False
    sortable: bool = False

    @property
    def loads(self) -> bool:
        """Whether ``load`` adds forces."""
        return type(self).load is not Bound.load

    @property
    def reads_surface(self) -> bool:
        """Whether ``load`` reads ``state.surface``; where the reference is fixed they move for those that do."""
        return self.loads

    def start(self, state: Any) -> None:
        """Prepare from the initial state, surface vectors included; called once."""

    def impose(self, state: Any, clock: Any, fraction: float) -> None:
        """Change velocities ``state.v`` (of ghosts also ``F`` and ``x``) to their values at time t + fraction · Δt."""

    def load(self, state: Any, clock: Any, fraction: float, external: wp.array) -> None:
        """Add forces [N] at time t + fraction · Δt to ``external``."""

    def evolving(self) -> dict[str, wp.array]:
        """Arrays by name that a step reads before it writes them: what a checkpoint must hold of the condition."""
        return {}


def unit_vector(given: Sequence[float], dim: int, who: str) -> np.ndarray:
    """``given`` at length one, (dim,).

    Raises:
        ValueError: wrong shape, zero or not finite.
    """
    vector = np.asarray(given, dtype=float)
    if vector.shape != (dim,) or not np.isfinite(vector).all() or not np.linalg.norm(vector) > 0.0:
        raise ValueError(f"{who}: normal must be ({dim},) finite numbers, not all zero, got {given}")
    return vector / np.linalg.norm(vector)
