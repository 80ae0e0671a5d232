"""Rigid bodies that deformable ones touch: obstacles, tools, projectiles."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..boundaries import Assembly
from ..checks import real_number
from ..execution import Launcher
from ..reduce import Sum
from ..structs import StateArrays
from .base import BoundInteraction, Interaction
from .free import Free
from .pressing import make_ask, make_gather, make_measure, make_press, make_raise, make_tie, trace_structure
from .rigid_motion import Held, RigidMotion, Wrench, make_pose, rotation_matrix, spatial, turning
from .shapes import Numbers, Shape
from .traces import Traces, find_traces
from .wetting import Wetting

if TYPE_CHECKING:
    from ..scheme.world import World

#: Components of axial vectors by dimension.
AXIAL = {1: slice(0, 0), 2: slice(2, 3), 3: slice(0, 3)}


@dataclass(frozen=True)
class RigidBody(Interaction):
    """A rigid body that pushes the bodies that touch it, and rubs on them.

    Nothing is to be tuned: a point of a body's surface (``traces``) that is a depth g inside is pushed out by
    A M g/spacing, A its area and M = ρ c² the modulus of pressure waves of the body's material at the start: as stiff
    as one layer of particles. A point is only pushed, never pulled. Rigid bodies do not feel each other.

    Friction is Coulomb's: a point that touches is tied where it began to, by a spring of A G/spacing, G = ρ c_s² of
    shear waves, until that pulls with ``friction`` times the force along the normal; then it slides.

    Where a body overlaps by less than half a spacing at the start it is taken to touch there, without a force: no face
    is known better.

    Args:
        shape: Plane(...), Box(...), Sphere(...), Cylinder(...) or TriangleMesh(...).
        centre: where the shape's origin lies at the start [m], (dim,); the origin by default.
        rotation: how the shape is turned at the start, about its origin [rad]: a vector (3,) in 3-D, (1,) in 2-D.
        motion: Held(), Moving(velocity, spin), Driven(displacement) or Free(mass, ...).
        bodies: names of those that it touches; all by default.
        hollow: its matter is what lies outside of the shape: a container.
        friction: Coulomb's coefficient, 0 without.
        name: for messages, probes and tables.

    Raises:
        ValueError: when the simulation is built: unknown bodies, a shape or motion that does not fit, particles inside
            the shape.
    """

    shape: Shape
    centre: Sequence[float] | None = None
    rotation: Sequence[float] | None = None
    motion: RigidMotion = Held()
    bodies: Sequence[str] | None = None
    hollow: bool = False
    friction: float = 0.0
    name: str = "rigid"

    def __post_init__(self) -> None:
        if not (np.isfinite(real_number(self.friction, "RigidBody: friction")) and self.friction >= 0.0):
            raise ValueError(f"RigidBody: friction must be 0 or more and finite, got {self.friction}")
        if isinstance(self.bodies, str):
            raise ValueError(f"RigidBody: bodies must be a list of names, got {self.bodies!r}; write [{self.bodies!r}]")

    def bind(self, assembly: Assembly) -> "BoundRigidBody":
        if self.hollow and isinstance(self.motion, Free):
            raise ValueError(f"rigid body {self.name!r}: a hollow one has no mass of its own and cannot be Free(...)")
        return BoundRigidBody(self, assembly)


class BoundRigidBody(BoundInteraction):
    """A rigid body at work. What it shows is read from the device.

    Attributes:
        option: its declaration.
        motion: at work, with its pose.
    """

    sortable = True

    def __init__(self, option: RigidBody, assembly: Assembly):
        who = f"rigid body {option.name!r}"
        self.option, self.assembly, self.space, self.device = option, assembly, assembly.space, assembly.device
        space, device = assembly.space, assembly.device
        names = [None] if option.bodies is None else option.bodies
        self.indices = np.unique(np.concatenate([assembly.select(None, name, who) for name in names]))
        self._solid = option.shape.solid(space.dim, device)
        R = rotation_matrix(turning(option.rotation, space.dim, f"{who}: rotation"))
        centre = spatial(option.centre, space.dim, f"{who}: centre") + R @ self._solid.home
        pose = make_pose(centre, R @ self._solid.axes, device)
        self.motion = option.motion.bind(assembly, self._solid, pose)
        self.recordable = self.motion.recordable
        self._launch = Launcher(device)
        numbers = [*self._solid.numbers, *[0.0] * 6][:6]
        self.shape = [-1.0 if option.hollow else 1.0, Numbers(*numbers), self._solid.triangles]
        self._rubs = option.friction > 0.0
        inertia = float(max(self.motion.inverse_inertia)) * (2.0 if self._rubs else 1.0)
        self._inverse = wp.vec2d(self.motion.inverse_mass, inertia)
        self._wrench, self._asked = (
            wp.zeros(1, dtype=Wrench, device=device),
            wp.zeros(1, dtype=wp.float64, device=device),
        )
        self._sum, self._passed = (wp.zeros(1, dtype=wp.float64, device=device) for _ in range(2))
        self._wetted: list[Wetting] = []

    def start(self, world: "World") -> None:
        order, who = self.assembly.order, f"rigid body {self.option.name!r}"
        moduli = np.array([both for medium in world.media for both in medium.flux.moduli()])
        laws = [part.law for _, part in world.remembering]
        loose = np.array([law.failed is not None or (law.update is not None and not law.history) for law in laws])
        body = order.by_number(world.particles.body.numpy())
        self._refuse_overlap(world, who)
        traces = find_traces(self.assembly, world.U, self.indices, loose[body], who)
        mass, spacing = (
            order.by_number(a.numpy()).astype(float) for a in (world.particles.mass, world.particles.spacing)
        )
        stiffness, shear = traces.areas * moduli[body[traces.tops]].T / spacing[traces.tops]
        wet = _wet_points(world, traces.tops)
        for _, own in wet:  # they feel its matter, and its face when they are about to pass it
            traces.half[own] = shear[own] = 0.0
        m, row = len(traces.tops), np.repeat(np.arange(len(traces.tops)), np.diff(traces.start))
        inertia = np.bincount(row, traces.weights**2 / mass[traces.members], minlength=m)
        self.points = self._fill(traces, stiffness, shear, inertia)
        self._by_particle(traces, row)
        device = self.device
        self._push, self._wrenches = (
            wp.zeros(m, dtype=wp.vec3d, device=device),
            wp.zeros(m, dtype=Wrench, device=device),
        )
        self._energies, self._frequencies = (wp.zeros(m, dtype=wp.float64, device=device) for _ in range(2))
        self._add_wrenches, self._add = Sum(Wrench, m, device), Sum(wp.float64, m, device)
        gaps = self._gaps(world, self.points, m)
        self.points.half.assign(traces.half + np.minimum(gaps, 0.0))
        self._anchors = wp.zeros(m if self._rubs else 0, dtype=wp.vec3d, device=device)
        self._tie(world)
        for medium, own in wet:
            self._wetted.append(Wetting(self, own, medium, world))
            medium.walls.take(self._wetted[-1])

    def _fill(self, traces: Traces, stiffness: np.ndarray, shear: np.ndarray, inertia: np.ndarray) -> Any:
        points, device = trace_structure(self.space)(), self.device
        points.start = wp.array(traces.start, dtype=wp.int32, device=device)
        self._places = points.places = self.assembly.order.places_of(traces.members)
        points.weights = wp.array(traces.weights, dtype=self.space.real, device=device)
        points.half, points.stiffness, points.shear, points.inertia = (
            wp.array(values, dtype=wp.float64, device=device) for values in (traces.half, stiffness, shear, inertia)
        )
        return points

    def _by_particle(self, traces: Traces, row: np.ndarray) -> None:
        """The rows turned round: of each member the points it is in."""
        order = np.lexsort((row, traces.members))
        numbers, counts = np.unique(traces.members, return_counts=True)
        self._members = self.assembly.order.places_of(numbers.astype(np.int32))
        integers = [np.concatenate([[0], np.cumsum(counts)]), row[order]]
        self._gathered = [wp.array(values, dtype=wp.int32, device=self.device) for values in integers]
        self._gathered.append(wp.array(traces.weights[order], dtype=self.space.real, device=self.device))

    def _gaps(self, world: "World", points: Any, m: int) -> np.ndarray:
        """Gaps [m] of points at the start, (m,)."""
        self.motion.look(world.clock.fields, 0.0)
        out = wp.zeros(m, dtype=wp.float64, device=self.device)
        kernel = make_measure(self.space, self.option.shape.distance)
        self._launch(kernel, m, [points, world.U.x, self.motion.at, *self.shape, out])
        gaps: np.ndarray = out.numpy()
        return gaps

    def _refuse_overlap(self, world: "World", who: str) -> None:
        n, none = len(self.indices), np.zeros(len(self.indices))
        dim = self.space.dim
        alone = Traces(np.arange(n + 1), self.indices, none + 1.0, none, none, np.zeros((n, dim)), self.indices)
        gaps = self._gaps(world, self._fill(alone, none, none, none), n)
        inside = self.indices[gaps < 0.0]
        if len(inside):
            names = [name for name, own in self.assembly.bodies.items() if np.isin(inside, own).any()]
            worst = self.indices[gaps.argmin()]
            raise ValueError(
                f"{who}: bodies must lie outside of it at the start, got {len(inside)} particles of {names} inside, "
                f"the deepest {-gaps.min():.6g} m at {self.assembly.X[worst]} m; move it, or name the bodies that it "
                "touches by bodies=[...]"
            )

    def _press(self, state: StateArrays) -> None:
        arguments = [self.points, state.x, self.motion.at, *self.shape, float(self.option.friction), self._anchors]
        kernel = make_press(self.space, self.option.shape.distance, self._rubs)
        self._launch(kernel, len(self._push), [*arguments, self._push, self._wrenches, self._energies])

    def _tie(self, world: "World") -> None:
        """What friction remembers, at the end of a step."""
        if self._rubs:
            arguments = [self.points, world.U.x, self.motion.pose, *self.shape, float(self.option.friction)]
            kernel = make_tie(self.space, self.option.shape.distance)
            self._launch(kernel, len(self._push), [*arguments, self._anchors])

    def forces(self, world: "World", state: StateArrays, fraction: float, out: wp.array) -> None:
        self.motion.look(world.clock.fields, fraction)
        self._press(state)
        for wetting in self._wetted:
            wetting.press(self._push, self._wrenches)
        self._add_wrenches(self._wrenches, self._wrench)
        for wetting in self._wetted:
            wetting.look_ahead(self._wrench)
        self._launch(make_gather(self.space), len(self._members), [self._members, *self._gathered, self._push, out])

    def rate(self, world: "World") -> None:
        clock, U = world.clock.fields, world.U
        self.motion.look(clock, 0.0)
        arguments = [self.points, U.x, U.v, self.motion.at, *self.shape, self._inverse, clock, self._asked]
        kernel = make_ask(self.space, self.option.shape.distance)
        self._launch(kernel, len(self._push), [*arguments, self._frequencies])
        self._add(self._frequencies, self._sum)
        self._launch.once(make_raise(self.space), 1, [self._asked, self._sum, clock])

    def advance(self, world: "World") -> None:
        for wetting in self._wetted:
            wetting.account(self._wrench, self._passed)
        self.motion.advance(world.clock.fields, self._wrench)
        self._tie(world)

    def passed(self) -> float:
        return float(self._passed.numpy()[0])

    def energy(self, world: "World") -> float:
        self.motion.look(world.clock.fields, 0.0)
        self._press(world.U)
        self._add(self._energies, self._sum)
        return float(self._sum.numpy()[0]) + self.motion.kinetic()

    def supplied(self) -> float:
        return float(self.motion.work.numpy()[0])

    def evolving(self) -> dict[str, wp.array]:
        own = {"wrench": self._wrench, "passed": self._passed} | ({"anchors": self._anchors} if self._rubs else {})
        own |= {f"met.{k}": wetting.met for k, wetting in enumerate(self._wetted)}
        return {**self.motion.evolving(), **own}

    def _row(self, array: wp.array, components: slice) -> np.ndarray:
        return np.array(array.numpy()[0, components])  # a copy: on the CPU it is the array's own memory

    @property
    def x(self) -> np.ndarray:
        """Where the centre of mass is [m], (dim,)."""
        return self._row(self.motion.pose.x, slice(self.space.dim))

    @property
    def v(self) -> np.ndarray:
        """Velocity of the centre of mass [m/s], (dim,)."""
        return self._row(self.motion.pose.v, slice(self.space.dim))

    @property
    def R(self) -> np.ndarray:
        """Rotation since the shape lay unturned, (3, 3)."""
        rotation: np.ndarray = self.motion.pose.R.numpy()[0] @ self._solid.axes.T
        return rotation

    @property
    def spin(self) -> np.ndarray:
        """Angular velocity [rad/s], (3,) in 3-D, (1,) in 2-D, (0,) in 1-D."""
        return self._row(self.motion.pose.spin, AXIAL[self.space.dim])

    @property
    def angular_momentum(self) -> np.ndarray:
        """About the centre of mass [kg m²/s], as ``spin``; 0 unless it is free."""
        return self._row(self.motion.pose.L, AXIAL[self.space.dim])

    @property
    def force(self) -> np.ndarray:
        """Force of the bodies on it in the last step [N], (dim,)."""
        return self._row(self._wrench, slice(self.space.dim))

    @property
    def torque(self) -> np.ndarray:
        """Moment of the bodies on it about its centre of mass in the last step [N m], as ``spin``."""
        axial = AXIAL[self.space.dim]
        return self._row(self._wrench, slice(3 + axial.start, 3 + axial.stop))


def _wet_points(world: "World", tops: np.ndarray) -> list[tuple[Any, np.ndarray]]:
    """Media in whose sums walls take part (M28), and the points that are particles of each, (k,)."""
    found = []
    for medium in world.media:
        own = np.flatnonzero((tops >= medium.span.start) & (tops < medium.span.stop))
        if medium.stabiliser.takes_walls and len(own):
            found.append((medium, own))
    return found
