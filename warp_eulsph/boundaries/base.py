"""What a boundary condition declares, and how regions select particles."""

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..checks import real_array
from ..order import Order
from ..space import Space
from ..structs import ClockArrays, ForceArrays, ParticleArrays, StateArrays

#: A predicate of initial positions (n, dim) -> (n,) bool, a boolean mask (n,), or an array of indices; rows of values
#: are for the particles in its order.
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
    device: wp.Device
    X: np.ndarray
    particles: ParticleArrays
    bodies: dict[str, range]
    order: Order
    surface_given: bool = False

    def select(self, region: Region | None, body: str | None, who: str) -> np.ndarray:
        """Indices of the region's particles, each once, (k,) int32: as given, ascending for masks and functions.

        Raises:
            ValueError: unknown body, wrong shape, indices out of range, or nothing selected.
        """
        n = len(self.X)
        if body is not None and body not in self.bodies:
            raise ValueError(f"{who}: body must be one of {sorted(self.bodies)}, got {body!r}")
        if region is None:
            chosen = np.arange(n)
        elif callable(region):
            check_takes(region, 1, f"{who}: region", "lambda X: X[:, 0] < 0.1")
            try:
                given = region(read_only(self.X))
            except Exception as error:
                error.add_note(f"{who}: in the function of its region, for positions of shape {self.X.shape}")
                raise
            chosen = np.flatnonzero(_mask(given, self.X, who))
        else:
            chosen = _indices(region, n, who)
        if body is not None:
            of_body = self.bodies[body]
            chosen = chosen[(chosen >= of_body.start) & (chosen < of_body.stop)]
        if chosen.size == 0:
            low, high = self.X.min(axis=0), self.X.max(axis=0)
            raise ValueError(
                f"{who}: the region selects no particle; positions lie in {low} to {high} m, "
                f"bodies are {sorted(self.bodies)}"
            )
        return chosen.astype(np.int32)


def rows_of(indices: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Where ``numbers``, (k,), stand among ``indices``, which hold all of them in any order: (k,)."""
    order = np.argsort(indices)
    rows: np.ndarray = order[np.searchsorted(indices, numbers, sorter=order)]
    return rows


def check_takes(function: Any, count: int, who: str, example: str) -> None:
    """ValueError unless a user's ``function`` takes so many arguments; where Python cannot tell it passes."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return
    try:
        signature.bind(*range(count))
    except TypeError:
        raise ValueError(
            f"{who} must be a function of {count} argument{'s'[: count > 1]} such as {example}, got one of {signature}"
        ) from None


def read_only(values: np.ndarray) -> np.ndarray:
    """A copy for a user's function, which can change neither it nor what it was made of."""
    copy = np.array(values)
    copy.setflags(write=False)
    return copy


def _mask(given: Any, X: np.ndarray, who: str) -> np.ndarray:
    """What a predicate said of positions X, (n,) bool."""
    mask = np.asarray(given)
    if mask.shape != (len(X),) or mask.dtype != bool or isinstance(given, np.ma.MaskedArray):
        raise ValueError(
            f"{who}: a region predicate must return ({len(X)},) bool for positions of shape {X.shape}, "
            f"got {mask.shape} {mask.dtype}; write for example lambda X: X[:, 0] < 0.1"
        )
    return mask


def _indices(given: Any, n: int, who: str) -> np.ndarray:
    """Indices as given, each once where it came first; those of a mask."""
    indices = np.asarray(given)
    if isinstance(given, np.ma.MaskedArray):
        raise ValueError(f"{who}: a region must not be a masked array, whose masked entries would count")
    if indices.dtype == bool:
        if indices.shape != (n,):
            raise ValueError(f"{who}: a region mask must have shape ({n},), got {indices.shape}")
        return np.flatnonzero(indices)
    if indices.size and (not np.issubdtype(indices.dtype, np.integer) or indices.min() < 0 or indices.max() >= n):
        raise ValueError(f"{who}: region indices must be integers in [0, {n}), got {indices}")
    if indices.ndim != 1:
        raise ValueError(f"{who}: region indices must have shape (k,), got {indices.shape}")
    _, first = np.unique(indices, return_index=True)
    if n == len(indices) > len(first) and indices.max() <= 1:
        raise ValueError(f"{who}: a region mask must be of type bool, got {n} integers 0 and 1; use .astype(bool)")
    return indices[np.sort(first)]


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
        recordable: whether ``impose``, ``load`` and ``limit`` launch kernels and nothing else, so that a graph can
            repeat them.
        sortable: whether particles may be sorted in memory: it finds them by arrays of ``Assembly.order.places_of``,
            what it holds for all of them comes from ``Assembly.order.carry``, the rest goes by ``indices``.
        independent: whether it can do with bodies that are runs of their own: it takes time and step of particle a from
            ``clock.t`` and ``clock.dt`` at ``clock.run[a]``, asks for steps there, and sums nothing over several runs.
        steady: whether ``impose`` sets velocities only, by a rule that is the same at all times and places, and linear:
            of two velocities that obey it the mean does too. Then a step takes one velocity gradient instead of two.
    """

    indices: np.ndarray
    recordable: bool = False
    sortable: bool = False
    independent: bool = False
    steady: bool = False

    @property
    def loads(self) -> bool:
        """Whether ``load`` adds forces."""
        return type(self).load is not Bound.load

    @property
    def damps(self) -> bool:
        """Whether ``damp`` adds forces."""
        return type(self).damp is not Bound.damp

    @property
    def reads_surface(self) -> bool:
        """Whether ``load`` reads ``state.surface``; where the reference is fixed they move for those that do."""
        return self.loads

    @property
    def limits(self) -> bool:
        """Whether ``limit`` asks for a shorter step."""
        return type(self).limit is not Bound.limit

    def start(self, state: StateArrays) -> None:
        """Prepare from the initial state, surface vectors included; called once."""

    def impose(self, state: StateArrays, clock: ClockArrays, fraction: float) -> None:
        """Change velocities ``state.v`` (of ghosts also ``F`` and ``x``) to their values at time t + fraction · Δt."""

    def load(self, state: StateArrays, clock: ClockArrays, fraction: float, external: wp.array) -> None:
        """Add forces [N] at time t + fraction · Δt to ``external``."""

    def damp(self, state: StateArrays, clock: ClockArrays, forces: ForceArrays) -> None:
        """Add forces [N] that damp motion to both ``forces.external`` and ``forces.damping``; comes after ``load``."""

    def reflect(self, values: wp.array) -> None:
        """Give ghosts the values of what they copy, (n,) of reals; other conditions have none."""

    def limit(self, state: StateArrays, clock: ClockArrays) -> None:
        """Ask for a shorter step, before it is chosen, for what ``load`` may do in it.

        Raise ``clock.frequency[0]``, where it is ``independent`` that at ``clock.run[a]``, to the highest angular
        frequency [1/s] of a particle under these forces alone: √(k/m) for a stiffness k [N/m], a damper's rate c/m. It
        counts whether they act now or begin to in the step.
        """

    def evolving(self) -> dict[str, wp.array]:
        """Arrays by name that a step reads before it writes them: what a checkpoint must hold of the condition."""
        return {}


def unit_vector(given: Sequence[float], dim: int, who: str) -> np.ndarray:
    """``given`` at length one, (dim,).

    Raises:
        ValueError: wrong shape, zero or not finite.
    """
    vector = real_array(given, f"{who}: normal", finite=False)
    if vector.shape != (dim,) or not np.isfinite(vector).all() or not np.linalg.norm(vector) > 0.0:
        raise ValueError(f"{who}: normal must be ({dim},) finite numbers, not all zero, got {given}")
    return vector / np.linalg.norm(vector)
