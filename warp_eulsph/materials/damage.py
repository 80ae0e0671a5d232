"""When matter breaks and what that takes: criteria of ``Failing``, by stress, strain, or plastic strain."""

import functools
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import warp as wp

from ..linalg import symmetric_bounds
from ..space import Space
from .base import Law, history_row, positive


@dataclass(frozen=True, kw_only=True)
class Failure(ABC):
    """A criterion, and how damage D grows from 0 to 1 beyond it so that a crack takes the energy ``energy`` per area.

    Args:
        energy: G, what a crack takes per area from the onset of damage to failure [J/m²]: per initial volume G over the
            width that it is spread over, which goes with the spacing (the crack band of Bažant & Oh, Matériaux et
            Constructions 16, 1983).
    """

    energy: float
    #: Variable of the law's history that the criterion reads.
    needs: ClassVar[str | None] = None

    def __post_init__(self) -> None:
        positive("energy", self.energy, "J/m^2")

    @abstractmethod
    def constants(self) -> dict[str, float]:
        """Numbers, fields of the constants that ``make_growth`` reads; ``energy`` is one."""

    @staticmethod
    @abstractmethod
    def make_growth(space: Space, law: Law, Constants: type) -> wp.Function:
        """``wp.func`` (step, constants) -> (drive, D) after it; ``step`` is the struct of ``step_structure``.

        ``law`` is that of the whole matter.
        """


@functools.cache
def step_structure(space: Space, law: Law) -> Any:
    """A step of a particle, as a criterion sees it.

    ``F`` and its Cauchy stress ``sigma`` [Pa] are those of the whole matter after the step, (dim, dim), ``mean`` [Pa] a
    third of the trace of σ in 3-D; ``before`` and ``after`` are its rows of history, ``stored`` [J/m^d] its energy and
    ``spent`` what it dissipated in the step ``dt`` [s], per initial volume; ``width`` [m] that of a crack. ``drive`` is
    the criterion's own memory, 0 at the start, 1 at the onset of damage ``D``, both as before the step.
    """
    real, mat, row = space.real, space.mat, history_row(space, law)

    @wp.struct
    class Step:
        F: mat
        sigma: mat
        mean: real
        before: row
        after: row
        dt: real
        stored: real
        spent: real
        width: real
        drive: real
        D: real

    return Step


@functools.cache
def softening(space: Space, law: Law) -> wp.Function:
    """``wp.func`` (r, step, energy) -> (r_max, D): stress falls to zero along a line; r_max is the drive.

    r is σ or ε over its strength. Beyond 1 D = r_u/(r_u − 1) (1 − 1/r); ∫ Ψ dD = G/width with r_u = G r²/(width Ψ),
    where Ψ grows with r². A width too large for that, r_u ≤ 1, breaks at once.
    """
    real, pair, Step = space.real, space.row(2), step_structure(space, law)

    @wp.func
    def softening(r: real, s: Step, energy: real) -> pair:
        if r <= wp.max(s.drive, real(1.0)):
            return pair(s.drive, s.D)
        ultimate = energy * r * r / (s.width * s.stored)
        grown = real(1.0)
        if ultimate > r:
            grown = ultimate / (ultimate - real(1.0)) * (real(1.0) - real(1.0) / r)
        return pair(r, wp.max(s.D, grown))

    return softening


@dataclass(frozen=True, kw_only=True)
class PrincipalStress(Failure):
    """Brittle: breaks where the largest principal Cauchy stress of the whole matter passes ``strength``.

    In 2-D the largest in the plane. A crack's width should be less than 2 E G/σ_f²: beyond that it holds more
    energy at the onset than the crack takes, and breaks at once.

    Args:
        energy: G [J/m²].
        strength: σ_f [Pa].
    """

    strength: float

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("strength", self.strength, "Pa")

    def constants(self) -> dict[str, float]:
        return {"energy": self.energy, "strength": self.strength}

    @staticmethod
    @functools.cache
    def make_growth(space: Space, law: Law, Constants: type) -> wp.Function:
        pair, Step = space.row(2), step_structure(space, law)
        bounds, soften = symmetric_bounds(space), softening(space, law)

        @wp.func
        def growth(s: Step, c: Constants) -> pair:
            return soften(bounds(s.sigma)[1] / c.strength, s, c.energy)

        return growth


@dataclass(frozen=True, kw_only=True)
class PrincipalStrain(Failure):
    """Brittle: breaks where the largest principal logarithmic strain passes ``strain``.

    That of F as the law carries it: of all deformation where the arrangement is that of the start, of its elastic part
    where neighbours are read anew. In 2-D the largest in the plane.

    Args:
        energy: G [J/m²].
        strain: ε_f [-].
    """

    strain: float

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("strain", self.strain, "1")

    def constants(self) -> dict[str, float]:
        return {"energy": self.energy, "strain": self.strain}

    @staticmethod
    @functools.cache
    def make_growth(space: Space, law: Law, Constants: type) -> wp.Function:
        real, pair, Step = space.real, space.row(2), step_structure(space, law)
        bounds, soften = symmetric_bounds(space), softening(space, law)

        @wp.func
        def growth(s: Step, c: Constants) -> pair:
            largest = real(0.5) * wp.log(bounds(s.F @ wp.transpose(s.F))[1])
            return soften(largest / c.strain, s, c.energy)

        return growth


@functools.cache
def _wearing(space: Space, law: Law) -> wp.Function:
    """``wp.func`` (share, step, energy) -> (drive, D) of a step with ``share`` of what is borne.

    Beyond the onset dD = width/(2 G) times the plastic work of whole matter, of which 1 − D is done: in sum G/width.
    """

    real, pair, Step = space.real, space.row(2), step_structure(space, law)

    @wp.func
    def wearing(share: real, s: Step, energy: real) -> pair:
        if share <= real(0.0):
            return pair(s.drive, s.D)
        beyond = wp.clamp((s.drive + share - real(1.0)) / share, real(0.0), real(1.0))
        grown = s.D + beyond * s.spent * s.width / (real(2.0) * energy)
        return pair(s.drive + share, wp.min(grown, real(1.0)))

    return wearing


@dataclass(frozen=True, kw_only=True)
class PlasticStrain(Failure):
    """Ductile: breaks where the equivalent plastic strain passes ``strain``, whatever the stress.

    Args:
        energy: G [J/m²].
        strain: α_f [-].
    """

    strain: float
    needs: ClassVar[str | None] = "plastic_strain"

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("strain", self.strain, "1")

    def constants(self) -> dict[str, float]:
        return {"energy": self.energy, "strain": self.strain}

    @staticmethod
    @functools.cache
    def make_growth(space: Space, law: Law, Constants: type) -> wp.Function:
        pair, Step = space.row(2), step_structure(space, law)
        alpha, wearing = law.columns("plastic_strain").start, _wearing(space, law)

        @wp.func
        def growth(s: Step, c: Constants) -> pair:
            return wearing((s.after[alpha] - s.before[alpha]) / c.strain, s, c.energy)

        return growth


@dataclass(frozen=True, kw_only=True)
class JohnsonCookFailure(Failure):
    """Ductile: breaks where Σ Δα/ε_f passes 1, ε_f = (D₁ + D₂ e^(D₃ σ*)) (1 + D₄ ln max(ε̇*, 1)) (1 + D₅ T*).

    σ* is the mean stress over von Mises', between −1.5 and 1.5, where the law was measured; ε̇* = α̇/ε̇₀; T* =
    (T − T₀)/(T_m − T₀) in [0, 1], 0 where the law knows no temperature (Johnson & Cook, Engng Fracture Mech. 21, 1985,
    whose D₃ is negative: 0.54, 4.89, −3.03, 0.014, 1.12 for OFHC copper).

    Args:
        energy: G [J/m²].
        D1: ε_f under the highest tension [-].
        D2: what less tension adds [-].
        D3: per σ*, negative.
        D4: sensitivity to the rate.
        D5: to temperature.
        reference_rate: ε̇₀ [1/s].
        temperature: T₀ [K].
        melting: T_m [K].
    """

    D1: float
    D2: float
    D3: float
    D4: float = 0.0
    D5: float = 0.0
    reference_rate: float = 1.0
    temperature: float = 293.0
    melting: float = 1356.0
    needs: ClassVar[str | None] = "plastic_strain"

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("reference_rate", self.reference_rate, "1/s")
        positive("D1 + D2 e^(1.5 D3)", self.D1 + self.D2 * 2.718281828459045 ** (1.5 * self.D3), "1")
        positive("D1 + D2 e^(-1.5 D3)", self.D1 + self.D2 * 2.718281828459045 ** (-1.5 * self.D3), "1")
        if not (0.0 < self.temperature < self.melting):
            raise ValueError(f"melting must be above temperature = {self.temperature} K > 0, got {self.melting}")
        if self.D5 <= -1.0:
            raise ValueError(f"D5 must be above -1, so that matter breaks at its melting point, got {self.D5}")

    def constants(self) -> dict[str, float]:
        names = ("energy", "D1", "D2", "D3", "D4", "D5", "reference_rate", "temperature")
        return {name: getattr(self, name) for name in names} | {"range": self.melting - self.temperature}

    @staticmethod
    @functools.cache
    def make_growth(space: Space, law: Law, Constants: type) -> wp.Function:
        real, mat, pair, dim, Step = space.real, space.mat, space.row(2), space.dim, step_structure(space, law)
        alpha, wearing = law.columns("plastic_strain").start, _wearing(space, law)
        heats = any(variable.name == "temperature" for variable in law.history)
        heat = law.columns("temperature").start if heats else 0

        @wp.func
        def triaxiality(sigma: mat, mean: real) -> real:
            s = sigma - wp.identity(n=wp.static(dim), dtype=real) * mean
            across = -wp.trace(s)  # of the deviator, shared by the directions that are not there
            square = wp.ddot(s, s)
            if wp.static(dim < 3):
                square += across * across / real(wp.static(float(3 - dim)))
            return mean / wp.sqrt(wp.max(real(1.5) * square, real(1e-20) * mean * mean))

        @wp.func
        def growth(s: Step, c: Constants) -> pair:
            flow = s.after[alpha] - s.before[alpha]
            if flow <= real(0.0):
                return pair(s.drive, s.D)
            star = wp.clamp(triaxiality(s.sigma, s.mean), real(-1.5), real(1.5))
            borne = c.D1 + c.D2 * wp.exp(c.D3 * star)
            borne *= real(1.0) + c.D4 * wp.log(wp.max(flow / (s.dt * c.reference_rate), real(1.0)))
            if wp.static(heats):
                hot = wp.clamp((s.after[heat] - c.temperature) / c.range, real(0.0), real(1.0))
                borne *= real(1.0) + c.D5 * hot
            return wearing(flow / borne, s, c.energy)

        return growth
