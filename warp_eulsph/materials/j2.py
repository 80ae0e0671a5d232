"""Metal plasticity at finite strain: von Mises' yield condition, return mapping in logarithmic strains."""

import functools
import math
from dataclasses import dataclass
from typing import Any, ClassVar

import warp as wp

from ..linalg import det, inverse
from ..space import Space, matrix_type
from .base import Isotropic, Law, Variable, history_row, lame_constants
from .hardening import Hardening
from .plastic_metric import METRIC, elastic_kinematics

STRAIN = Variable("plastic_strain", "-", "equivalent plastic strain", least=0.0)
WORK = Variable("plastic_work", "J/m^3", "plastic work per initial volume", least=0.0)
# Rounds of the bracketed search for a plastic increment; ten do where the yield stress is smooth.
ROUNDS = 60


@dataclass(frozen=True, kw_only=True)
class J2(Isotropic):
    """Hencky's elasticity Ψ = κ/2 (ln J)² + μ |dev e|², e = ln V_e, that yields where von Mises' √(3/2) |dev τ| = y.

    A step that ends outside of the yield surface returns to it along the deviatoric strain, so that plastic flow keeps
    volume exactly (M18, M19 in docs/method.md, §8). In 2-D and 1-D the strains across are zero in sum; their elastic
    and plastic parts are not. Its history: ``plastic_metric``, ``plastic_strain``, ``plastic_work``, and
    ``temperature`` where the hardening heats.

    Args:
        density: initial density [kg/m³].
        young: Young's modulus [Pa].
        poisson: Poisson's ratio, in (−1, 0.5).
        hardening: the yield stress.
    """

    hardening: Hardening
    yields: ClassVar[bool] = True

    def constants(self) -> dict[str, Any]:
        mu, kappa = lame_constants(self.young, self.poisson)
        heating = self.hardening.heat(self.density)[1]
        return {"mu": mu, "kappa": kappa, "heating": heating, **self.hardening.constants()}

    def law(self, space: Space) -> Law:
        sizes = tuple((name, len(v) if isinstance(v, tuple) else 1) for name, v in self.constants().items())
        history: tuple[Variable, ...] = (METRIC, STRAIN, WORK)
        if self.hardening.heats:
            start = self.hardening.heat(self.density)[0]
            history = (*history, Variable("temperature", "K", "temperature; no heat is conducted", start, 0.0))
        return _law(space, type(self.hardening), sizes, history)


@functools.cache
def _return_mapping(real: type, Constants: Any, yield_stress: wp.Function) -> wp.Function:
    """``wp.func`` (q, α, T, Δt, c) -> Δ with q − 3μ Δ = y(α + Δ, Δ/Δt, T), 0 within the yield surface; NaN: not found.

    By regula falsi with the Illinois rule (Dowell & Jarratt 1971), which needs no slope and keeps its bracket: y may
    rise steeply at α = 0. Exact at once where y is linear.
    """
    tolerance = 32.0 * 2.0 ** (-52 if real is wp.float64 else -23)

    @wp.func
    def increment(q: real, alpha: real, T: real, dt: real, c: Constants) -> real:
        outside = q - yield_stress(alpha, real(0.0), T, c)
        if dt == real(0.0) or outside <= real(0.0):
            return real(0.0)
        least = real(0.0)
        largest = q / (real(3.0) * c.mu)
        inside = -yield_stress(alpha + largest, largest / dt, T, c)
        found = real(wp.nan)
        side = int(0)
        rounds = int(ROUNDS)  # not unrolled
        for _ in range(rounds):
            delta = least + (largest - least) * outside / (outside - inside)
            left = q - real(3.0) * c.mu * delta - yield_stress(alpha + delta, delta / dt, T, c)
            if wp.abs(left) <= real(tolerance) * q:
                found = delta
                break
            if left > real(0.0):
                least = delta
                outside = left
                if side == 1:
                    inside *= real(0.5)
                side = 1
            else:
                largest = delta
                inside = left
                if side == -1:
                    outside *= real(0.5)
                side = -1
        return found

    return increment


@functools.cache
def _law(space: Space, hardening: type[Hardening], sizes: tuple[tuple[str, int], ...], history: Any) -> Law:
    dim, real, mat, pair = space.dim, space.real, space.mat, space.row(2)
    full = matrix_type(3, 3, real)
    annotations = {name: real if size == 1 else space.row(size) for name, size in sizes}
    Constants = wp.struct(type("Constants", (), {"__annotations__": annotations, "__module__": __name__}))
    yield_stress = hardening.make_yield_stress(real, Constants)
    increment, shortened = _return_mapping(real, Constants, yield_stress), math.sqrt(1.5)
    determinant, invert, heats = det(space), inverse(space), hardening.heats
    law = Law(Constants, None, None, None, history=history)
    row = history_row(space, law)
    trial, most, flowed, rebased, moduli, in_space = elastic_kinematics(space, row)

    @wp.func
    def temperature(h: row) -> real:
        if wp.static(heats):
            return h[8]
        return real(0.0)

    @wp.func
    def flow(e: full, h: row, dt: real, c: Constants) -> pair:
        """Δ that a trial strain dev e causes, and what it leaves of dev e."""
        norm = wp.sqrt(wp.ddot(e, e))
        delta = increment(real(2.0) * real(shortened) * c.mu * norm, h[6], temperature(h), dt, c)
        if delta == real(0.0):
            return pair(delta, real(1.0))
        return pair(delta, real(1.0) - real(shortened) * delta / norm)

    @wp.func
    def stress(F: mat, rate: mat, h: row, dt: real, c: Constants) -> mat:
        e = trial(F, h)
        e = e * (real(2.0) * c.mu * flow(e, h, dt, c)[1])
        pressure = wp.identity(n=wp.static(dim), dtype=real) * (c.kappa * wp.log(determinant(F)))
        tau = pressure + in_space(e)
        return tau @ wp.transpose(invert(F))

    @wp.func
    def energy(F: mat, h: row, c: Constants) -> real:
        e = trial(F, h)
        volumetric = wp.log(determinant(F))
        return real(0.5) * c.kappa * volumetric * volumetric + c.mu * wp.ddot(e, e)

    @wp.func
    def wave_moduli(F: mat, h: row, c: Constants) -> pair:
        return moduli(F, h, c.kappa * wp.log(determinant(F)), c.mu, c.kappa)

    @wp.func
    def update(F: mat, rate: mat, h: row, dt: real, c: Constants):
        T = temperature(h)
        if real(2.0) * real(shortened) * c.mu * most(F, h) < yield_stress(h[6], real(0.0), T, c):
            return F, h, real(0.0)
        e = trial(F, h)
        found = flow(e, h, dt, c)
        delta = found[0]
        if delta == real(0.0):
            return F, h, real(0.0)
        speed = delta / dt
        y = yield_stress(h[6], speed, T, c) + yield_stress(h[6] + delta, speed, T, c)
        work = real(0.5) * y * delta
        out = flowed(F, h, e * found[1])
        out[6] = h[6] + delta
        out[7] = h[7] + work
        if wp.static(heats):
            out[8] = h[8] + c.heating * work
        return F, out, work

    @wp.func
    def rebase(F: mat, h: row, c: Constants):
        F_e, out = rebased(F, h)
        return F_e, out

    @wp.func
    def secant(h: row, c: Constants) -> real:
        """Stress over total strain of monotonous loading, y/(y + 3μ α), that of slow flow."""
        y = yield_stress(h[6], real(0.0), temperature(h), c)
        return y / (y + real(3.0) * c.mu * h[6])

    parts = {"stress": stress, "energy": energy, "wave_moduli": wave_moduli, "secant": secant}
    return law._replace(**parts, update=update, rebase=rebase)
