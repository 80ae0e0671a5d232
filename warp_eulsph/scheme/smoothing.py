"""The smoothing S of the half step, as an option."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import warp as wp

from ..execution import launch
from ..operators.smoothing import make_linear_exact
from ..operators.values import Shepard, Values
from ..space import Space
from .reference import Configuration


class Smoothing(ABC):
    """S of the Lax and Lax-Wendroff schemes; None instead of one is the identity."""

    #: ``apply`` uses the gradient of the field.
    needs_gradient: ClassVar[bool]
    #: F_k is smoothed too, S(F_k) in M8, as the paper prints it.
    smooths_reference: ClassVar[bool]

    @abstractmethod
    def apply(self, space: Space, configuration: Configuration, f: wp.array, gradient: wp.array, out: wp.array) -> None:
        """``out`` ← S(f) for rows ``f`` (n,) of c reals; ``gradient`` (n,) of c × dim."""


@dataclass(frozen=True)
class LinearExact(Smoothing):
    """Smoothing exact for linear fields on bounded bodies too (M7).

    Args:
        theta: share of the neighbours' mean, 0 (identity) to 1/2; 1 is unstable.
    """

    theta: float = 0.5
    needs_gradient = True
    smooths_reference = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.theta <= 1.0:
            raise ValueError(f"smoothing theta must be in [0, 1], got {self.theta}; 0.5 is the tested value")

    def apply(self, space: Space, configuration: Configuration, f: wp.array, gradient: wp.array, out: wp.array) -> None:
        components = wp.types.type_size(f.dtype)
        arguments = [configuration.particles, configuration.fields, configuration.near, self.theta, f, gradient, out]
        launch(make_linear_exact(space, components), len(f), arguments, f.device)


@dataclass(frozen=True)
class NeighbourAverage(Smoothing):
    """The paper's smoothing (§4.2): the corrected average over the neighbours alone (M6).

    Stable up to CFL 2 on periodic lattices; on bounded bodies it grows without strong dissipation (docs/method.md §3),
    so it is there to reproduce the paper.

    Args:
        values: Shepard(), exact for constants, or Linear(), exact for linear fields too.
    """

    values: Values = Shepard()
    needs_gradient = False
    smooths_reference = True

    def __post_init__(self) -> None:
        if not isinstance(self.values, Values):
            raise ValueError(f"values must be Shepard() or Linear(), got {self.values!r}")

    def apply(self, space: Space, configuration: Configuration, f: wp.array, gradient: wp.array, out: wp.array) -> None:
        configuration.interpolation(self.values).average(f, out)
