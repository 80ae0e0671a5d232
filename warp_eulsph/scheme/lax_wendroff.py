"""Two-step Lax-Wendroff for {p, F} on a movable reference: the paper's algorithms (§4.3) in one code path (M8)."""

from dataclasses import dataclass
from typing import ClassVar

from .balance import Balance
from .base import Scheme
from .dissipation import Upwind
from .limiter import FluxCorrectedTransport
from .shifting import Shifting
from .smoothing import Smoothing
from .stabiliser import Correction
from .stepper import Stepper
from .tie import Tie
from .tilt import Tilt
from .world import Parts


@dataclass(frozen=True)
class LaxWendroff(Scheme):
    """Options of the paper's scheme (M8): explicit midpoint with a smoothed half step. It needs CFL ≤ 0.4 in 3-D.

    Args:
        smoothing: S of the half step; None is the identity, which never gained energy at CFL 0.4; NeighbourAverage()
            is the paper's. Neither it nor LinearExact() is safe in bounded bodies.
        dissipation: M9; None leaves zero-energy modes undamped.
        correction: what makes arrangements stable that move with the reference: Balance() (M13), SurfaceVectors() (M10)
            or PairAreas() (M11, M12); None is the plain dual form, which pairs up in tension. Not used where nothing
            moves, where it is zero unless the bodies came with surface vectors.
        limiter: flux-corrected transport (paper §5), or None; d comes from its own sensor.
        shifting: what keeps moving arrangements even (M15), with Balance() or Uncorrected(); None shifts nothing.
        tie: what ties positions to F where the arrangement does not move (M16); None is the paper's.
        tilt: what pair weights are multiplied by near free faces, where the arrangement does not move (M17); None is
            the paper's.
    """

    smoothing: Smoothing | None = None
    dissipation: Upwind | None = Upwind()
    correction: Correction | None = Balance()
    limiter: FluxCorrectedTransport | None = None
    shifting: Shifting | None = None
    tie: Tie | None = None
    tilt: Tilt | None = None
    #: Tested Courant number; the limit is 0.5 in bounded 3-D bodies.
    cfl: ClassVar[float] = 0.4

    def build(self, parts: Parts) -> "LaxWendroffStepper":
        """The scheme at work."""
        return LaxWendroffStepper(self, parts)


class LaxWendroffStepper(Stepper):
    """M8 at work."""

    def advance(self) -> None:
        """Advance U on the present reference; a table of contents of M8."""
        U, half = self.U, self.half
        self._gradients(U)  # M4: ∇_k v, ∇_k F
        self._choose_dt(U)
        self._sense(U)  # §5: d of vⁿ for both half steps, and the diffusion of Uⁿ
        self._stress(U, 0.0)  # M1: Q = P F_kᵀ / J_k
        self._sum_forces(U, U, 0.0)  # M5, M9
        self._smooth(U, half)  # M6 or M7: S(U)
        self._predict(U, half, 0.5)  # M8: U^{n+½}
        self._impose(half, 0.5)
        self._velocity_gradient(half)  # M4
        self._stress(half, 0.5)  # M1
        self._sum_forces(half, half, 0.5)  # M5, M9
        self._kick(U)  # M8: v^{n+1}
        self._drift(U, half, 1.0, U)  # M8: F^{n+1}, x^{n+1}
        self._limit(U)  # §5: U^{n+1} += d × diffusion
        self._release(U)  # the free velocity, for the reactions
        self._impose(U, 1.0)
        self._update(U)  # histories; liquids keep J only
        self._check(U)
        self.ledger.record(U, half)
        self.clock.tick()
