"""The tie of positions to deformation gradients (M16): a penalty on what no corrected gradient sees."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Tie:
    """Pair energy ¼ Σ_a Σ_b χ Ē V_a w_ab |r_ab|², r_ab = ξ_ab − ½(F_a + F_b) ξ⁰_ab, its adjoint in the stress (M16).

    Positions may run away from F in modes that a gradient averages out (hourglass modes), and irregular arrangements
    push particles about in them. r vanishes for linear fields, and for quadratic ones as far as F is exact there.
    Both momenta and energy are exact; what is stored in the tie comes back (``energy()["tied"]``).

    It acts where the arrangement does not move, whose initial positions are the labels ξ⁰. Where matter yields χ Ē goes
    with the secant of its law (``Law.secant``), as the root of the product of both ends'; what the tie loses by that is
    the material's.

    Args:
        stiffness: χ, over Ē, the modulus of pressure waves M or 4μ, whichever is less: M where Poisson's ratio is ⅓.
            Beyond that volume would resist what the tie is to hold, and coarse bodies lock. At 1 it raises the highest
            frequency of a body, and so the cost of a run, by less than a tenth (``tests/test_tie.py``); stiffer ties
            make coarse bodies stiffer, and their F worse near edges (docs/method.md, §7).
    """

    stiffness: float = 0.5

    def __post_init__(self) -> None:
        if not (math.isfinite(self.stiffness) and 0.0 < self.stiffness <= 1.0):
            raise ValueError(
                f"tie stiffness must be in (0, 1], got {self.stiffness}; 0.5 is the tested value, tie=None has none"
            )

    def modulus(self, M: float, mu: float, dim: int) -> float:
        """χ Ē [Pa] of a material with the moduli M and μ of pressure and shear waves [Pa]."""
        return self.stiffness * (min(M, 4.0 * mu) if dim > 1 else M)
