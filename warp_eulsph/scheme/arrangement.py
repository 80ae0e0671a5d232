"""The arrangement: which bodies have neighbours and pair weights read anew from their positions at a refresh."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from ..materials import Material


class Arrangement(ABC):
    """Decides, material by material, whether a body's arrangement moves with the reference."""

    @abstractmethod
    def moves(self, material: Material) -> bool:
        """Whether a refresh reads a body of this material anew; otherwise its arrangement stays the initial one."""


@dataclass(frozen=True)
class Convected(Arrangement):
    """Where matter deforms, weights are convected with it; where it flows, they are read anew.

    A law that carries its whole F can undo whatever happens to it, and neighbours stay neighbours: weights that move
    with the material (Lagrangian kernels: Belytschko, Guo, Liu & Xiao 2000; Rabczuk, Belytschko & Xiao 2004) are those
    of the initial arrangement, whatever the policy of the reference, so that its runs are those of ``Never()``. A
    liquid keeps J alone and has new neighbours all the time: its arrangement is that of its positions.
    """

    def moves(self, material: Material) -> bool:
        return material.flows


@dataclass(frozen=True)
class Current(Arrangement):
    """Every body is read anew at each refresh (Eulerian kernels): the paper's form.

    In elastic solids it relaxes stress as soon as particles leave their places, and tears in tension (docs/method.md,
    §7); for comparisons, and for the paper's figures. That a solid comes apart, which no law of failure asked for, is
    logged as a warning, once.

    Args:
        stop_when_torn: raise UnstableError there instead.
    """

    stop_when_torn: bool = False

    def moves(self, material: Material) -> bool:
        return True
