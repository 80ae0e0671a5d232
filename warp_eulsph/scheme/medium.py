"""A medium: bodies that share the reference and the options of the scheme, and each line of a step on them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import warp as wp

from ..boundaries import Bound
from ..execution import Launcher
from ..fields import part, part_of
from ..space import Space
from ..structs import ClockArrays, ForceArrays, ParticleArrays, StateArrays
from .base import Scheme
from .breaking import Breaking
from .dissipation import UpwindForces
from .dual_forces import DualForces
from .exposure import Exposure
from .flux import Flux
from .heating import Heating
from .limiter import MassDiffusion
from .pair_potentials import PairPotentials
from .policy import ReferencePolicy
from .reference import Configuration
from .sensor import SensorField
from .sharpening import Sharpener
from .shifting import Shifter, held_at_start
from .stabiliser import Stabiliser, Sums
from .updates import make_drift, make_kick, make_mean, make_predict
from .volume_flux import VolumeFlux
from .waiting import Waiting
from .walls import Walls


@dataclass(frozen=True)
class MediumParts:
    """What a medium is made of.

    Attributes:
        options: those of its scheme.
        policy: when its reference is refreshed.
        span: places of its particles among all.
        particles: struct ``Particles`` of them.
        flux: of its bodies.
        configuration: its reference k.
        surface_given: the bodies came with their area vectors.
        groups: number of each body, equal for those that are bonded to each other.
    """

    options: Scheme
    policy: ReferencePolicy
    span: range
    particles: ParticleArrays
    flux: Flux
    configuration: Configuration
    surface_given: bool
    groups: Sequence[int]


def is_corrected(options: Scheme, policy: ReferencePolicy, surface_given: bool) -> bool:
    """Whether the scheme's correction is at work: a fixed reference needs it only where surface vectors were given."""
    return options.correction is not None and (surface_given or not policy.fixed)


class Medium:
    """A medium at work. States are those of the whole world, of which it sees its own particles.

    Attributes:
        surface_given: the bodies came with their area vectors. walls: what takes part in its sums from outside.
        stabiliser: of its reference. sharpener, pairs, limiter, shifter: None where the options have none.
        breaking, heating, volumes: None where no law fails, none takes heat, no volume flows between pairs.
        particles, forces, grad_v: of its own particles, views of what the world has.
        steady: its steps begin with the ∇_k v that the one before kept.
    """

    def __init__(self, space: Space, parts: MediumParts, conditions: Sequence[Bound], device: wp.DeviceLike):
        self.space, self.device, self.n = space, device, len(parts.span)
        self._launch = Launcher(device)
        self.options, self.policy, self.span = parts.options, parts.policy, parts.span
        self.particles, self.flux, self.configuration = parts.particles, parts.flux, parts.configuration
        self.surface_given = parts.surface_given
        options, n = self.options, self.n
        self.shifter: Shifter | None = None
        if options.shifting is not None and not self.policy.fixed:
            held = held_at_start(conditions, self.span)
            self.shifter = options.shifting.build(space, self.particles, self.flux, held, device)
        smoothing = options.smoothing
        rows = n if smoothing is not None and smoothing.needs_gradient else 0
        self.grad_F = wp.zeros(rows, dtype=space.row_gradient(space.dim**2), device=device)
        plain = self.configuration.plain
        sensed = options.dissipation is not None and options.dissipation.sensor is not None
        self.pairs: PairPotentials | None = None
        if self.policy.fixed and (options.tie is not None or (plain and options.dissipation is not None)):
            upwind = options.dissipation if plain else None
            simd = self.configuration.pairs_by_simd(sensed and plain)
            self.pairs = PairPotentials(options.tie, upwind, simd, space, self.flux, parts.groups, device)
        within = None if self.pairs is None else self.pairs.rows  # whose sum the others come before or after
        self.sharpener: Sharpener | None = None
        if self.configuration.sharpened:
            self.sharpener = Sharpener(space, self.configuration, n, device, within)
        self.stabiliser: Stabiliser = UpwindForces(space, device)
        if plain:
            self.stabiliser = DualForces(space, n, self.sharpener, device, within)
        if options.correction is not None and is_corrected(options, self.policy, parts.surface_given):
            options.correction.check_bonds(parts.groups)
            self.stabiliser = options.correction.build(space, self.particles, self.flux, device)
        if self.stabiliser.takes_dual(self.configuration, sensed):
            self.flux.keep_dual()
        breaks = any(part.law.failed is not None for part in self.flux.parts)
        self.breaking = Breaking(space, self.flux, self.configuration, device) if breaks else None
        self.limiter: MassDiffusion | None = None
        if options.limiter is not None:
            self.limiter = options.limiter.build(space, self.particles, self.configuration, device)
        users = [option for option in (options.dissipation, options.limiter) if option is not None]
        sensors = {option.sensor for option in users if option.sensor is not None}
        self.sensors = {sensor: SensorField(sensor, space, self.particles, device) for sensor in sensors}
        self.walls = Walls(space.mat, n, device)
        self.heating: Heating | None = None
        self.volumes: VolumeFlux | None = None
        self.smoothed_F_k = self.configuration.fields.F
        if smoothing is not None and smoothing.smooths_reference and not self.policy.fixed:
            self.smoothed_F_k = wp.zeros(n, dtype=space.mat, device=device)

    def join(
        self,
        U: StateArrays,
        half: StateArrays,
        forces: ForceArrays,
        grad_v: wp.array,
        clock: ClockArrays,
        moves_surfaces: bool,
    ) -> None:
        """See the own particles of the world's two states, of ``forces`` and of ∇v, by their ``clock``."""
        self._whole, self._own = U, part(self.space, U, "State", self.span)
        self._own_half = part(self.space, half, "State", self.span)
        self.forces, self.grad_v = part(self.space, forces, "Forces", self.span), part_of(grad_v, self.span)
        self.clock, self.moves_surfaces = clock, moves_surfaces
        self.waiting = Waiting(self.space, [], clock, self.device)
        if clock.every > 0:
            self.flux.go_one_by_one()
        upwind, flux = self.options.dissipation, self.flux.fields
        epsilon = 0.0 if upwind is None else upwind.epsilon
        d = None if upwind is None or upwind.sensor is None else self.sensors[upwind.sensor].d
        self.sums = Sums(self.configuration, flux, self.stabiliser.exact(self.grad_v), self.forces, epsilon, d)

    def keep_gradients(self, on: bool) -> None:
        """Whether each step leaves ∇_k v^{n+1} for the next one, where F^{n+½} was, which is done with by then."""
        self.steady, self.kept = on, self._own_half.F if on else self.grad_v

    def wait(self, state: StateArrays) -> None:
        """Have its refreshes, from now on, leave out the runs that wait."""
        if not self.policy.fixed:
            arrays = [array for name, array in self.evolving().items() if not name.startswith("Flux.history")]
            arrays += [self.of(state).F, self.of(state).surface]
            histories = [(kind.first, kind.history) for kind in self.flux.kinds]
            self.waiting = Waiting(self.space, [*histories, *[(0, array) for array in arrays]], self.clock, self.device)

    @property
    def heats(self) -> bool:
        """Whether its dissipation heats a law of its bodies."""
        return self.options.dissipation is not None and any(part.law.heat is not None for part in self.flux.parts)

    @property
    def exchanges(self) -> bool:
        """Whether volume flows between its pairs."""
        upwind = self.options.dissipation
        return upwind is not None and upwind.volume and self.flux.forgets and not self.policy.fixed

    def take_scratch(self, scratch: wp.array, v_old: wp.array) -> None:
        """See the own particles of the world's scratch and of the velocities [m/s] before the step."""
        own, before = part_of(scratch, self.span), part_of(v_old, self.span)
        if self.heats:
            self.heating = Heating(self.space, self.flux, self.particles, own, before, self.device)
        if self.exchanges:
            self.flux.keep_dissipated()
            self.volumes = VolumeFlux(self.space, self.flux, self.particles, own, self.device)
            if self.stabiliser.sums_pressure(self.configuration, self.sums.sensor is not None):
                self.sums = replace(self.sums, p=self.volumes.p, grad_p=self.volumes.grad_p)

    def of(self, state: StateArrays) -> StateArrays:
        """Its own particles of one of the world's states: a struct ``State`` of views."""
        return self._own if state is self._whole else self._own_half

    # the reference

    def due(self, step: int, state: StateArrays) -> bool:
        """Whether the reference is to be refreshed before step number ``step``."""
        return not self.policy.fixed and self.policy.due(step, self.configuration, self.of(state).F)

    def start(self, state: StateArrays) -> None:
        """Make ``state`` the first reference."""
        self.configuration.refresh(self.of(state))

    def find_surface(self, state: StateArrays) -> None:
        """s_a = e_a at the start (M10), where the arrangement moves zero for all that are near no free surface."""
        nothing_yet, surface = self.forces.free_v, self.of(state).surface
        unit = None if self.sharpener is None else self.sharpener.unit()
        self.configuration.defect(nothing_yet, surface, unit)
        if not self.policy.fixed:
            everyone = wp.full(self.n, 1, dtype=wp.int32, device=self.device)
            exposure = Exposure(self.space, self.particles, everyone, False, self.device)
            exposure.find(self.configuration, surface, nothing_yet)
            exposure.clear(self.configuration.near, surface)

    def look_outward(self, state: StateArrays) -> None:
        """Which way out is: by M5 of weights as they are without tilt, or by the area vectors that bodies came with."""
        if self.configuration.tilt is None and self.sharpener is None:
            wp.copy(self.particles.outward, self.of(state).surface)
        elif self.configuration.tilt is None:
            self.configuration.defect(self.forces.free_v, self.particles.outward)

    def move(self, state: StateArrays) -> None:
        """Make ``state`` the reference, with what materials start anew from it; neighbours are counted."""
        self.waiting.keep()
        self.flux.rebase(self.of(state).F)
        self.configuration.move(self.of(state), self.waiting.put_back)

    def renew(self, state: StateArrays) -> None:
        """Neighbours and corrections of the new reference (M3), what the options add, ∇_k v where it is kept."""
        early = self.steady and not self.stabiliser.balances
        self.configuration.renew(self.of(state).v, self.kept if early else None)
        self.stabilise(state)
        if early:
            self.configuration.finish_gradient(self.kept)
            self.walls.add_gradient(self.of(state).v, self.kept)
        else:
            self.keep_gradient(state)
        self.waiting.put_back()

    def stabilise(self, state: StateArrays) -> None:
        """Prepare the stabiliser for a new reference, and what else depends on it."""
        U = self.of(state)
        self.stabiliser.refresh(self.configuration, U)
        if self.shifter is not None:
            self.shifter.look(self.configuration, self.stabiliser.potentials.defect, U)
        self.walls.renew()
        self._derive()

    def rebuild(self) -> None:
        """Derive what the evolving arrays determine, after they were overwritten."""
        self.configuration.rebuild()
        self._derive()
        if self.breaking is not None:
            self.breaking.rebuild()

    def _derive(self) -> None:
        self.configuration.resolve()
        if self.limiter is not None:
            self.limiter.refresh()
        if self.smoothed_F_k is not self.configuration.fields.F:
            self._smooth_field(self.configuration.fields.F, self.grad_F, self.smoothed_F_k)

    def shift(self, state: StateArrays) -> None:
        """Shift the particles (M15), where the options say so."""
        if self.shifter is not None:
            U, psi = self.of(state), self.stabiliser.potentials.psi
            grad_v = self.kept  # of this v; walls have moved since
            if not self.steady or self.walls:
                grad_v = self.grad_v
                self.velocity_gradient(state)
            self.shifter.apply(self.configuration, psi, U, grad_v, self.clock)

    # the lines of a step

    def velocity_gradient(self, state: StateArrays, out: wp.array | None = None) -> None:
        """∇_k v (M4, M23), into ``grad_v`` by default."""
        gradient = self.configuration.gradient if self.sharpener is None else self.sharpener.gradient
        found, v = self.grad_v if out is None else out, self.of(state).v
        gradient(v, found)
        self.walls.add_gradient(v, found)

    def keep_gradient(self, state: StateArrays) -> None:
        """∇_k v of a state in which a step begins, where it is kept."""
        if self.steady:
            self.velocity_gradient(state, self.kept)

    def known_gradient(self, state: StateArrays) -> None:
        """∇_k v of the state in which a step begins, that which was kept where it was."""
        if self.steady:
            wp.copy(self.grad_v, self.kept)
        else:
            self.velocity_gradient(state)

    def mean_gradient(self, state: StateArrays, mean: StateArrays) -> None:
        """∇_k v of ``mean``; as M4 is linear, where all is steady from ∇_k vⁿ and that of ``state``, which is kept."""
        if self.steady:
            self.keep_gradient(state)
            self._launch(make_mean(self.space, "mat"), self.n, [self.kept, self.grad_v])
        else:
            self.velocity_gradient(mean)

    def release(self, state: StateArrays) -> None:
        """The velocity before conditions are imposed."""
        wp.copy(self.forces.free_v, self.of(state).v)

    def gradients(self, state: StateArrays) -> None:
        """∇_k v, and ∇_k F where the smoothing needs it (M4)."""
        self.velocity_gradient(state)
        if self.options.smoothing is not None and self.options.smoothing.needs_gradient:
            self.configuration.gradient(self._rows(self.of(state).F), self.grad_F)

    def wave_speeds(self, state: StateArrays) -> None:
        """Wave speeds, and their largest rate into the clock's."""
        self.flux.wave_speeds(self.of(state).F, self.grad_v, self.configuration, self.clock)

    def sense(self, state: StateArrays) -> None:
        """d of v, and the diffusion of the state (§5)."""
        U = self.of(state)
        for sensor in self.sensors.values():
            sensor.compute(self.configuration, self.flux.fields, U.v, self.grad_v)
        if self.limiter is not None:
            self.limiter.prepare(U, self.sensors[self.limiter.option.sensor].d)

    def stress(self, state: StateArrays, fraction: float) -> None:
        """Q of F (M1), which is ``fraction`` · Δt ahead of the histories."""
        self.flux.compute(self.of(state).F, self.grad_v, self.configuration, self.clock, fraction)
        self.stabiliser.exact(self.walls.without(self.grad_v))
        self.stabiliser.turn(self.sums, self.clock, fraction)

    def sum_forces(self, state: StateArrays, rates: StateArrays) -> None:
        """Internal forces at x and F of ``state`` (M5, M16), dissipation at v of ``rates`` (M9)."""
        at, v = self.of(state), self.of(rates).v
        grad_v = self.stabiliser.exact(self.walls.without(self.grad_v))
        if self.heating is not None:
            self.heating.note(at.x, v, grad_v)
        if self.pairs is not None:
            self.pairs.compute(self.sums, at, v)
        self.stabiliser.compute(self.sums, at.x, v)

    def smooth(self, state: StateArrays, out: StateArrays) -> None:
        """S of v and F (M6, M7)."""
        U, half = self.of(state), self.of(out)
        self._smooth_field(U.v, self.grad_v, half.v)
        self._smooth_field(U.F, self.grad_F, half.F)

    def predict(self, state: StateArrays, out: StateArrays, fraction: float) -> None:
        """``out``, which is S of ``state``, moved by ``fraction`` · Δt (M8)."""
        arguments = [self.smoothed_F_k, self.stabiliser.moving(self.grad_v), self.forces, self.clock, fraction]
        kernel = make_predict(self.space, self.configuration.fixed, self.moves_surfaces)
        self._launch(kernel, self.n, [self.particles, self.of(state), *arguments, self.of(out)])

    def kick(self, state: StateArrays) -> None:
        """v^{n+1} (M8)."""
        arguments = [self.particles, self.forces, self.clock, self.of(state).v]
        self._launch(make_kick(self.space), self.n, arguments)

    def drift(self, state: StateArrays, rates: StateArrays, fraction: float, out: StateArrays) -> None:
        """F and x of ``state`` moved by ``fraction`` · Δt with v of ``rates``, into ``out`` (M8)."""
        arguments = [self.of(state), self.of(rates).v, self.stabiliser.moving(self.grad_v), self.clock, fraction]
        kernel = make_drift(self.space, self.configuration.fixed, self.moves_surfaces)
        self._launch(kernel, self.n, [self.configuration.fields, *arguments, self.of(out)])

    def limit(self, state: StateArrays) -> None:
        """U^{n+1} += d × diffusion (§5)."""
        if self.limiter is not None:
            self.limiter.apply(self.of(state), self.clock)

    def update(self, state: StateArrays) -> None:
        """Histories after a full step, and what materials keep of F: liquids J only."""
        self.flux.update(self.of(state).F, self.grad_v, self.configuration, self.clock)
        if self.breaking is not None:
            self.breaking.update(self.of(state).F)

    def find_heat(self, state: StateArrays) -> None:
        """What M9 took in the step that ended in ``state``, particle by particle."""
        if self.heating is not None:
            self.heating.find(self.sums, self.of(state).v, self.clock)

    def heat(self, state: StateArrays) -> None:
        """That heat into the laws."""
        if self.heating is not None:
            self.heating.take(self.of(state).F, self.clock)

    def find_exchange(self) -> None:
        """What volume flows between pairs (M24)."""
        if self.volumes is not None:
            self.volumes.find(self.sums, self.stabiliser.exact, self.clock)

    def exchange(self, state: StateArrays) -> None:
        """That volume into J."""
        if self.volumes is not None:
            self.volumes.take(self.of(state).F)

    def evolving(self) -> dict[str, wp.array]:
        """Every array of its own that a step reads before it writes it, by name."""
        parts = [self.configuration.evolving(), self.flux.evolving(), self.stabiliser.evolving()]
        if self.shifter is not None:
            parts.append(self.shifter.evolving())
        if self.breaking is not None:
            parts.append(self.breaking.evolving())
        return {name: array for held in parts for name, array in held.items()}

    def _smooth_field(self, f: wp.array, gradient: wp.array, out: wp.array) -> None:
        if self.options.smoothing is None:
            wp.copy(out, f)
        else:
            self.options.smoothing.apply(self.space, self.configuration, self._rows(f), gradient, self._rows(out))

    def _rows(self, f: wp.array) -> wp.array:
        """The same memory with each element as one row of reals."""
        return f.view(self.space.row(wp.types.type_size(f.dtype)))
