"""What an interaction declares: forces between bodies, or between bodies and something that moves beside them."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from ..boundaries import Assembly
from ..structs import StateArrays

if TYPE_CHECKING:
    from ..scheme.world import World


class Interaction(ABC):
    """An interaction as the user states it; ``bind`` makes the part that acts.

    A new interaction is one file: this declaration, a frozen dataclass, and its ``BoundInteraction``.
    """

    @abstractmethod
    def bind(self, assembly: Assembly) -> "BoundInteraction":
        """Select particles and allocate."""


class BoundInteraction(ABC):
    """An interaction at work; override what it does.

    What it does to kinetic and stored energy and to its own is in its account of the ledger: nothing where its forces
    are those of its energy, but for the error of the steps; less than nothing where it dissipates.

    Attributes:
        indices: numbers of the particles it acts on, (k,) int32.
        recordable: whether all that it does in a step is to launch kernels, so that a graph can repeat it.
        sortable: whether particles may be sorted in memory, as in ``Bound``.
        touching: names of each two bodies that it keeps apart; of others that meet users are told.
    """

    indices: np.ndarray
    touching: frozenset[tuple[str, str]] = frozenset()
    recordable: bool = False
    sortable: bool = False

    def start(self, world: "World") -> None:  # noqa: B027  (most need no more than bind knows)
        """Prepare from the initial state, when references and surface vectors are there; called once."""

    def rebuild(self, world: "World") -> None:  # noqa: B027
        """Derive what the evolving arrays determine, after they were overwritten or particles changed places."""

    def prepare(self, world: "World") -> None:  # noqa: B027  (most need nothing of the host)
        """Do what takes the host, such as a search, before a step and on its references; may read and allocate."""

    def check(self, world: "World", running: wp.array) -> None:  # noqa: B027
        """Set ``running`` to 0, if it is 1, where ``prepare`` has something to do; launches only.

        In recorded steps it takes the place of ``prepare``, which the host then calls before it takes the step.
        """

    @property
    def waiting(self) -> bool:
        """Whether ``check`` set ``running`` to 0 since the last ``prepare``; reads the device."""
        return False

    def recorded_for(self) -> Sequence[object]:
        """Objects that the launches of a step are of, which ``prepare`` may replace: steps are then recorded anew."""
        return ()

    @abstractmethod
    def forces(self, world: "World", state: StateArrays, fraction: float, out: wp.array) -> None:
        """Add forces [N] at ``state``, at time t + fraction · Δt, to ``out``, (n,) of vec by place.

        Called once or twice a step; the last call is that of the full step. Pair forces keep momentum to round-off if
        each particle sums its own and both ends find the same number.
        """

    def rate(self, world: "World") -> None:  # noqa: B027  (soft forces ask for nothing)
        """Ask for a shorter step, before it is chosen, as ``Bound.limit`` does by ``world.clock.fields.frequency``.

        A pair of stiffness k has √(k/m_a + k/m_b) [1/s].
        """

    @property
    def limits(self) -> bool:
        """Whether ``rate`` asks for a shorter step."""
        return type(self).rate is not BoundInteraction.rate

    def advance(self, world: "World") -> None:  # noqa: B027  (most have nothing of their own)
        """Move what it has of its own by the step, once the bodies are where they end, at time t + Δt.

        A rigid body moves by the force that it noted in the last ``forces``, friction keeps what slipped.
        """

    def energy(self, world: "World") -> float:
        """Energy [J] that it holds at ``world.U``, kinetic energy of its own included; reads the device."""
        return 0.0

    def passed(self) -> float:
        """Energy [J] that it put into what bodies store since the start, beside its work; reads the device."""
        return 0.0

    def supplied(self) -> float:
        """Energy [J] put in from outside since the start, by a drive or weight of its own; reads the device.

        It is in the account ``external`` of the ledger.
        """
        return 0.0

    def evolving(self) -> dict[str, wp.array]:
        """Arrays by name that a step reads before it writes them: what a checkpoint must hold of it."""
        return {}
