"""What keeps the sums of a reference stable: dissipation, and the correction of what the arrangement gets wrong."""

from abc import ABC, abstractmethod
from typing import ClassVar

import warp as wp

from ..space import Space
from ..structs import FluxArrays, ForceArrays, ParticleArrays, StateArrays
from .flux import Flux
from .reference import Configuration


class Correction(ABC):
    """What makes arrangements stable that move with the reference: options; ``build`` makes the part that acts."""

    #: It closes sums body by body, and so cannot do with bodies that are bonded to each other.
    per_body: ClassVar[bool] = False
    #: Its stabiliser has potentials ``psi``, (n,) of vec, that shifting (M15) follows.
    has_potentials: ClassVar[bool] = False

    @abstractmethod
    def build(self, space: Space, particles: ParticleArrays, flux: Flux, device: wp.DeviceLike) -> "Stabiliser":
        """Allocate for the bodies of ``flux``."""


class Stabiliser(ABC):
    """The stabilising forces at work on one set of particles."""

    #: Whether ``compute`` writes ``forces.correction``, which is zero otherwise and takes no memory.
    corrects: ClassVar[bool] = True
    #: Potentials [m], (n,) of vec, of corrections that have them.
    psi: wp.array

    @abstractmethod
    def refresh(self, configuration: Configuration, state: StateArrays) -> None:
        """Prepare for a new reference."""

    def takes_dual(self, configuration: Configuration, sensed: bool) -> bool:
        """Whether ``compute``, with a sensor or without, takes Π from the array of the flux (M5)."""
        return True

    def evolving(self) -> dict[str, wp.array]:
        """Arrays by name that live from step to step: what a checkpoint must hold."""
        return {}

    @abstractmethod
    def compute(
        self,
        configuration: Configuration,
        flux: FluxArrays,
        x: wp.array,
        v: wp.array,
        grad_v: wp.array,
        epsilon: float,
        sensor: wp.array | None,
        forces: ForceArrays,
    ) -> None:
        """Internal force (M5), dissipation (M9, ε, switched by ``sensor``, at x and v) and correction [N]."""
