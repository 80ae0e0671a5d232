"""Linear bar in uniaxial stress."""

import functools
from dataclasses import dataclass
from typing import ClassVar

import warp as wp

from ..space import Space
from .base import Law, Material, positive


@dataclass(frozen=True, kw_only=True)
class Bar(Material):
    """P = E (F − 1), in 1-D only: a bar that is free to contract sideways, c = √(E/ρ0).

    Args:
        density: initial density [kg/m³].
        young: Young's modulus [Pa].
    """

    young: float
    linear: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("young", self.young, "Pa")

    def constants(self) -> dict[str, float]:
        return {"young": self.young}

    def law(self, space: Space) -> Law:
        """Point functions in 1-D.

        Raises:
            ValueError: 2-D or 3-D.
        """
        if space.dim != 1:
            raise ValueError(f"Bar is a law of dimension 1, got dimension {space.dim}; take LinearElastic there")
        return _law(space)


@functools.cache
def _law(space: Space) -> Law:
    real, mat, pair = space.real, space.mat, space.row(2)

    @wp.struct
    class Constants:
        young: real

    @wp.func
    def stress(F: mat, c: Constants) -> mat:
        return mat(c.young * (F[0, 0] - real(1.0)))

    @wp.func
    def energy(F: mat, c: Constants) -> real:
        e = F[0, 0] - real(1.0)
        return real(0.5) * c.young * e * e

    @wp.func
    def wave_moduli(F: mat, c: Constants) -> pair:
        return pair(c.young * F[0, 0] * F[0, 0], real(0.0))

    return Law(Constants, stress, energy, wave_moduli)
