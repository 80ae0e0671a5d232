"""Metal plasticity at finite strain: von Mises' yield condition, return mapping in logarithmic strains."""

import functools
import math
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..linalg import det, inverse, reciprocal_cube_root, symmetric_bounds
from ..space import Space, matrix_type
from .base import Isotropic, Law, Variable, history_row, lame_constants
from .hardening import Hardening
from .log_strain import deviatoric_logarithm, exponential

METRIC = Variable(
    "plastic_metric",
    "-",
    "inverse plastic metric C_p^-1 since the last rebasing, out-of-plane parts included",
    start=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0),
)
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
def in_three_dimensions(space: Space) -> wp.Function:
    """``wp.func`` F with the missing stretches of one, 3 × 3."""
    mat, full, real, dim = space.mat, matrix_type(3, 3, space.real), space.real, space.dim

    @wp.func
    def in_three_dimensions(F: mat) -> full:
        out = wp.identity(n=3, dtype=real)
        for i in range(wp.static(dim)):
            for j in range(wp.static(dim)):
                out[i, j] = F[i, j]
        return out

    return in_three_dimensions


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
    determinant, invert, bounds = det(space), inverse(space), symmetric_bounds(space)
    logarithm, exp, root = deviatoric_logarithm(real), exponential(real), reciprocal_cube_root(real)
    extended, heats = in_three_dimensions(space), hardening.heats
    law = Law(Constants, None, None, None, history=history)
    row = history_row(space, law)

    @wp.func
    def left_elastic(F: mat, h: row) -> full:
        """b_e = F C_p⁻¹ Fᵀ."""
        G = extended(F)
        return G @ full(h[0], h[3], h[4], h[3], h[1], h[5], h[4], h[5], h[2]) @ wp.transpose(G)

    @wp.func
    def temperature(h: row) -> real:
        if wp.static(heats):
            return h[8]
        return real(0.0)

    @wp.func
    def in_space(A: full) -> mat:
        out = mat()
        for i in range(wp.static(dim)):
            for j in range(wp.static(dim)):
                out[i, j] = A[i, j]
        return out

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
        e = logarithm(left_elastic(F, h)) * real(0.5)
        e = e * (real(2.0) * c.mu * flow(e, h, dt, c)[1])
        pressure = wp.identity(n=wp.static(dim), dtype=real) * (c.kappa * wp.log(determinant(F)))
        tau = pressure + in_space(e)
        return tau @ wp.transpose(invert(F))

    @wp.func
    def energy(F: mat, h: row, c: Constants) -> real:
        e = logarithm(left_elastic(F, h)) * real(0.5)
        volumetric = wp.log(determinant(F))
        return real(0.5) * c.kappa * volumetric * volumetric + c.mu * wp.ddot(e, e)

    @wp.func
    def wave_moduli(F: mat, h: row, c: Constants) -> pair:
        # Along principal directions κ + 4/3 μ − τ_i, and μ x/(1 − e^(−x)) with x = 2 (e_i − e_j) for shear
        J = determinant(F)
        b = bounds(in_space(left_elastic(F, h)))
        largest = wp.log(b[1])
        least = b[0]
        if wp.static(dim == 3):
            least = wp.max(least, J * J / (b[1] * b[1]))  # the bound may be negative, the determinant is J²
        least = wp.log(least)
        volumetric = wp.log(J)
        spread = largest - least
        tau = c.kappa * volumetric + c.mu * (least - real(2.0) / real(3.0) * volumetric)
        shear = c.mu * (real(1.0) + spread)
        M = c.kappa + real(4.0) / real(3.0) * c.mu * (real(1.0) + real(0.25) * spread * spread)
        return pair(wp.max(M - tau, shear), shear)

    @wp.func
    def update(F: mat, rate: mat, h: row, dt: real, c: Constants):
        e = logarithm(left_elastic(F, h)) * real(0.5)
        found = flow(e, h, dt, c)
        delta = found[0]
        if delta == real(0.0):
            return F, h, real(0.0)
        speed = delta / dt
        T = temperature(h)
        y = yield_stress(h[6], speed, T, c) + yield_stress(h[6] + delta, speed, T, c)
        work = real(0.5) * y * delta
        J = determinant(F)
        G = wp.inverse(extended(F)) * (J * root(J) * root(J))
        C = G @ exp(e * (real(2.0) * found[1])) @ wp.transpose(G)
        out = h
        for k in range(3):
            out[k] = C[k, k]
        out[3] = C[0, 1]
        out[4] = C[0, 2]
        out[5] = C[1, 2]
        out[6] = h[6] + delta
        out[7] = h[7] + work
        if wp.static(heats):
            out[8] = h[8] + c.heating * work
        return F, out, work

    @wp.func
    def rebase(F: mat, h: row, c: Constants):
        out = h
        F_e = F
        if wp.static(dim > 1):
            J = determinant(F)
            V = exp(logarithm(left_elastic(F, h)) * real(0.5)) * (J * root(J) * root(J))
            s = real(1.0)
            if wp.static(dim == 2):
                s = wp.sqrt(V[2, 2])  # so that det F stays J
            F_e = in_space(V) * s
            for k in range(6):
                out[k] = real(0.0)
            out[0] = real(1.0) / (s * s)
            out[1] = out[0]
            out[2] = s * s * s * s
        return F_e, out

    @wp.func
    def secant(h: row, c: Constants) -> real:
        """Stress over total strain of monotonous loading, y/(y + 3μ α), that of slow flow."""
        y = yield_stress(h[6], real(0.0), temperature(h), c)
        return y / (y + real(3.0) * c.mu * h[6])

    parts = {"stress": stress, "energy": energy, "wave_moduli": wave_moduli, "secant": secant}
    return law._replace(**parts, update=update, rebase=rebase)
