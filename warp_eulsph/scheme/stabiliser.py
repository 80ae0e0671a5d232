"""What keeps the sums of a reference stable: dissipation, and the correction of what the arrangement gets wrong."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import warp as wp

from ..space import Space
from ..structs import ClockArrays, FluxArrays, ForceArrays, ParticleArrays, StateArrays
from .flux import Flux
from .potentials import Potentials
from .reference import Configuration


class Correction(ABC):
    """What makes arrangements stable that move with the reference: options; ``build`` makes the part that acts."""

    #: It closes sums body by body, and so cannot do with bodies that are bonded to each other.
    per_body: ClassVar[bool] = False
    #: Its stabiliser has potentials ``psi``, (n,) of vec, that shifting (M15) follows.
    has_potentials: ClassVar[bool] = False

    def check_bonds(self, groups: Sequence[int]) -> None:
        """Raise ValueError where bodies are bonded, of these numbers each, and it closes sums body by body."""
        if self.per_body and len(set(groups)) < len(groups):
            raise ValueError(f"correction={self} takes each body by itself and is not for bonded ones; use Balance()")

    @abstractmethod
    def build(self, space: Space, particles: ParticleArrays, flux: Flux, device: wp.DeviceLike) -> "Stabiliser":
        """Allocate for the bodies of ``flux``."""


@dataclass(frozen=True)
class Sums:
    """What the forces on a medium are summed from, and where they go.

    Attributes:
        configuration: its reference k.
        flux: stress and impedances.
        grad_v: ∇_k v [1/s] (M4) by which M9 reconstructs, (n,) of mat.
        forces: written.
        epsilon: share of the upwind flux (M9), 0 where nothing dissipates.
        sensor: (n,) of vec in [0, 1] that switches M9 to first order; None without.
        p: pressure in the reference, (n,) of one real, and grad_p: ∇_k p (M4), written too; None where nobody asks
            (``Stabiliser.sums_pressure``).
    """

    configuration: Configuration
    flux: FluxArrays
    grad_v: wp.array
    forces: ForceArrays
    epsilon: float = 0.0
    sensor: wp.array | None = None
    p: wp.array | None = None
    grad_p: wp.array | None = None


class Stabiliser(ABC):
    """The stabilising forces at work on one set of particles."""

    #: Whether ``compute`` writes ``forces.correction``, which is zero otherwise and takes no memory.
    corrects: ClassVar[bool] = True
    #: Whether gradients join balanced positions (M13), and not those of the particles.
    balances: ClassVar[bool] = False
    #: Whether walls take part in the sums (M28).
    takes_walls: ClassVar[bool] = False
    #: Of corrections that have them (``Correction.has_potentials``).
    potentials: Potentials
    #: κ of each particle, (n,), where walls take part (M27).
    kappa: wp.array

    @abstractmethod
    def refresh(self, configuration: Configuration, state: StateArrays) -> None:
        """Prepare for a new reference."""

    def takes_dual(self, configuration: Configuration, sensed: bool) -> bool:
        """Whether ``compute``, with a sensor or without, takes Π from the array of the flux (M5)."""
        return True

    def sums_pressure(self, configuration: Configuration, sensed: bool) -> bool:
        """Whether ``compute`` can sum ∇_k p with the forces, for M24."""
        return False

    def exact(self, gradient: wp.array) -> wp.array:
        """Gradients that are exact for linear fields from those of the reference, by which M9 and M24 reconstruct."""
        return gradient

    def moving(self, gradient: wp.array) -> wp.array:
        """The gradient by which F moves, from that of the reference."""
        return gradient

    def turn(self, sums: Sums, clock: ClockArrays, fraction: float) -> None:
        """Make Q what M5 is to take: turned with the material, to where it is after ``fraction`` · Δt, where gradients
        are not exact, by which it has turned.
        """
        return

    def evolving(self) -> dict[str, wp.array]:
        """Arrays by name that live from step to step: what a checkpoint must hold."""
        return {}

    @abstractmethod
    def compute(self, sums: Sums, x: wp.array, v: wp.array) -> None:
        """Internal force (M5), dissipation (M9, at x and v) and correction [N], into ``sums.forces``."""
