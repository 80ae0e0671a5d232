"""Balanced pair vectors (M13): what closes the sums of a moving reference without touching its conservation laws."""

import functools
import math
from dataclasses import dataclass

import warp as wp

from ..fields import neighbour_structure, structure
from ..linalg import det, inverse
from ..operators.row_sums import outer_sum
from ..space import Space
from ..structs import ParticleArrays, StateArrays
from .dissipation import UpwindForces
from .flux import Flux
from .potentials import Potentials
from .reference import Configuration, reference_spacing
from .stabiliser import Correction


@dataclass(frozen=True)
class Balance(Correction):
    """Pair vectors of M4 and M5 from x̂ = x − ½ψ; ψ relaxes to Σ_b ω_ab (ψ_a − ψ_b) = K_a (e_a − s_a) (M13).

    M4 stays exact for linear fields, M5 its adjoint: linear and angular momentum and energy are conserved as without
    it, whatever x̂ is, while the force that a uniform stress exerts on an irregular arrangement loses its short waves,
    which are the ones that pair particles up. Where e_a − s_a exceeds the particle's own face, the body has opened
    or closed: s_a becomes e_a, a free surface or none.

    Args:
        sweeps: relaxation sweeps per refresh, from ψ = 0.
        bound: largest |x̂ − x| over the particle's spacing in the reference.
    """

    sweeps: int = 5
    bound: float = 0.25
    has_potentials = True

    def __post_init__(self) -> None:
        if self.sweeps < 1:
            raise ValueError(f"sweeps must be at least 1, got {self.sweeps}; correction=None balances nothing")
        if not (math.isfinite(self.bound) and 0.0 < self.bound <= 0.25):
            raise ValueError(f"bound must be in (0, 0.25] spacings, got {self.bound}; 0.25 is the tested value")

    def build(self, space: Space, particles: ParticleArrays, flux: Flux, device: wp.DeviceLike) -> "BalancedPairs":
        """Allocate."""
        return BalancedPairs(self, space, particles, device)


@functools.cache
def _make_shift(space: Space) -> wp.Kernel:
    """Kernel: x̂ = x − ½ψ, not further away than ``bound`` spacings (M13)."""
    real, vec = space.real, space.vec
    Particles, Reference = structure(space, "Particles"), structure(space, "Reference")
    spacing_of = reference_spacing(space)

    @wp.kernel(module="unique", enable_backward=False)
    def shift(first: int, particles: Particles, reference: Reference, psi: wp.array(dtype=vec), bound: real):
        a = first + wp.tid()
        away, most = psi[a] * real(0.5), bound * spacing_of(a, particles, reference)
        if wp.length(away) > most:
            away = away * (most / wp.length(away))
        reference.balanced[a] = reference.x[a] - away

    return shift


@functools.cache
def _make_correct(space: Space, simd: bool) -> wp.Kernel:
    """Kernel: L_a = (Σ_b V_b g_ab ξ ⊗ ξ̂)⁻¹ with ξ̂ between balanced positions: M4 stays exact for linear fields (M13).

    Where the sum has lost half of det K, or K a direction, in neighbourhoods nearly flat, L_a stays that of M3.
    """
    real, mat = space.real, space.mat
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    sum_of, invert, determinant = outer_sum(space, simd, of_positions=True), inverse(space), det(space)

    @wp.kernel(module="unique", enable_backward=False)
    def correct_balanced(
        first: int, reference: Reference, near: Neighbours, K: wp.array(dtype=mat), poor: wp.array(dtype=wp.int32)
    ):
        a = first + wp.tid()
        sums = sum_of(a, near, reference.x, reference.balanced)
        if poor[a] == 0 and determinant(sums) > real(0.5) * determinant(K[a]):
            reference.L[a] = invert(sums)

    return correct_balanced


class BalancedPairs(UpwindForces):
    """M13 at work: it acts on the reference, and leaves no force of its own beside M9."""

    balances = True

    def __init__(self, option: Balance, space: Space, particles: ParticleArrays, device: wp.DeviceLike):
        super().__init__(space, device)
        self.option, self.particles = option, particles
        self.potentials = Potentials(space, option.sweeps, len(particles.mass), device)

    def evolving(self) -> dict[str, wp.array]:
        """The potentials that shifting (M15) follows before the next refresh."""
        return {"BalancedPairs.psi": self.potentials.psi}

    def refresh(self, configuration: Configuration, state: StateArrays) -> None:
        """Balance the new reference."""
        reference, near, simd = configuration.fields, configuration.near, configuration.simd
        self.potentials.find(configuration, state)
        psi, n, K = self.potentials.psi, len(self.potentials.psi), configuration.K
        self._launch(_make_shift(self.space), n, [self.particles, reference, psi, self.option.bound])
        self._launch(_make_correct(self.space, simd), n, [reference, near, K, configuration.poor])
