"""Balanced pair vectors (M13): what closes the sums of a moving reference without touching its conservation laws."""

import functools
import math
from dataclasses import dataclass

import warp as wp

from ..atomics import lower_to
from ..fields import neighbour_structure, structure
from ..linalg import det, inverse
from ..operators.row_sums import laplacian_sum, outer_sum
from ..space import Space
from ..structs import ParticleArrays, StateArrays
from .dissipation import UpwindForces
from .flux import Flux
from .health import WELL
from .reference import Configuration, reference_spacing
from .stabiliser import Correction

# Share of the residual that a sweep corrects, by dimension: the reciprocal of the largest eigenvalue on a lattice,
# rounded down (at dilation 1.3, in 1-D at 1.2 too; `python -m warp_eulsph.validation.balance_sweeps`). What is
# corrected too far repels in tension, pairs in compression.
RELAXATION = {1: 0.52, 2: 0.75, 3: 0.85}

# A defect of more than a particle's own face is no irregularity: the body has opened there, or closed.
OPENED = 1.0


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
def _make_renew(space: Space) -> wp.Kernel:
    """Kernel: s_a ← e_a where the body has opened or closed, which leaves nothing to balance there (M13).

    ``torn`` takes the place of the first particle with a new face.
    """
    real, vec = space.real, space.vec
    Reference, dim = structure(space, "Reference"), space.dim
    most = OPENED**dim

    @wp.kernel(module="unique", enable_backward=False)
    def renew(
        first: int,
        reference: Reference,
        defect: wp.array(dtype=vec),
        surface: wp.array(dtype=vec),
        torn: wp.array(dtype=wp.int32),
    ):
        a = first + wp.tid()
        opening = wp.length(defect[a])  # |d|ᵈ/Vᵈ⁻¹, the d-th power of |d| over the face: no root to take
        for _ in range(wp.static(dim - 1)):
            opening *= wp.length(defect[a]) / reference.V[a]
        if opening > real(most):
            if wp.length(surface[a] + defect[a]) > wp.length(surface[a]):
                lower_to(torn, a)
            surface[a] = surface[a] + defect[a]
            defect[a] = vec()

    return renew


@functools.cache
def _make_relax(space: Space, simd: bool, start: bool) -> wp.Kernel:
    """Kernel: one sweep of damped Jacobi on Σ_b ω_ab (ψ_a − ψ_b) = K_a d_a, ω_ab = V_a V_b g_ab (M13).

    K_a, because the force of shifted positions comes multiplied by L = K⁻¹. With ``start`` the sweep is the first, from
    ψ = 0, whose sums are zero.
    """
    real, vec, mat = space.real, space.vec, space.mat
    relaxation = RELAXATION[space.dim]
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    sum_of = laplacian_sum(space, simd)

    @wp.kernel(module="unique", enable_backward=False)
    def relax(
        first: int,
        reference: Reference,
        near: Neighbours,
        K: wp.array(dtype=mat),
        defect: wp.array(dtype=vec),
        psi: wp.array(dtype=vec),
        out: wp.array(dtype=vec),
    ):
        a = first + wp.tid()
        psi_a = vec()
        residual = K[a] @ defect[a] / reference.V[a]
        if wp.static(not start):
            psi_a = psi[a]
            residual += sum_of(a, near, psi, reference.diagonal)
        if reference.diagonal[a] > real(0.0):
            psi_a += residual * (real(relaxation) / reference.diagonal[a])
        out[a] = psi_a

    return relax


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

    def __init__(self, option: Balance, space: Space, particles: ParticleArrays, device: wp.DeviceLike):
        super().__init__(space, device)
        self.option, self.particles, n = option, particles, len(particles.mass)
        self.torn = wp.full(1, WELL, dtype=wp.int32, device=device)
        self.defect, self.psi, self._other = (wp.zeros(n, dtype=space.vec, device=device) for _ in range(3))

    def evolving(self) -> dict[str, wp.array]:
        """The potentials that shifting (M15) follows before the next refresh."""
        return {"BalancedPairs.psi": self.psi}

    def refresh(self, configuration: Configuration, state: StateArrays) -> None:
        """Balance the new reference."""
        reference, near, simd = configuration.fields, configuration.near, configuration.simd
        n, K = len(self.psi), configuration.K
        configuration.defect(state.surface, self.defect)
        self._launch(_make_renew(self.space), n, [reference, self.defect, state.surface, self.torn])
        for sweep in range(self.option.sweeps):
            old, new = self.psi, self._other
            if (self.option.sweeps - sweep) % 2:  # the last sweep writes ψ, the others take turns
                old, new = new, old
            arguments = [reference, near, K, self.defect, old, new]
            self._launch(_make_relax(self.space, simd, sweep == 0), n, arguments)
        self._launch(_make_shift(self.space), n, [self.particles, reference, self.psi, self.option.bound])
        self._launch(_make_correct(self.space, simd), n, [reference, near, K, configuration.poor])
