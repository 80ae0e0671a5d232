"""The one knob: when the reference is refreshed."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from numbers import Integral
from typing import ClassVar

import warp as wp

from .reference import Configuration


class ReferencePolicy(ABC):
    """When the reference is refreshed: k = 0 total Lagrangian … k = n Eulerian."""

    #: The initial configuration is the only reference there will be.
    fixed = False
    #: ``due`` can tell from the number of the step alone, many steps ahead.
    by_count: ClassVar[bool] = False

    @abstractmethod
    def due(self, step: int, configuration: Configuration, F: wp.array) -> bool:
        """Whether to refresh before step number ``step`` (0 is the first; the reference is fresh then)."""


@dataclass(frozen=True)
class Never(ReferencePolicy):
    """Total Lagrangian: the initial configuration stays the reference."""

    fixed = True
    by_count = True

    def due(self, step: int, configuration: Configuration, F: wp.array) -> bool:
        return False


@dataclass(frozen=True)
class Every(ReferencePolicy):
    """Updated Lagrangian: refresh every ``steps`` steps."""

    steps: int
    by_count: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if isinstance(self.steps, bool) or not isinstance(self.steps, Integral) or self.steps < 1:
            raise ValueError(
                f"steps between refreshes must be a whole number, at least 1, got {self.steps!r}; Never() is total "
                "Lagrangian"
            )

    def due(self, step: int, configuration: Configuration, F: wp.array) -> bool:
        return step % self.steps == 0


@dataclass(frozen=True)
class Always(ReferencePolicy):
    """Eulerian: every step starts from its own configuration."""

    by_count = True

    def due(self, step: int, configuration: Configuration, F: wp.array) -> bool:
        return True


@dataclass(frozen=True)
class WhenDistorted(ReferencePolicy):
    """Updated Lagrangian by criterion: refresh when a stretch since the last refresh leaves [1/ratio, ratio].

    The stretches are those of G = F F_k⁻¹; rotations do not count. Reads one number from the device each step.
    """

    ratio: float = 1.2

    def __post_init__(self) -> None:
        if not self.ratio > 1.0:
            raise ValueError(f"distortion ratio must be greater than 1, got {self.ratio}")

    def due(self, step: int, configuration: Configuration, F: wp.array) -> bool:
        return configuration.distortion(F) > self.ratio
