"""The two-step scheme with the new velocity in the full step of F: Störmer-Verlet on a movable reference (M14)."""

from dataclasses import dataclass
from typing import ClassVar

import warp as wp

from ..structs import StateArrays
from .balance import Balance
from .base import Scheme
from .dissipation import Upwind
from .limiter import FluxCorrectedTransport
from .sharpening import Sharpening
from .shifting import Shifting
from .stabiliser import Correction
from .stepper import Stepper
from .tie import Tie
from .tilt import Tilt
from .updates import make_mean
from .world import Parts


@dataclass(frozen=True)
class Verlet(Scheme):
    """Lax-Wendroff's two steps, but F^{n+1} and x^{n+1} move with ½(vⁿ + v^{n+1}) instead of v^{n+½} (M14).

    One evaluation of the forces per step instead of two; free of the midpoint rule's growth, so that the stable step is
    two to three times as long; angular momentum exact where F is the gradient of the motion.

    Args:
        dissipation: M9; None leaves zero-energy modes undamped.
        correction: what makes arrangements stable that move with the reference: Balance() (M13), SurfaceVectors()
            (M10), PairAreas() (M11, M12), or under pressure PlainVolume() (M29); None is the plain dual form, which
            pairs up in tension. Not used where nothing moves, where it is zero unless the bodies came with surface
            vectors.
        limiter: flux-corrected transport (paper §5), or None; d comes from its own sensor.
        shifting: what keeps moving arrangements even (M15), with Balance() or Uncorrected(); None shifts nothing.
        tie: what ties positions to F where the arrangement does not move (M16); None leaves hourglass modes free.
        tilt: what pair weights are multiplied by near free faces, where the arrangement does not move (M17); None
            leaves coarse bodies soft.
        sharpening: what takes the second-order error out of gradients and forces, where the arrangement does not move
            (M23); None leaves waves dispersed and coarse bodies softer.
    """

    dissipation: Upwind | None = Upwind()
    correction: Correction | None = Balance()
    limiter: FluxCorrectedTransport | None = None
    shifting: Shifting | None = None
    tie: Tie | None = Tie()
    tilt: Tilt | None = Tilt()
    sharpening: Sharpening | None = Sharpening()
    #: Tested Courant number; the limit is 1.1 to 1.3 in bounded 3-D bodies.
    cfl: ClassVar[float] = 0.8

    def build(self, parts: Parts) -> "VerletStepper":
        """The scheme at work."""
        return VerletStepper(self, parts)


class VerletStepper(Stepper):
    """M14 at work, by one gradient a step in media whose conditions are steady and by two in others."""

    keeps_gradient = True

    def advance(self) -> None:
        """Advance U on the present reference; a table of contents of M14."""
        U, half = self.U, self.half
        self._known_gradient(U)  # M4: ∇_k vⁿ
        self._choose_dt(U)
        self._sense(U)  # §5: d of vⁿ, and the diffusion of Uⁿ
        self._start_mean(U, half)  # vⁿ into v̄
        self._drift(U, U, 0.5, half)  # M14: F^{n+½}, x^{n+½}
        self._impose(half, 0.5, steady=False)
        self._stress(half, 0.5)  # M1
        self._sum_forces(half, U, 0.5)  # M5 of F^{n+½}, M9 of vⁿ
        self._kick(U)  # M14: v^{n+1}
        self._release(U, steady=True)  # the free velocity, for the reactions
        self._impose(U, 1.0, steady=True)
        self._finish_mean(U, half)  # v̄ = ½(vⁿ + v^{n+1})
        self._impose(half, 0.5, steady=False)
        self._mean_gradient(U, half)  # M4: ∇_k v̄, by ∇_k v^{n+1} for the next step where all is steady
        self._drift(U, half, 1.0, U)  # M14: F^{n+1}, x^{n+1}
        self._limit(U)  # §5: U^{n+1} += d × diffusion
        self._release(U, steady=False)
        self._impose(U, 1.0, steady=False)
        self._update(U)  # histories; liquids keep J only
        self._check(U)
        self.ledger.record(U, half)
        self.clock.tick()

    def _start_mean(self, U: StateArrays, half: StateArrays) -> None:
        wp.copy(half.v, U.v)

    def _finish_mean(self, U: StateArrays, half: StateArrays) -> None:
        self._launch(make_mean(self.space, "vec"), self.n, [U.v, half.v])
