"""What a material declares."""

import functools
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
import warp as wp

from ..linalg import reciprocal_cube_root
from ..space import Space

# Where the components of a symmetric tensor stand among xx, yy, zz, xy, xz, yz.
SYMMETRIC = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])


class Variable(NamedTuple):
    """A history variable: what a law remembers of each particle, under this name in snapshots, probes and checkpoints.

    Attributes:
        name: letters, digits and underscores.
        unit: SI unit.
        meaning: in a few words.
        start: its value at the start: a number, or six of a symmetric tensor, xx, yy, zz, xy, xz, yz in any dimension.
        least: bound from below, which a remap (M15) must not pass; None has none.
        of_spacing: ``start`` is in initial spacings of the particle.
    """

    name: str
    unit: str
    meaning: str
    start: float | tuple[float, float, float, float, float, float] = 0.0
    least: float | None = None
    of_spacing: bool = False

    @property
    def values(self) -> tuple[float, ...]:
        """The starting values, 1 or 6."""
        return self.start if isinstance(self.start, tuple) else (self.start,)


class Eights(NamedTuple):
    """A law for a block of eight particles or fewer at once: on the CPU, where that is faster.

    Functions, ``wp.func``, of (block, …), the struct of ``block_structure`` in ``in_eights.py``; equal to those of the
    law up to round-off.

    Attributes:
        stress: (…, Δt, constants, P): P from ``block.first`` on.
        energy: (…, constants, Ψ): Ψ [J/m^d] from ``block.first`` on, in float64.
        wave_moduli: (…, constants) -> (2, 8): M and μ of each.
        update: (…, Δt, constants, lost): histories, and the energy dissipated per initial volume from ``block.first``
            on.
    """

    stress: wp.Function
    energy: wp.Function
    wave_moduli: wp.Function
    update: wp.Function


class Law(NamedTuple):
    """The point functions of a material in one space, all ``wp.func``.

    Attributes:
        Constants: ``wp.struct`` of numbers, and vectors of them, that the functions take.
        stress: (F, constants) -> P, first Piola–Kirchhoff stress [Pa].
        energy: (F, constants) -> Ψ, stored energy per initial volume [J/m^d].
        wave_moduli: (F, constants) -> (M, μ) [Pa]. M bounds ρ0 c² of all waves in all directions, c in the current
            configuration; μ bounds ρ0 c² of the shear waves along the principal directions. Both are exact at F = I.
        update: (F, constants) -> F, what a full step leaves of F; None leaves all. A liquid keeps det(F)^(1/d) I,
            because its F would grow without bound in shear. Twice must equal once, because a step of length zero
            updates too.
        rebase: see below.
        viscosity: see below; None has none.
        heat: see below; None takes none.
        secant: (h, constants) -> share in [0, 1] of the elastic stiffness in shear that stress over total strain still
            is, by which positions are tied to F (M16): all of it where it is None, with h of the start too.
        failed: (h, constants) -> whether the particle has failed for good. The first of a run is logged; where the
            arrangement stays, those that open (J > 1) lose their neighbours. None never fails.
        history: the variables that the law remembers, in this order one row of reals per particle; the same in every
            dimension.
        eights: stress, energy and update of eight particles at once; None has each by itself.

    A law with a history has the long form, in which l = Ḟ F⁻¹ [1/s] is the velocity gradient and h the row:

    - stress: (F, l, h, Δt, constants) -> P, where F is Δt [s] ahead of h: that of the half step. An inelastic law
      returns to its yield surface here too, and the new history is forgotten. Δt = 0: F and h belong together.
    - energy: (F, h, constants) -> Ψ. wave_moduli: (F, h, constants) -> (M, μ).
    - update: (F, l, h, Δt, constants) -> (F, h, energy dissipated per initial volume [J/m^d]) after each full step,
      Δt > 0. Where it finds no state, it returns a history that is not finite; the run stops there. Between two
      refreshes F − F_k is the motion since, so only a law that needs ``Always()`` may write F here.
    - rebase: (F, h, constants) -> (F, h) at each refresh, of bodies that it reads anew: a plastic solid starts from
      its elastic F. It must keep det F, stress and energy. None keeps all.

    - viscosity: (F, l, h, constants) -> ρ0 times the largest kinematic viscosity [Pa s], that of pressure waves, for
      the time step.
    - heat: (F, h, q, constants) -> h after each full step: heat q [J/m^d] per initial volume that the scheme's
      dissipation (M9) left in the particle. The stored energy must rise by q.

    The moduli are second derivatives of Ψ along F → (I + ε m⊗n) F, n the direction of the wave and m its
    polarisation: ρ0 c² m = Q(n) m with m·Q m = d²Ψ/dε² at ε = 0.
    """

    Constants: Any
    stress: wp.Function
    energy: wp.Function
    wave_moduli: wp.Function
    update: wp.Function | None = None
    rebase: wp.Function | None = None
    viscosity: wp.Function | None = None
    heat: wp.Function | None = None
    secant: wp.Function | None = None
    failed: wp.Function | None = None
    history: tuple[Variable, ...] = ()
    eights: Eights | None = None

    @property
    def start(self) -> tuple[float, ...]:
        """The row of the history at the start."""
        return tuple(value for variable in self.history for value in variable.values)

    def start_of(self, spacing: np.ndarray) -> np.ndarray:
        """The rows at the start of particles with these spacings [m], (n,): (n, k)."""
        scales = [variable.of_spacing for variable in self.history for _ in variable.values]
        return np.where(scales, spacing[:, None], 1.0) * np.array(self.start)

    def columns(self, name: str) -> slice:
        """Where the variable of this name stands in the row.

        Raises:
            KeyError: there is none.
        """
        first = 0
        for variable in self.history:
            size = len(variable.values)
            if variable.name == name:
                return slice(first, first + size)
            first += size
        raise KeyError(name)

    def by_name(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """Rows (n, k) of the history as its variables, (n,) or (n, 3, 3) each."""
        found = {}
        for variable in self.history:
            values = rows[:, self.columns(variable.name)]
            found[variable.name] = values[:, SYMMETRIC] if values.shape[1] > 1 else values[:, 0]
        return found


@functools.cache
def long_form(space: Space, law: Law) -> Law:
    """``law`` with stress, energy and wave moduli in the long form; those of a law without a history ignore it."""
    if law.history:
        return law
    real, mat, row, pair = space.real, space.mat, history_row(space, law), space.row(2)
    Constants, stress_of, energy_of, moduli_of = law.Constants, law.stress, law.energy, law.wave_moduli

    @wp.func
    def stress(F: mat, rate: mat, h: row, dt: real, c: Constants) -> mat:
        return stress_of(F, c)

    @wp.func
    def energy(F: mat, h: row, c: Constants) -> real:
        return energy_of(F, c)

    @wp.func
    def wave_moduli(F: mat, h: row, c: Constants) -> pair:
        return moduli_of(F, c)

    return law._replace(stress=stress, energy=energy, wave_moduli=wave_moduli)


def history_row(space: Space, law: Law) -> type:
    """Warp type of a row of the law's history; of one real that nobody reads where there is none."""
    return space.row(max(len(law.start), 1))


@functools.cache
def largest_eigenvalue(real: type) -> wp.Function:
    """``wp.func`` largest eigenvalue of [[A, B], [B, C]]; it grows with A, C and |B|, so bounds of them bound it."""

    @wp.func
    def largest_eigenvalue(A: real, B: real, C: real) -> real:
        half = real(0.5) * (A - C)
        return real(0.5) * (A + C) + wp.sqrt(half * half + B * B)

    return largest_eigenvalue


@functools.cache
def isochoric(real: type) -> wp.Function:
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

    #: Neighbours change for good, so that the arrangement must be read anew from the positions.
    flows: ClassVar[bool] = False
    #: F is counted from the last step, not from the start: only ``Always()`` will do for a reference.
    forgets: ClassVar[bool] = False
    #: At rest it has no pressure, and in motion little of ρ c²: what the defaults of liquids are for.
    liquid: ClassVar[bool] = False
    #: Beyond a yield stress it flows, and stress no longer grows with strain: what the defaults of metals are for.
    yields: ClassVar[bool] = False
    #: P is linear in F − I: for small strains and rotations only, because a rotation then causes stress.
    linear: ClassVar[bool] = False

    def __post_init__(self) -> None:
        positive("density", self.density, "kg/m^3")

    @abstractmethod
    def constants(self) -> dict[str, Any]:
        """Values of the fields of ``Law.Constants``."""

    @abstractmethod
    def law(self, space: Space) -> Law:
        """Point functions in this space, cached: the same objects for the same space."""

    def filled_constants(self, law: Law) -> Any:
        """``Law.Constants`` of this law with the values of ``constants``.

        Raises:
            ValueError: others than the fields of it.
        """
        filled, values, fields = law.Constants(), self.constants(), sorted(law.Constants.vars)
        if not isinstance(values, dict) or sorted(values) != fields:
            who = f"{type(self).__name__}.constants()"
            raise ValueError(f"{who} must be a dict of {fields}, the fields of Law.Constants, got {values}")
        for name, value in values.items():
            setattr(filled, name, value)
        return filled


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
