"""Matter that breaks: a law of whole matter that loses tension and shear by damage, and keeps its pressure."""

import dataclasses
import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..linalg import det, inverse
from ..space import Space
from .base import Isotropic, Law, Material, Variable, history_row, lame_constants, long_form, positive
from .damage import Failure, step_structure
from .drucker_prager import DruckerPrager

DAMAGE = Variable("damage", "-", "0 whole, 1 failed: no more tension and shear", least=0.0)
DRIVE = Variable("failure_drive", "-", "what the criterion has seen; 1 is the onset of damage", least=0.0)


@dataclass(frozen=True, kw_only=True)
class Failing(Material):
    """Ψ = (1 − D) Ψ_whole + D Ψ_p, P = (1 − D) P_whole + D P_p (M25): D = 1 is matter that bears pressure alone.

    Ψ_p = κ/2 (ln J)² where J < 1, else nothing. The whole matter lives on in the strains, so that plasticity knows of
    damage as of a smaller section; of its dissipation 1 − D is done, and growing D dissipates (Ψ_whole − Ψ_p) ΔD: books
    close. Where the arrangement stays, a failed particle that opens (D = 1, J > 1) lets go of its neighbours for good:
    it keeps mass and momentum and flies on. Its history adds ``damage``, ``failure_drive`` and ``crack_width``.

    Args:
        material: the whole matter.
        failure: when it breaks, and what that takes.
        layers: spacings that a crack is spread over, so that its energy per initial volume is G/(``layers`` spacing):
            2.5 is what plane cracks take in the arrangement of the start, within a tenth (``tests/test_failing.py``).
    """

    density: float = dataclasses.field(init=False)
    material: Isotropic
    failure: Failure
    layers: float = 2.5

    def __post_init__(self) -> None:
        if not isinstance(self.material, Isotropic):
            raise ValueError(f"material must be a law with young and poisson such as J2(...), got {self.material!r}")
        if self.material.linear:
            raise ValueError(f"{type(self.material).__name__} is for small turns; pieces of what breaks turn")
        if isinstance(self.material, DruckerPrager):
            raise ValueError(
                "DruckerPrager opens by its own tension cut-off, and what has failed would forget how it dilated"
            )
        positive("layers", self.layers, "1")
        object.__setattr__(self, "density", self.material.density)
        object.__setattr__(self, "yields", self.material.yields)  # of the class in other laws
        names = {variable.name for variable in self.material.law(Space(3)).history}
        if self.failure.needs is not None and self.failure.needs not in names:
            raise ValueError(
                f"{type(self.failure).__name__} reads {self.failure.needs!r}, which {type(self.material).__name__} "
                "does not remember; it is for J2"
            )

    def constants(self) -> dict[str, Any]:
        bulk = lame_constants(self.material.young, self.material.poisson)[1]
        return {"whole": self.material.constants(), "bulk": bulk, **self.failure.constants()}

    def filled_constants(self, law: Law) -> Any:
        filled = law.Constants()
        filled.whole = self.material.filled_constants(law._replace(Constants=law.Constants.vars["whole"].type))
        for name, value in self.constants().items():
            if name != "whole":
                setattr(filled, name, value)
        return filled

    def law(self, space: Space) -> Law:
        return _law(space, self.material.law(space), type(self.failure), tuple(self.constants())[1:], self.layers)


@functools.cache
def _law(space: Space, whole: Law, failure: type[Failure], names: tuple[str, ...], layers: float) -> Law:
    real, mat, pair, dim, size = space.real, space.mat, space.row(2), space.dim, len(whole.start)
    annotations = {"whole": whole.Constants, **dict.fromkeys(names, real)}
    Constants = wp.struct(type("Constants", (), {"__annotations__": annotations, "__module__": __name__}))
    width = Variable("crack_width", "m", "layers times spacing, over which a crack is spread", layers, 0.0, True)
    law = Law(Constants, None, None, None, history=(*whole.history, DAMAGE, DRIVE, width))
    row, part = history_row(space, law), history_row(space, whole)
    long, determinant, invert = long_form(space, whole), det(space), inverse(space)
    stress_of, energy_of, moduli_of, update_of = long.stress, long.energy, long.wave_moduli, whole.update
    secant_of, rebase_of = whole.secant, whole.rebase
    growth, Step = failure.make_growth(space, whole, Constants), step_structure(space, whole)

    @wp.func
    def own(h: row) -> part:
        out = part()
        for i in range(wp.static(size)):
            out[i] = h[i]
        return out

    @wp.func
    def joined(own: part, h: row) -> row:
        out = h
        for i in range(wp.static(size)):
            out[i] = own[i]
        return out

    @wp.func
    def pressed(F: mat, c: Constants) -> real:
        """κ ln J where J < 1."""
        return c.bulk * wp.log(wp.min(determinant(F), real(1.0)))

    @wp.func
    def stress(F: mat, rate: mat, h: row, dt: real, c: Constants) -> mat:
        D = h[wp.static(size)]
        P = wp.transpose(invert(F)) * (D * pressed(F, c))
        if real(1.0) > D:
            P += stress_of(F, rate, own(h), dt, c.whole) * (real(1.0) - D)
        return P

    @wp.func
    def energy(F: mat, h: row, c: Constants) -> real:
        D, p = h[wp.static(size)], pressed(F, c)
        W = D * real(0.5) * p * p / c.bulk
        if real(1.0) > D:
            W += (real(1.0) - D) * energy_of(F, own(h), c.whole)
        return W

    @wp.func
    def wave_moduli(F: mat, h: row, c: Constants) -> pair:
        # that of pressure falls with p, κ (1 − ln J)
        D, p = h[wp.static(size)], pressed(F, c)
        M = pair(real(0.0), real(0.0))
        if real(1.0) > D:
            M = moduli_of(F, own(h), c.whole) * (real(1.0) - D)
        if p < real(0.0):
            M[0] = M[0] + D * (c.bulk - p)
        return M

    @wp.func
    def update(F: mat, rate: mat, h: row, dt: real, c: Constants):
        D = h[wp.static(size)]
        if real(1.0) <= D:
            return F, h, real(0.0)
        before = own(h)
        F_new, after, spent = F, before, real(0.0)
        if wp.static(update_of is not None):
            F_new, after, spent = update_of(F, rate, before, dt, c.whole)
        J = determinant(F_new)
        W, p = energy_of(F_new, after, c.whole), pressed(F_new, c)
        sigma = stress_of(F_new, rate, after, real(0.0), c.whole) @ wp.transpose(F_new) / J
        drive, width, mean = h[wp.static(size + 1)], h[wp.static(size + 2)], c.bulk * wp.log(J) / J
        grown = growth(Step(F_new, sigma, mean, before, after, dt, W, spent, width, drive, D), c)
        out = joined(after, h)
        out[wp.static(size)] = grown[1]
        out[wp.static(size + 1)] = grown[0]
        lost = (real(1.0) - D) * spent + (grown[1] - D) * (W - real(0.5) * p * p / c.bulk)
        return F_new, out, lost

    @wp.func
    def rebase(F: mat, h: row, c: Constants):
        D, J = h[wp.static(size)], determinant(F)
        F_new, out = F, h
        if real(1.0) <= D:
            if real(1.0) < J:  # what flies apart is no larger
                F_new = F * wp.pow(J, real(wp.static(-1.0 / dim)))
        elif wp.static(rebase_of is not None):
            F_new, after = rebase_of(F, own(h), c.whole)
            out = joined(after, h)
        return F_new, out

    @wp.func
    def secant(h: row, c: Constants) -> real:
        left = real(1.0) - h[wp.static(size)]
        if wp.static(secant_of is not None):
            left *= secant_of(own(h), c.whole)
        return left

    @wp.func
    def failed(h: row, c: Constants) -> bool:
        return h[wp.static(size)] >= real(1.0)

    parts = {"stress": stress, "energy": energy, "wave_moduli": wave_moduli, "secant": secant, "failed": failed}
    return law._replace(**parts, update=update, rebase=rebase)
