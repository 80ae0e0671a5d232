"""What output asks of a run: protocols that ``Simulation`` and ``Transport`` fulfil, so that it knows neither."""

import math
from collections.abc import Mapping
from typing import Any, Protocol, TypeGuard

import numpy as np
import warp as wp

from ..body import Body
from ..boundaries import Bound, Boundary
from ..building import Given
from ..diagnostics import Diagnostics
from ..interactions import BoundInteraction, Interaction
from ..order import Order
from ..runs import Runs
from ..scheme.arrangement import Arrangement
from ..scheme.policy import ReferencePolicy
from ..scheme.reference import Configuration
from ..scheme.stepper import Stepper
from ..scheme.time_step import DeviceClock
from ..sorting import Sorting
from ..space import Space
from ..structs import ParticleArrays
from ..whole import Whole


class Recorded(Protocol):
    """A run that can be recorded, resumed and shown.

    Attributes:
        ranges: places of the particles of each body.
        whole: guards its steps.
        output: who keeps frames, set while it does.
    """

    space: Space
    device: wp.Device
    particles: ParticleArrays
    ranges: dict[str, range]
    order: Order
    whole: Whole
    output: Any

    @property
    def configuration(self) -> Configuration:
        """The configuration in which weights live now."""

    @property
    def X(self) -> np.ndarray:
        """Initial positions [m], (n, dim)."""

    @property
    def t(self) -> float:
        """Time [s]."""

    @property
    def dt(self) -> float:
        """Last time step [s]."""

    @property
    def steps(self) -> int:
        """Steps taken."""

    @property
    def counters(self) -> dict[str, float]:
        """The numbers beside the arrays that evolve."""

    def evolving(self) -> dict[str, wp.array]:
        """Every array that a step reads before it writes it, by name."""

    def restore(self, arrays: Mapping[str, np.ndarray], counters: Mapping[str, float]) -> None:
        """Take over what ``evolving`` and ``counters`` were."""

    def advance(self, until: float, most: int | None = None, look: float = math.inf) -> None:
        """Take a few steps towards ``until`` [s], not beyond the one that reaches ``look`` [s]."""


class RecordedSolids(Recorded, Protocol):
    """Bodies that deform under conditions."""

    stepper: Stepper
    clock: DeviceClock
    diagnostics: Diagnostics
    sorting: Sorting
    runs: Runs
    bodies: list[Body]
    boundaries: tuple[Boundary, ...]
    conditions: list[Bound]
    interactions: tuple[Interaction, ...]
    bound_interactions: list[BoundInteraction]
    options: Given
    reference: ReferencePolicy
    arrangement: Arrangement
    dilation: float

    def energy(self) -> dict[str, float]:
        """Energies [J], by account."""

    def history(self, name: str) -> np.ndarray:
        """What materials remember under this name, by number, (n,) or (n, 3, 3)."""

    @property
    def interaction_force(self) -> np.ndarray:
        """Forces of the interactions on the particles in the last step [N], (n, dim)."""

    def momentum(self) -> np.ndarray:
        """[kg m/s], (dim,)."""

    def angular_momentum(self) -> np.ndarray:
        """About the origin [kg m²/s]."""

    def extrema(self) -> dict[str, float]:
        """Least and largest of what tells how a run goes."""

    def reaction(self, boundary: Boundary) -> np.ndarray:
        """Force [N] of a condition on its particles, (dim,)."""


class RecordedTransport(Recorded, Protocol):
    """A quantity carried along on particles that stay where they are; ``exact`` is None where it is not known."""

    law: Any
    time_step: float
    exact: Any

    @property
    def x(self) -> np.ndarray:
        """Positions [m], (n, dim)."""

    def amounts(self) -> dict[str, float]:
        """Amount, least and largest value."""


def solids(run: Recorded) -> TypeGuard[RecordedSolids]:
    """Whether a run is one of bodies that deform."""
    return hasattr(run, "stepper")


def transport(run: Recorded) -> TypeGuard[RecordedTransport]:
    """Whether a run is one of a quantity that is carried along."""
    return hasattr(run, "law")
