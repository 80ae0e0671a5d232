"""What liquids and gases have in common: pressure by an equation of state, viscosity, a least pressure."""

import functools
import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import warp as wp

from ..linalg import cofactor, det, stretch_of_volume
from ..space import Space
from .base import Law, Material, Variable
from .viscosity import Viscosity

WORK = Variable("viscous_work", "J/m^3", "viscous work per initial volume", least=0.0)


class Equation(NamedTuple):
    """An equation of state as ``wp.func``: of J, of its variable θ that heat changes, 0 where there is none, constants.

    Attributes:
        pressure: (J, θ, c) -> p [Pa].
        energy: (J, θ, c) -> internal energy per initial volume Ψ [J/m^d], p = −∂Ψ/∂J.
        modulus: (J, θ, c) -> ρ0 c² = −J² ∂p/∂J [Pa], for sound waves are isentropic.
        opening: (p, θ, c) -> J > 1 at which the pressure has fallen to p.
        heat: (J, c) -> 1/(∂Ψ/∂θ), by which heat raises θ; None for a fluid whose pressure no heat changes.
    """

    pressure: Any
    energy: Any
    modulus: Any
    opening: Any
    heat: Any = None


@dataclass(frozen=True, kw_only=True)
class Fluid(Material):
    """A liquid or gas, σ = −p 1 + 2 η dev D. It carries F = J^(1/d) I, so that shear never piles up in F.

    A subclass is an equation of state. Where p depends on the internal energy, de = −p dJ + heat, the law does not
    carry e but what stays on an isentrope, so that −p dJ is exact in any step: only heat, that of viscosity and of the
    scheme's dissipation (M9), changes it.

    Args:
        density: initial density [kg/m³].
        viscosity: ``Newtonian`` or ``PowerLaw``; None has none. The work that it takes is heat, or the account
            "material" where the equation of state takes no heat, and the variable ``viscous_work``.
        cavitation: least pressure [Pa], at which the fluid opens without resistance; None bears any tension that the
            equation of state gives.
    """

    viscosity: Viscosity | None = None
    cavitation: float | None = None
    flows: ClassVar[bool] = True
    forgets: ClassVar[bool] = True
    #: The variable θ of the equation of state, if it has one.
    variable: ClassVar[Variable | None] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.viscosity is not None and not isinstance(self.viscosity, Viscosity):
            raise ValueError(f"viscosity must be Newtonian(viscosity=1e-3) or another, or None, got {self.viscosity!r}")
        if self.cavitation is not None and not math.isfinite(self.cavitation):
            raise ValueError(f"cavitation must be a finite pressure in Pa, or None for none, got {self.cavitation}")

    @abstractmethod
    def state(self) -> dict[str, float]:
        """Numbers that ``make_equation`` reads, fields of its constants."""

    @staticmethod
    @abstractmethod
    def make_equation(real: type, Constants: Any) -> Equation:
        """The equation of state, cached."""

    def constants(self) -> dict[str, float]:
        numbers = self.state()
        if self.viscosity is not None:
            numbers = {**numbers, **self.viscosity.constants(), "steepest": self.viscosity.steepest}
        return numbers if self.cavitation is None else {**numbers, "least_pressure": self.cavitation}

    def law(self, space: Space) -> Law:
        viscosity = None if self.viscosity is None else type(self.viscosity)
        return _law(space, type(self), viscosity, tuple(self.constants()), self.cavitation is not None)


@functools.cache
def _inviscid(space: Space, Constants: Any, equation: Equation, opens: bool) -> tuple[Any, Any, Any, Any, Any]:
    """``wp.func``: pressure, energy and modulus of (J, θ, c) with the least pressure, 1/(∂Ψ/∂θ), and what is kept of F.

    Where the fluid has opened, at J_o, it has the pressure and modulus of J_o, and Ψ goes on linearly.
    """
    real, mat, dim, determinant, stretch_of = space.real, space.mat, space.dim, det(space), stretch_of_volume(space)
    pressure_of, energy_of, modulus_of, opening_of, heat_of = equation
    heats = heat_of is not None

    @wp.func
    def as_it_is(J: real, theta: real, c: Constants) -> real:
        return J

    @wp.func
    def at_most_open(J: real, theta: real, c: Constants) -> real:
        if pressure_of(J, theta, c) < c.least_pressure:
            return wp.min(J, opening_of(c.least_pressure, theta, c))
        return J

    closed = at_most_open if opens else as_it_is

    @wp.func
    def pressure(J: real, theta: real, c: Constants) -> real:
        return pressure_of(closed(J, theta, c), theta, c)

    @wp.func
    def energy(J: real, theta: real, c: Constants) -> real:
        if wp.static(opens):
            J_o = closed(J, theta, c)
            return energy_of(J_o, theta, c) - c.least_pressure * (J - J_o)
        return energy_of(J, theta, c)

    @wp.func
    def modulus(J: real, theta: real, c: Constants) -> real:
        return modulus_of(closed(J, theta, c), theta, c)

    @wp.func
    def warming(J: real, theta: real, c: Constants) -> real:
        if wp.static(heats):
            return heat_of(closed(J, theta, c), c)
        return real(0.0)

    @wp.func
    def kept(F: mat, c: Constants) -> mat:
        return wp.identity(n=wp.static(dim), dtype=real) * stretch_of(determinant(F))

    return pressure, energy, modulus, warming, kept


@functools.cache
def _law(
    space: Space, kind: type[Fluid], viscosity: type[Viscosity] | None, names: tuple[str, ...], opens: bool
) -> Law:
    """Short form where nothing is remembered."""
    real, mat, pair = space.real, space.mat, space.row(2)
    annotations = dict.fromkeys(names, real)
    Constants = wp.struct(type("Constants", (), {"__annotations__": annotations, "__module__": __name__}))
    equation = kind.make_equation(real, Constants)
    pressure, energy_of, modulus, _, kept = _inviscid(space, Constants, equation, opens)
    determinant, cof = det(space), cofactor(space)
    if kind.variable is not None or viscosity is not None:
        return _remembering(space, kind.variable, viscosity, Constants, equation, opens)

    @wp.func
    def stress(F: mat, c: Constants) -> mat:
        return cof(F) * (-pressure(determinant(F), real(0.0), c))

    @wp.func
    def energy(F: mat, c: Constants) -> real:
        return energy_of(determinant(F), real(0.0), c)

    @wp.func
    def wave_moduli(F: mat, c: Constants) -> pair:
        return pair(modulus(determinant(F), real(0.0), c), real(0.0))

    return Law(Constants, stress, energy, wave_moduli, kept)


@functools.cache
def _shear(space: Space, Constants: Any, viscosity: type[Viscosity]) -> tuple[Any, Any]:
    """``wp.func`` l -> dev D, in the space, and (l, c) -> (η, γ̇²)."""
    real, mat, pair, dim = space.real, space.mat, space.row(2), space.dim
    eta_of = viscosity.make_viscosity(real, Constants)

    @wp.func
    def deviator(rate: mat) -> mat:
        third = wp.trace(rate) / real(3.0)
        return (rate + wp.transpose(rate)) * real(0.5) - wp.identity(n=wp.static(dim), dtype=real) * third

    @wp.func
    def eta(rate: mat, c: Constants) -> pair:
        D = (rate + wp.transpose(rate)) * real(0.5)
        trace = wp.trace(D)
        # the directions that are missing are those of uniaxial and plane motion
        squared = wp.max(real(2.0) * (wp.ddot(D, D) - trace * trace / real(3.0)), real(0.0))
        return pair(eta_of(wp.sqrt(squared), c), squared)

    return deviator, eta


@functools.cache
def _no_shear(space: Space, Constants: Any) -> tuple[Any, Any]:
    """The same of a fluid without viscosity."""
    mat, pair = space.mat, space.row(2)

    @wp.func
    def deviator(rate: mat) -> mat:
        return mat()

    @wp.func
    def eta(rate: mat, c: Constants) -> pair:
        return pair()

    return deviator, eta


@functools.cache
def _remembering(
    space: Space,
    variable: Variable | None,
    viscosity: type[Viscosity] | None,
    Constants: Any,
    equation: Equation,
    opens: bool,
) -> Law:
    """Long form; rows are θ, if there is one, and the viscous work, if there is viscosity."""
    real, mat, pair = space.real, space.mat, space.row(2)
    determinant, cof = det(space), cofactor(space)
    history = (*([variable] if variable else []), *([WORK] if viscosity else []))
    row, heated, viscous, last = space.row(len(history)), variable is not None, viscosity is not None, len(history) - 1
    pressure, energy_of, modulus, warming, kept = _inviscid(space, Constants, equation, opens)
    deviator, eta_of = _shear(space, Constants, viscosity) if viscosity else _no_shear(space, Constants)

    @wp.func
    def theta_of(h: row) -> real:
        if wp.static(heated):
            return h[0]
        return real(0.0)

    @wp.func
    def warmed(F: mat, h: row, heat: real, c: Constants) -> row:
        out = h
        if wp.static(heated):
            out[0] = h[0] + heat * warming(determinant(F), h[0], c)
        return out

    @wp.func
    def stress(F: mat, rate: mat, h: row, dt: real, c: Constants) -> mat:
        P = cof(F) * (-pressure(determinant(F), theta_of(h), c))
        if wp.static(viscous):
            P += deviator(rate) @ cof(F) * (real(2.0) * eta_of(rate, c)[0])
        return P

    @wp.func
    def energy(F: mat, h: row, c: Constants) -> real:
        return energy_of(determinant(F), theta_of(h), c)

    @wp.func
    def wave_moduli(F: mat, h: row, c: Constants) -> pair:
        return pair(modulus(determinant(F), theta_of(h), c), real(0.0))

    @wp.func
    def update(F: mat, rate: mat, h: row, dt: real, c: Constants):
        out = h
        lost = real(0.0)
        if wp.static(heated):  # not a number where the equation of state has no pressure
            out[0] = h[0] + real(0.0) * pressure(determinant(F), h[0], c)
        if wp.static(viscous):
            shear = eta_of(rate, c)
            work = determinant(F) * shear[0] * shear[1] * dt
            if wp.static(heated):
                out = warmed(F, out, work, c)
            else:
                lost = work
            out[last] = h[last] + work
        return kept(F, c), out, lost

    @wp.func
    def drag(F: mat, rate: mat, h: row, c: Constants) -> real:
        # along a wave the deviator is 2/3 of the rate: 4/3 η
        return determinant(F) * c.steepest * eta_of(rate, c)[0] * real(4.0) / real(3.0)

    law = Law(Constants, stress, energy, wave_moduli, update, history=history)
    return law._replace(viscosity=drag if viscous else None, heat=warmed if heated else None)
