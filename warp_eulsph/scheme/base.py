"""What a scheme declares: the options that schemes share, and the stepper that they build."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

from .dissipation import Upwind
from .limiter import FluxCorrectedTransport
from .sharpening import Sharpening
from .shifting import Shifting
from .smoothing import Smoothing
from .stabiliser import Correction
from .tie import Tie
from .tilt import Tilt

if TYPE_CHECKING:
    from .stepper import Stepper
    from .world import Parts


class Scheme(ABC):
    """How a state advances in time, and by what it is kept stable: options; ``build`` makes the part that acts.

    A new scheme is one file: this declaration, a frozen dataclass, and its ``Stepper``. Options that it does not offer
    are None.
    """

    smoothing: Smoothing | None = None
    dissipation: Upwind | None = None
    correction: Correction | None = None
    limiter: FluxCorrectedTransport | None = None
    shifting: Shifting | None = None
    tie: Tie | None = None
    tilt: Tilt | None = None
    sharpening: Sharpening | None = None
    #: Tested Courant number.
    cfl: ClassVar[float]

    def __post_init__(self) -> None:
        if self.shifting is not None and not (self.correction is not None and self.correction.has_potentials):
            raise ValueError(
                "shifting needs correction=Balance() or Uncorrected(), whose potentials it follows, got "
                f"{self.correction}"
            )

    @abstractmethod
    def build(self, parts: "Parts") -> "Stepper":
        """The scheme at work."""
