"""What a material declares."""

import functools
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import warp as wp

from ..linalg import reciprocal_cube_root
from ..space import Space


class Law(NamedTuple):
    """The point functions of a material in one space, all ``wp.func``.

    Attributes:
        Constants: ``wp.struct`` of scalars that the functions take.
        stress: (F, constants) -> P, first Piola–Kirchhoff stress [Pa].
        energy: (F, constants) -> Ψ, stored energy per initial volume [J/m^d].
        wave_moduli: (F, constants) -> (M, μ) [Pa]. M bounds ρ0 c² of all waves in all directions, c in the current
            configuration; μ bounds ρ0 c² of the shear waves along the principal directions. Both are exact at F = I.
        carry: what the material keeps of an F after a full step; None keeps all of it. (F, constants) -> F, or with a
            history (F, history, constants) -> (F, history). A fluid keeps det(F)^(1/d) I, because its F would grow
            without bound in shear; a plastic solid keeps its elastic part. Carrying twice must equal carrying once,
            because a step of length zero carries too.
        history: reals per particle that ``carry`` updates, zero at the start (a hardening variable, a largest stretch).

    The moduli are second derivatives of Ψ along F → (I + ε m⊗n) F, n the direction of the wave and m its
    polarisation: ρ0 c² m = Q(n) m with m·Q m = d²Ψ/dε² at ε = 0.
    """

    Constants: Any
    stress: Any
    energy: Any
    wave_moduli: Any
    carry: Any = None
    history: int = 0


@functools.cache
def largest_eigenvalue(real: type) -> Any:
    """``wp.func`` largest eigenvalue of [[A, B], [B, C]]; it grows with A, C and |B|, so bounds of them bound it."""

    @wp.func
    def largest_eigenvalue(A: real, B: real, C: real) -> real:
        half = real(0.5) * (A - C)
        return real(0.5) * (A + C) + wp.sqrt(half * half + B * B)

    return largest_eigenvalue


@functools.cache
def isochoric(real: type) -> Any:
    """``wp.func`` J^(−2/3), NaN unless J > 0."""
    root = reciprocal_cube_root(real)

    @wp.func
    def isochoric(J: real) -> real:
        return root(J) * root(J)

    return isochoric


@dataclass(frozen=True, kw_only=True)
class Material(ABC):
    """A constitutive law; frozen, so that it can key cached kernels.

    In 2-D plane strain and in 1-D uniaxial strain: the 3-D law with the missing stretches equal to one.

    A new material is one file: a subclass with its parameters, ``constants`` and ``law``.

    Args:
        density: initial density ρ0 [kg/m³].
    """

    density: float

    #: The carried F is not the whole deformation gradient: neighbours change for good, and so must the reference.
    flows: ClassVar[bool] = False
    #: P is linear in F − I: for small strains and rotations only, because a rotation then causes stress.
    linear: ClassVar[bool] = False

    def __post_init__(self) -> None:
        positive("density", self.density, "kg/m^3")

    @abstractmethod
    def constants(self) -> dict[str, float]:
        """Values of the fields of ``Law.Constants``."""

    @abstractmethod
    def law(self, space: Space) -> Law:
        """Point functions in this space, cached: the same objects for the same space."""


@dataclass(frozen=True, kw_only=True)
class Isotropic(Material):
    """A law with the two constants of isotropic linear elasticity at small strain.

    Args:
        density: initial density [kg/m³].
        young: Young's modulus [Pa].
        poisson: Poisson's ratio, in (−1, 0.5).
    """

    young: float
    poisson: float

    def __post_init__(self) -> None:
        super().__post_init__()
        lame_constants(self.young, self.poisson)

    def constants(self) -> dict[str, float]:
        mu, kappa = lame_constants(self.young, self.poisson)
        return {"mu": mu, "lam": kappa - 2.0 * mu / 3.0}


def positive(name: str, value: float, unit: str) -> None:
    """Raise unless ``value`` is a finite positive number."""
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"{name} must be positive and finite, got {value}; give it in {unit}")


def lame_constants(young: float, poisson: float) -> tuple[float, float]:
    """Shear modulus μ and bulk modulus κ [Pa] from Young's modulus E [Pa] and Poisson's ratio ν.

    Raises:
        ValueError: E not positive, or ν outside (−1, 0.5).
    """
    positive("young", young, "Pa")
    if not -1.0 < poisson < 0.5:
        raise ValueError(f"poisson ratio must be in (-1, 0.5), got {poisson}; use 0.49 to 0.499 for rubber")
    return young / (2.0 * (1.0 + poisson)), young / (3.0 * (1.0 - 2.0 * poisson))
