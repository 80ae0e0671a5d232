"""The two-step scheme with the new velocity in the full step of F: Störmer-Verlet on a movable reference (M14)."""

import functools
from dataclasses import dataclass
from typing import ClassVar

import warp as wp

from ..space import Space
from ..structs import StateArrays
from .balance import Balance
from .base import Scheme
from .dissipation import Upwind
from .limiter import FluxCorrectedTransport
from .shifting import Shifting
from .stabiliser import Correction
from .stepper import Stepper
from .tie import Tie
from .tilt import Tilt
from .world import Parts


@dataclass(frozen=True)
class Verlet(Scheme):
    """Lax-Wendroff's two steps, but F^{n+1} and x^{n+1} move with ½(vⁿ + v^{n+1}) instead of v^{n+½} (M14).

    One evaluation of the forces per step instead of two; free of the midpoint rule's growth, so that the stable step is
    two to three times as long; angular momentum exact where F is the gradient of the motion.

    Args:
        dissipation: M9; None leaves zero-energy modes undamped.
        correction: what makes arrangements stable that move with the reference: Balance() (M13), SurfaceVectors() (M10)
            or PairAreas() (M11, M12); None is the plain dual form, which pairs up in tension. Not used where nothing
            moves, where it is zero unless the bodies came with surface vectors.
        limiter: flux-corrected transport (paper §5), or None; d comes from its own sensor.
        shifting: what keeps moving arrangements even (M15), with Balance() only; None shifts nothing.
        tie: what ties positions to F where the arrangement does not move (M16); None leaves hourglass modes free.
        tilt: what pair weights are multiplied by near free faces, where the arrangement does not move (M17); None
            leaves coarse bodies soft.
    """

    dissipation: Upwind | None = Upwind()
    correction: Correction | None = Balance()
    limiter: FluxCorrectedTransport | None = None
    shifting: Shifting | None = None
    tie: Tie | None = Tie()
    tilt: Tilt | None = Tilt()
    #: Tested Courant number; the limit is 1.1 to 1.3 in bounded 3-D bodies.
    cfl: ClassVar[float] = 0.8

    def build(self, parts: Parts) -> "VerletStepper":
        """The scheme at work."""
        return VerletStepper(self, parts)


@functools.cache
def _make_mean(space: Space) -> wp.Kernel:
    """Kernel: v ← ½(v + v_new)."""
    real, vec = space.real, space.vec

    @wp.kernel(module="unique", enable_backward=False)
    def mean(first: int, v_new: wp.array(dtype=vec), v: wp.array(dtype=vec)):
        a = first + wp.tid()
        v[a] = (v[a] + v_new[a]) * real(0.5)

    return mean


class VerletStepper(Stepper):
    """M14 at work."""

    def advance(self) -> None:
        """Advance U on the present reference; a table of contents of M14."""
        U, half = self.U, self.half
        self._velocity_gradient(U)  # M4: ∇_k vⁿ
        self._choose_dt(U)
        self._sense(U)  # §5: d of vⁿ, and the diffusion of Uⁿ
        self._start_mean(U, half)  # vⁿ into v̄
        self._drift(U, U, 0.5, half)  # M14: F^{n+½}, x^{n+½}
        self._impose(half, 0.5)
        self._stress(half, 0.5)  # M1
        self._sum_forces(half, U, 0.5)  # M5 of F^{n+½}, M9 of vⁿ
        self._kick(U)  # M14: v^{n+1}
        self._finish_mean(U, half)  # v̄ = ½(vⁿ + v^{n+1})
        self._impose(half, 0.5)
        self._velocity_gradient(half)  # M4: ∇_k v̄
        self._drift(U, half, 1.0, U)  # M14: F^{n+1}, x^{n+1}
        self._limit(U)  # §5: U^{n+1} += d × diffusion
        self._release(U)  # the free velocity, for the reactions
        self._impose(U, 1.0)
        self._update(U)  # histories; liquids keep J only
        self._check(U)
        self.ledger.record(U, half)
        self.clock.tick()

    def _start_mean(self, U: StateArrays, half: StateArrays) -> None:
        wp.copy(half.v, U.v)

    def _finish_mean(self, U: StateArrays, half: StateArrays) -> None:
        self._launch(_make_mean(self.space), self.n, [U.v, half.v])
