"""Two-step Lax-Wendroff for {p, F} on a movable reference: the paper's algorithms (§4.3) in one code path (M8)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import warp as wp

from ..boundaries import Bound
from ..execution import Launcher
from ..fields import allocate, arrays, repeated
from ..space import Space
from .balance import Balance
from .dissipation import Upwind, UpwindForces
from .flux import Flux
from .health import check
from .ledger import Ledger
from .limiter import FluxCorrectedTransport, MassDiffusion
from .reference import Configuration, ReferencePolicy
from .sensor import SensorField
from .shifting import Shifter, Shifting
from .smoothing import Smoothing
from .stabiliser import Stabiliser
from .tie import Tie, TiedPairs
from .time_step import DeviceClock
from .updates import make_drift, make_kick, make_predict


@dataclass(frozen=True)
class LaxWendroff:
    """Options of the paper's scheme (M8): explicit midpoint with a smoothed half step. It needs CFL ≤ 0.4 in 3-D.

    Args:
        smoothing: S of the half step; None is the identity, which never gained energy at CFL 0.4; NeighbourAverage()
            is the paper's. Neither it nor LinearExact() is safe in bounded bodies.
        dissipation: M9; None leaves zero-energy modes undamped.
        correction: what makes arrangements stable that move with the reference: Balance() (M13), SurfaceVectors() (M10)
            or PairAreas() (M11, M12); None is the plain dual form, which pairs up in tension. Not used where nothing
            moves, where it is zero unless the bodies came with surface vectors.
        limiter: flux-corrected transport (paper §5), or None; d comes from its own sensor.
        shifting: what keeps moving arrangements even (M15), with Balance() only; None shifts nothing.
        tie: what ties positions to F where the arrangement does not move (M16); None is the paper's.
    """

    smoothing: Smoothing | None = None
    dissipation: Upwind | None = Upwind()
    correction: Any = Balance()
    limiter: FluxCorrectedTransport | None = None
    shifting: Shifting | None = None
    tie: Tie | None = None
    #: Tested Courant number; the limit is 0.5 in bounded 3-D bodies.
    cfl: ClassVar[float] = 0.4

    def __post_init__(self) -> None:
        check_shifting(self.shifting, self.correction)

    def build(self, *parts: Any) -> "LaxWendroffStepper":
        """The scheme at work; ``parts`` are the arguments of the stepper after its options."""
        return LaxWendroffStepper(self, *parts)


def is_corrected(options: Any, policy: ReferencePolicy, surface_given: bool) -> bool:
    """Whether the scheme's correction is at work: a fixed reference needs it only where surface vectors were given."""
    return options.correction is not None and (surface_given or not policy.fixed)


def check_shifting(shifting: Shifting | None, correction: Any) -> None:
    """Raise ValueError unless the correction has the potentials that shifting follows."""
    if shifting is not None and not isinstance(correction, Balance):
        raise ValueError(f"shifting needs correction=Balance(), whose potentials it follows, got {correction}")


class LaxWendroffStepper:
    """The scheme at work on one set of particles.

    Attributes:
        options: LaxWendroff, or those of a scheme that shares its parts.
        U: state at tⁿ (struct ``State``); ``half``: state at t^{n+½}.
        configuration: the reference k. clock: time on the device. ledger: where the energy went.
    """

    def __init__(
        self,
        options: Any,
        space: Space,
        U: Any,
        particles: Any,
        flux: Flux,
        configuration: Configuration,
        policy: ReferencePolicy,
        clock: DeviceClock,
        conditions: Sequence[Bound],
        surface_given: bool,
        moving: list[bool],
    ):
        moving_bodies = [body for body, moves in zip(flux.bodies, moving, strict=True) if moves]
        n, device = len(U.x), flux.device
        self.options, self.space, self.device, self.n = options, space, device, n
        self._launch = Launcher(device)
        # A fixed reference has no use for surface vectors, and most conditions have none
        self.moves_surfaces = not policy.fixed or any(condition.reads_surface for condition in conditions)
        self.U, self.half = U, allocate(space, "State", n, device, empty=() if self.moves_surfaces else ("surface",))
        if not self.moves_surfaces:
            self.half.surface = U.surface
        self.particles, self.flux, self.configuration = particles, flux, configuration
        self.policy, self.clock, self.conditions, self.moving = policy, clock, conditions, moving
        self.forces = allocate(space, "Forces", n, device, empty=("correction", "tie", "external"))
        self.grad_v = wp.zeros(n, dtype=space.mat, device=device)
        self.shifter: Shifter | None = None
        if options.shifting is not None and not policy.fixed:
            self.shifter = options.shifting.build(space, particles, flux, moving_bodies, conditions, device)
        smoothing = options.smoothing
        rows = n if self.shifter or (smoothing is not None and smoothing.needs_gradient) else 0
        self.grad_F = wp.zeros(rows, dtype=space.row_gradient(space.dim**2), device=device)
        self.steps = 0
        self.stabiliser: Stabiliser = UpwindForces(space, device)
        if is_corrected(options, policy, surface_given):
            if 0 < len(moving_bodies) < len(moving) and not isinstance(options.correction, Balance):
                raise ValueError(
                    f"correction must be Balance() or None where some bodies move and others do not, got "
                    f"{options.correction}; arrangement=Current() moves all"
                )
            self.stabiliser = options.correction.build(space, particles, flux, moving_bodies, device)
        self.tie: TiedPairs | None = None
        if options.tie is not None:
            self.tie = options.tie.build(space, flux, moving, device)
        self._zero, self.loaded = wp.zeros(1, dtype=space.vec, device=device), any(c.loads for c in conditions)
        # Forces that are always zero take the memory of one
        there = {"correction": self.stabiliser.corrects, "tie": self.tie is not None, "external": self.loaded}
        for name, needed in there.items():
            force = wp.zeros(n, dtype=space.vec, device=device) if needed else repeated(self._zero, n)
            setattr(self.forces, name, force)
        sensed = options.dissipation is not None and options.dissipation.sensor is not None
        if self.stabiliser.takes_dual(configuration, sensed):
            flux.keep_dual()
        self.limiter: MassDiffusion | None = None
        if options.limiter is not None:
            self.limiter = options.limiter.build(space, particles, configuration, device)
        users = [option for option in (options.dissipation, options.limiter) if option is not None]
        sensors = {option.sensor for option in users if option.sensor is not None}
        self.sensors = {sensor: SensorField(sensor, space, particles, device) for sensor in sensors}
        self.smoothed_F_k = configuration.fields.F
        if smoothing is not None and smoothing.smooths_reference and not policy.fixed:
            self.smoothed_F_k = wp.zeros(n, dtype=space.mat, device=device)
        self._impose(U, 0.0)
        configuration.refresh(U)
        if not surface_given:
            configuration.defect(self.forces.free_v, U.surface)  # s_a = e_a at the start (M10), less nothing yet
        for condition in conditions:
            condition.start(U)
        self._after_refresh()
        self.ledger = Ledger(space, particles, flux, configuration, clock, self.limiter, device)
        self.ledger.open(U)

    def step(self) -> None:
        """Advance U by one step."""
        if self.due(self.steps):  # k = 0, every few steps, or n
            self.refresh()
        self.advance()
        self.steps += 1

    def advance(self) -> None:
        """Advance U on the present reference; a table of contents of M8."""
        U, half = self.U, self.half
        self._gradients(U)  # M4: ∇_k v, ∇_k F
        self._choose_dt(U)
        self._sense(U)  # §5: d of vⁿ for both half steps, and the diffusion of Uⁿ
        self._stress(U, 0.0)  # M1: Q = P F_kᵀ / J_k
        self._sum_forces(U, U.v, 0.0)  # M5, M9
        self._smooth(U, half)  # M6 or M7: S(U)
        self._predict(U, half, 0.5)  # M8: U^{n+½}
        self._impose(half, 0.5)
        self._velocity_gradient(half)  # M4
        self._stress(half, 0.5)  # M1
        self._sum_forces(half, half.v, 0.5)  # M5, M9
        self._kick(U)  # M8: v^{n+1}
        self._drift(U, half.v, 1.0, U)  # M8: F^{n+1}, x^{n+1}
        self._limit(U)  # §5: U^{n+1} += d × diffusion
        self._release(U)  # the free velocity, for the reactions
        self._impose(U, 1.0)
        self._update(U)  # histories; liquids keep J only
        check(self._launch, self.space, U, self.clock.fields)
        self.ledger.record(U, half, self.grad_v, self.forces)
        self.clock.tick()

    def due(self, step: int) -> bool:
        """Whether the reference is to be refreshed before step number ``step``; the first finds it fresh."""
        return step > 0 and self.policy.due(step, self.configuration, self.U.F)

    def refresh(self) -> None:
        """Make U the reference, shifted (M15)."""
        self._shift(self.U)
        self.flux.rebase(self.U.F, self.moving)
        self.configuration.refresh(self.U)
        self._after_refresh()

    def move_reference(self) -> None:
        """First part of a refresh, launches only: the reference becomes U, shifted (M15); neighbours are counted."""
        self._shift(self.U)
        self.flux.rebase(self.U.F, self.moving)
        self.configuration.move(self.U)

    def renew_reference(self) -> None:
        """Last part of a refresh, launches only, when the lists have room: neighbours, corrections, balance."""
        self.configuration.renew()
        self._after_refresh()

    def _shift(self, U: Any) -> None:
        if self.shifter is not None:
            self._velocity_gradient(U)
            self.configuration.gradient(self._rows(U.F), self.grad_F)
            self.shifter.apply(self.configuration, self.stabiliser.psi, U, self.grad_v, self.grad_F, self.clock.fields)
            self._impose(U, 0.0)
            self.ledger.book_shift(U)

    def evolving(self) -> dict[str, wp.array]:
        """Every array that a step reads before it writes it, by name: with ``steps`` what a checkpoint must hold."""
        listed = [arrays(self.U, "State"), arrays(self.particles, "Particles"), {"reaction": self.forces.reaction}]
        parts = [self.configuration, self.clock, self.flux, self.stabiliser, self.ledger]
        listed += [part.evolving() for part in parts]
        if self.shifter is not None:
            listed.append(self.shifter.evolving())
        for i, condition in enumerate(self.conditions):
            listed.append({f"Condition.{i}.{name}": array for name, array in condition.evolving().items()})
        return {name: array for part in listed for name, array in part.items()}

    def rebuild(self) -> None:
        """Derive what the evolving arrays determine, after they were overwritten."""
        self.configuration.rebuild()
        self._refresh_derived()

    def _after_refresh(self) -> None:
        self.stabiliser.refresh(self.configuration, self.U)
        self._refresh_derived()

    def _refresh_derived(self) -> None:
        self.configuration.resolve()
        if self.limiter is not None:
            self.limiter.refresh()
        if self.smoothed_F_k is not self.configuration.fields.F:
            self._smooth_field(self.configuration.fields.F, self.grad_F, self.smoothed_F_k)

    def _choose_dt(self, U: Any) -> None:
        self.flux.wave_speeds(U.F, self.grad_v, self.configuration, self.clock.fields)
        self.clock.choose()

    def _gradients(self, U: Any) -> None:
        self._velocity_gradient(U)
        if self.options.smoothing is not None and self.options.smoothing.needs_gradient:
            self.configuration.gradient(self._rows(U.F), self.grad_F)

    def _sense(self, U: Any) -> None:
        for sensor in self.sensors.values():
            sensor.compute(self.configuration, self.flux.fields, U.v, self.grad_v)
        if self.limiter is not None:
            self.limiter.prepare(U, self.sensors[self.limiter.option.sensor].d)

    def _velocity_gradient(self, state: Any) -> None:
        self.configuration.gradient(state.v, self.grad_v)

    def _stress(self, state: Any, fraction: float) -> None:
        self.flux.compute(state.F, self.grad_v, self.configuration, self.clock.fields, fraction)

    def _sum_forces(self, state: Any, v: wp.array, fraction: float) -> None:
        forces, configuration, options = self.forces, self.configuration, self.options
        epsilon, d = 0.0, None
        if options.dissipation is not None:
            epsilon = options.dissipation.epsilon
            if options.dissipation.sensor is not None:
                d = self.sensors[options.dissipation.sensor].d
        if self.tie is not None:
            self.tie.compute(configuration, state, forces)
        self.stabiliser.compute(configuration, self.flux.fields, state.x, v, self.grad_v, epsilon, d, forces)
        if self.loaded:
            forces.external.zero_()
        for condition in self.conditions:
            condition.load(state, self.clock.fields, fraction, forces.external)

    def _smooth(self, U: Any, half: Any) -> None:
        self._smooth_field(U.v, self.grad_v, half.v)
        self._smooth_field(U.F, self.grad_F, half.F)

    def _predict(self, U: Any, half: Any, fraction: float) -> None:
        arguments = [self.particles, U, self.smoothed_F_k, self.grad_v, self.forces, self.clock.fields, fraction, half]
        kernel = make_predict(self.space, self.configuration.fixed, self.moves_surfaces)
        self._launch(kernel, self.n, arguments)

    def _kick(self, U: Any) -> None:
        arguments = [self.particles, self.forces, self.clock.fields, U.v]
        self._launch(make_kick(self.space), self.n, arguments)

    def _drift(self, U: Any, v: wp.array, fraction: float, out: Any) -> None:
        arguments = [self.configuration.fields, U, v, self.grad_v, self.clock.fields, fraction, out]
        kernel = make_drift(self.space, self.configuration.fixed, self.moves_surfaces)
        self._launch(kernel, self.n, arguments)

    def _limit(self, U: Any) -> None:
        if self.limiter is not None:
            self.ledger.open_limiter(U)
            self.limiter.apply(U, self.clock.fields)
            self.ledger.close_limiter(U)

    def _update(self, U: Any) -> None:
        self.flux.update(U.F, self.grad_v, self.configuration, self.clock.fields)

    def _release(self, U: Any) -> None:
        wp.copy(self.forces.free_v, U.v)

    def _impose(self, state: Any, fraction: float) -> None:
        for condition in self.conditions:
            condition.impose(state, self.clock.fields, fraction)

    def _smooth_field(self, f: wp.array, gradient: wp.array, out: wp.array) -> None:
        if self.options.smoothing is None:
            wp.copy(out, f)
        else:
            self.options.smoothing.apply(self.space, self.configuration, self._rows(f), gradient, self._rows(out))

    def _rows(self, f: wp.array) -> wp.array:
        """The same memory with each element as one row of reals."""
        return f.view(self.space.row(wp.types.type_size(f.dtype)))
