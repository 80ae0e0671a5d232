"""Metal plasticity at finite strain: von Mises' yield condition, return mapping in logarithmic strains."""

import functools
import math
from dataclasses import dataclass
from typing import Any, ClassVar

import warp as wp

from ..linalg import cofactor, det
from ..space import Space, matrix_type
from .base import Eights, Isotropic, Law, Variable, history_row, lame_constants
from .hardening import Hardening
from .in_eights import EIGHT, block_structure, plastic_eights
from .plastic_metric import METRIC, elastic_kinematics, moduli_of_size

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
    annotations = {name: real if size == 1 else space.row(size) for name, size in sizes}
    Constants = wp.struct(type("Constants", (), {"__annotations__": annotations, "__module__": __name__}))
    yield_stress = hardening.make_yield_stress(real, Constants)
    increment, shortened = _return_mapping(real, Constants, yield_stress), math.sqrt(1.5)
    determinant, cof, heats = det(space), cofactor(space), hardening.heats
    law = Law(Constants, None, None, None, history=history)
    row = history_row(space, law)
    trial, size, flowed, rebased, moduli, in_space = elastic_kinematics(space, row)

    @wp.func
    def temperature(h: row) -> real:
        if wp.static(heats):
            return h[8]
        return real(0.0)

    @wp.func
    def flow(size: real, h: row, dt: real, c: Constants) -> pair:
        """Δ that a trial strain |dev e| causes, and the share of it that is left."""
        delta = increment(real(2.0) * real(shortened) * c.mu * size, h[6], temperature(h), dt, c)
        if delta == real(0.0):
            return pair(delta, real(1.0))
        return pair(delta, real(1.0) - real(shortened) * delta / size)

    @wp.func
    def flown(size: real, h: row, dt: real, c: Constants):
        """The history of a trial strain |dev e| but for its C_p⁻¹, the share of it that is left, what it dissipated."""
        found, T = flow(size, h, dt, c), temperature(h)
        delta, out, work = found[0], h, real(0.0)
        if delta != real(0.0):
            speed = delta / dt
            y = yield_stress(h[6], speed, T, c) + yield_stress(h[6] + delta, speed, T, c)
            work = real(0.5) * y * delta
            out[6] = h[6] + delta
            out[7] = h[7] + work
            if wp.static(heats):
                out[8] = h[8] + c.heating * work
        return out, found[1], work

    @wp.func
    def stress(F: mat, rate: mat, h: row, dt: real, c: Constants) -> mat:
        e = trial(F, h)
        tau = in_space(e) * (real(2.0) * c.mu * flow(wp.sqrt(wp.ddot(e, e)), h, dt, c)[1])
        J = determinant(F)
        for i in range(wp.static(dim)):
            tau[i, i] += c.kappa * wp.log(J)
        return (tau @ cof(F)) * (real(1.0) / J)

    @wp.func
    def stored(size: real, ln_J: real, c: Constants) -> real:
        return real(0.5) * c.kappa * ln_J * ln_J + c.mu * size * size

    @wp.func
    def energy(F: mat, h: row, c: Constants) -> real:
        return stored(size(F, h), wp.log(determinant(F)), c)

    @wp.func
    def wave_moduli(F: mat, h: row, c: Constants) -> pair:
        return moduli(F, h, c.kappa * wp.log(determinant(F)), c.mu, c.kappa)

    @wp.func
    def update(F: mat, rate: mat, h: row, dt: real, c: Constants):
        out, share, work = flown(size(F, h), h, dt, c)
        if share < real(1.0):
            out = flowed(F, out, share)
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
    law = law._replace(**parts, update=update, rebase=rebase)
    return law._replace(eights=_in_eights(space, law, flow, flown, stored))


def _in_eights(space: Space, law: Law, flow: wp.Function, flown: wp.Function, stored: wp.Function) -> Eights:
    """The law's stress, energy and update for eight particles at once."""
    real, mat, row, Constants = space.real, space.mat, history_row(space, law), law.Constants
    eight, Block = space.row(EIGHT), block_structure(mat, row)
    measure, stress_of, flow_of = plastic_eights(space, row)
    pair, two_eights, of_size = space.row(2), matrix_type(2, EIGHT, real), moduli_of_size(real)
    one_stress, one_energy, one_update, moduli_of = law.stress, law.energy, law.update, law.wave_moduli

    @wp.func
    def stress(block: Block, dt: real, c: Constants, P: wp.array(dtype=mat)):
        size, t, s = measure(block), eight(), eight()
        for k in range(block.count):
            t[k] = c.kappa * size[1, k]
            if size[0, k] == size[0, k]:
                s[k] = real(2.0) * c.mu * flow(size[0, k], block.history[block.own + k], dt, c)[1]
        stress_of(block, t, s, P)
        for k in range(block.count):
            if size[0, k] != size[0, k]:
                P[block.first + k] = one_stress(block.F[block.first + k], mat(), block.history[block.own + k], dt, c)

    @wp.func
    def energy(block: Block, c: Constants, out: wp.array(dtype=wp.float64)):
        size = measure(block)
        for k in range(block.count):
            if size[0, k] == size[0, k]:
                out[block.first + k] = wp.float64(stored(size[0, k], size[1, k], c))
            else:
                out[block.first + k] = wp.float64(one_energy(block.F[block.first + k], block.history[block.own + k], c))

    @wp.func
    def wave_moduli(block: Block, c: Constants) -> two_eights:
        size, out = measure(block), two_eights()
        for k in range(block.count):
            M = pair()
            if wp.static(space.dim == 3) and size[0, k] == size[0, k]:
                M = of_size(size[0, k], c.kappa * size[1, k], c.mu, c.kappa)
            else:
                M = moduli_of(block.F[block.first + k], block.history[block.own + k], c)
            out[0, k] = M[0]
            out[1, k] = M[1]
        return out

    @wp.func
    def update(block: Block, dt: real, c: Constants, lost: wp.array(dtype=real)):
        size, left = measure(block), eight()
        any_flows = bool(False)
        for k in range(block.count):
            left[k] = real(1.0)
            if size[0, k] == size[0, k]:
                h, share, work = flown(size[0, k], block.history[block.own + k], dt, c)
                left[k] = share
                if share < real(1.0):
                    any_flows = True
                block.history[block.own + k] = h
                lost[block.first + k] = work
            else:
                _F, h_k, work_k = one_update(block.F[block.first + k], mat(), block.history[block.own + k], dt, c)
                block.history[block.own + k] = h_k
                lost[block.first + k] = work_k
        if any_flows:
            flow_of(block, left)

    return Eights(stress, energy, wave_moduli, update)
