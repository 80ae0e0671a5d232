"""Soil, sand, rock: Drucker and Prager's cone with tension cut-off, return mapping in logarithmic strains."""

import functools
import math
from dataclasses import dataclass
from typing import ClassVar

import warp as wp

from ..linalg import det, inverse
from ..space import Space
from .base import Isotropic, Law, Variable, history_row, lame_constants
from .hardening import not_negative
from .j2 import STRAIN, WORK
from .plastic_metric import METRIC, elastic_kinematics

HISTORY = (
    METRIC,
    STRAIN,
    WORK,
    Variable("plastic_volume", "-", "plastic part of ln J: what dilated and what is open"),
    Variable(
        "opening", "-", "part of plastic_volume that the tension cut-off opened and that closes freely", least=0.0
    ),
    Variable(
        "shear_share", "-", "least share so far of the elastic stiffness in shear, by which the tie holds", 1.0, 0.0
    ),
)


@dataclass(frozen=True, kw_only=True)
class DruckerPrager(Isotropic):
    """Hencky's elasticity as that of ``J2`` that yields where q + A t = k, q = √(3/2) |dev τ|, t = tr τ/3, or t = T.

    A = 6 sin φ/(3 − sin φ) and k = 6 c cos φ/(3 − sin φ), so that strength in triaxial compression is Mohr and
    Coulomb's (Drucker & Prager, Quart. Appl. Math. 10, 1952); in plane strain that keeps volume it is 2√3/(3 − sin φ)
    times theirs, 1.39 at 30°. Plastic shear of α dilates by B α, B = 6 sin ψ/(3 − sin ψ) (M26 in docs/method.md, §8).
    What tension opened closes again without stress before pressure is borne. Strength is perfect: it neither grows nor
    falls. Its history: ``plastic_metric``, ``plastic_strain`` (of shear), ``plastic_work``, ``plastic_volume``,
    ``opening``, ``shear_share``.

    Args:
        density: initial density [kg/m³].
        young: Young's modulus [Pa].
        poisson: Poisson's ratio, in (−1, 0.5).
        friction: angle of internal friction φ [degrees], in [0, 90).
        cohesion: c [Pa].
        dilation: angle of dilation ψ [degrees], in [0, φ]; φ is the associated flow rule, 0 keeps volume.
        tension: least mean stress in tension that opens it, T [Pa]; None is that of the cone's apex, k/A, the most.
    """

    friction: float
    cohesion: float = 0.0
    dilation: float = 0.0
    tension: float | None = None
    yields: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        not_negative("cohesion", self.cohesion, "Pa")
        if not 0.0 <= self.friction < 90.0:
            raise ValueError(f"friction must be an angle in [0, 90) degrees, got {self.friction}; sand has 30 to 40")
        if not 0.0 <= self.dilation <= self.friction:
            raise ValueError(
                f"dilation must be an angle in [0, friction = {self.friction}] degrees, got {self.dilation}; "
                "more would make energy"
            )
        if self.friction == self.cohesion == 0.0:
            raise ValueError("friction and cohesion are both 0: what bears no shear is a liquid, see TaitLiquid")
        if self.tension is not None:
            not_negative("tension", self.tension, "Pa")

    def constants(self) -> dict[str, float]:
        mu, kappa = lame_constants(self.young, self.poisson)
        sine, cosine = (f(math.radians(self.friction)) for f in (math.sin, math.cos))
        flow = math.sin(math.radians(self.dilation))
        A, k, B = 6.0 * sine / (3.0 - sine), 6.0 * self.cohesion * cosine / (3.0 - sine), 6.0 * flow / (3.0 - flow)
        apex = k / A if A > 0.0 else math.inf
        return {
            "mu": mu,
            "kappa": kappa,
            "A": A,
            "B": B,
            "k": k,
            "T": apex if self.tension is None else min(self.tension, apex),
        }

    def law(self, space: Space) -> Law:
        return _law(space)


@functools.cache
def _law(space: Space) -> Law:
    real, mat, pair, four = space.real, space.mat, space.row(2), space.row(4)
    determinant, invert = det(space), inverse(space)

    @wp.struct
    class Constants:
        mu: real
        kappa: real
        A: real
        B: real
        k: real
        T: real

    law = Law(Constants, None, None, None, history=HISTORY)
    row = history_row(space, law)
    trial, size, flowed, rebased, moduli, in_space = elastic_kinematics(space, row)

    @wp.func
    def elastic_volume(F: mat, h: row) -> real:
        """ln J less its plastic part."""
        return wp.log(determinant(F)) - h[8]

    @wp.func
    def onto_surface(q: real, t: real, c: Constants) -> pair:
        """Trial q and t -> those on the cone along its flow, or at the cut-off, or within as they are."""
        out = pair(q, t)
        beyond = q + c.A * t - c.k
        if beyond > real(0.0):
            out[1] = t - c.kappa * c.B * beyond / (real(3.0) * c.mu + c.A * c.B * c.kappa)
            out[0] = c.k - c.A * out[1]
        if out[1] > c.T:
            out = pair(wp.min(q, c.k - c.A * c.T), c.T)
        return out

    @wp.func
    def returned(q: real, t: real, opening: real, c: Constants) -> four:
        """Trial q and t -> q and t after the return; how much of the opening closed, and how much opened."""
        onto, closed, opened = onto_surface(q, t, c), real(0.0), real(0.0)
        if onto[1] < real(0.0) and opening > real(0.0):  # nothing presses before it has closed
            free = wp.min(q, c.k)
            closed = c.B * (q - free) / (real(3.0) * c.mu) - t / c.kappa
            if closed <= opening:
                return four(free, real(0.0), closed, opened)
            closed = opening
            onto = onto_surface(q, t + c.kappa * opening, c)
        if onto[1] == c.T:
            opened = (t - c.T) / c.kappa + closed - c.B * (q - onto[0]) / (real(3.0) * c.mu)
        return four(onto[0], onto[1], closed, opened)

    @wp.func
    def mises(size: real, c: Constants) -> real:
        return wp.sqrt(real(6.0)) * c.mu * size

    @wp.func
    def stress(F: mat, rate: mat, h: row, dt: real, c: Constants) -> mat:
        e = trial(F, h)
        q, t = mises(wp.sqrt(wp.ddot(e, e)), c), c.kappa * elastic_volume(F, h)
        share = real(1.0)
        if dt > real(0.0):
            onto = returned(q, t, h[9], c)
            t = onto[1]
            if onto[0] < q:
                share = onto[0] / q
        tau = wp.identity(n=wp.static(space.dim), dtype=real) * t + in_space(e) * (real(2.0) * c.mu * share)
        return tau @ wp.transpose(invert(F))

    @wp.func
    def energy(F: mat, h: row, c: Constants) -> real:
        e, volumetric = size(F, h), elastic_volume(F, h)
        return real(0.5) * c.kappa * volumetric * volumetric + c.mu * e * e

    @wp.func
    def wave_moduli(F: mat, h: row, c: Constants) -> pair:
        return moduli(F, h, c.kappa * elastic_volume(F, h), c.mu, c.kappa)

    @wp.func
    def update(F: mat, rate: mat, h: row, dt: real, c: Constants):
        q, t = mises(size(F, h), c), c.kappa * elastic_volume(F, h)
        onto = returned(q, t, h[9], c)
        if onto[0] >= q and onto[1] == t:
            return F, h, real(0.0)
        out = h
        alpha = real(0.0)
        if onto[0] < q:
            alpha = (q - onto[0]) / (real(3.0) * c.mu)
            out = flowed(F, h, onto[0] / q)
            out[6] = h[6] + alpha
            bears = wp.max(c.k - c.A * onto[1], real(0.0))
            out[10] = wp.min(h[10], bears / (bears + real(3.0) * c.mu * out[6]))
        spread = (t - onto[1]) / c.kappa
        work = onto[0] * alpha + onto[1] * (spread + onto[2])  # closing takes none
        out[7] = h[7] + work
        out[8] = h[8] + spread
        out[9] = wp.max(h[9] - onto[2] + onto[3], real(0.0))
        return F, out, work

    @wp.func
    def rebase(F: mat, h: row, c: Constants):
        F_e, out = rebased(F, h)
        return F_e, out

    @wp.func
    def secant(h: row, c: Constants) -> real:
        return h[10]

    parts = {"stress": stress, "energy": energy, "wave_moduli": wave_moduli, "secant": secant}
    return law._replace(**parts, update=update, rebase=rebase)
