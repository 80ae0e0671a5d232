"""Potentials of an irregular arrangement (M13), and the area vectors of its free surfaces."""

import functools

import warp as wp

from ..atomics import lower_to
from ..execution import Launcher
from ..fields import neighbour_structure, structure
from ..operators.row_sums import laplacian_sum
from ..space import Space
from ..structs import StateArrays
from .exposure import share_of_face
from .health import WELL
from .reference import Configuration

# Share of the residual that a sweep corrects, by dimension: the reciprocal of the largest eigenvalue on a lattice,
# rounded down (at dilation 1.3, in 1-D at 1.2 too; `python -m warp_eulsph.validation.balance_sweeps`). What is
# corrected too far repels in tension, pairs in compression.
RELAXATION = {1: 0.52, 2: 0.75, 3: 0.85}

# A defect of more than a particle's own face is no irregularity: the body has opened there, or closed.
OPENED = 1.0


@functools.cache
def _make_renew(space: Space) -> wp.Kernel:
    """Kernel: s_a ← e_a where the body has opened or closed, which leaves nothing to balance there (M13).

    ``torn`` takes the place of the first particle with a new face.
    """
    real, vec, Reference = space.real, space.vec, structure(space, "Reference")
    share, most = share_of_face(space), OPENED**space.dim

    @wp.kernel(module="unique", enable_backward=False)
    def renew(
        first: int,
        reference: Reference,
        defect: wp.array(dtype=vec),
        surface: wp.array(dtype=vec),
        torn: wp.array(dtype=wp.int32),
    ):
        a = first + wp.tid()
        if share(defect[a], reference.V[a]) > real(most):
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


class Potentials:
    """ψ of an arrangement, and area vectors anew where a body has opened or closed.

    Attributes:
        psi: potentials [m], (n,) of vec; defect: e_a − s_a [m^(d−1)] that they are of, (n,) of vec.
        torn: place of the first particle with a new face, in an array of one.
    """

    def __init__(self, space: Space, sweeps: int, n: int, device: wp.DeviceLike):
        self.space, self.sweeps, self._launch = space, sweeps, Launcher(device)
        self.torn = wp.full(1, WELL, dtype=wp.int32, device=device)
        self.defect, self.psi, self._other = (wp.zeros(n, dtype=space.vec, device=device) for _ in range(3))

    def find(self, configuration: Configuration, state: StateArrays) -> None:
        """Of a new reference, whose L is still that of M3."""
        reference, near, simd = configuration.fields, configuration.near, configuration.simd
        n, K = len(self.psi), configuration.K
        configuration.defect(state.surface, self.defect)
        self._launch(_make_renew(self.space), n, [reference, self.defect, state.surface, self.torn])
        for sweep in range(self.sweeps):
            old, new = self.psi, self._other
            if (self.sweeps - sweep) % 2:  # the last sweep writes ψ, the others take turns
                old, new = new, old
            arguments = [reference, near, K, self.defect, old, new]
            self._launch(_make_relax(self.space, simd, sweep == 0), n, arguments)
