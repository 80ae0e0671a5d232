"""How rigid bodies move: held, at a constant velocity, as a function of time says, or freely under forces."""

import functools
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..boundaries import Assembly
from ..boundaries.value import Value
from ..checks import real_array, short
from ..execution import Launcher
from ..fields import clock_structure
from ..space import Space
from ..structs import ClockArrays
from .shapes import Solid

#: Force [N] and moment about the centre of mass [N m], three components each, of bodies on a rigid one.
Wrench = wp.types.vector(length=6, dtype=wp.float64)


@wp.struct
class Pose:
    """A rigid body's state, arrays of one element, in 3-D and double precision always.

    ``x`` [m] the centre of mass, ``R`` its axes as columns, ``v`` [m/s], ``spin`` [rad/s], and of a free one ``L``
    [kg m²/s], the angular momentum about the centre.
    """

    x: wp.array(dtype=wp.vec3d)
    R: wp.array(dtype=wp.mat33d)
    v: wp.array(dtype=wp.vec3d)
    L: wp.array(dtype=wp.vec3d)
    spin: wp.array(dtype=wp.vec3d)


POSE = ("x", "R", "v", "L", "spin")


def make_pose(x: np.ndarray, R: np.ndarray, device: wp.DeviceLike) -> Pose:
    """A pose at rest."""
    pose = Pose()
    pose.x, pose.R = wp.array([x], dtype=wp.vec3d, device=device), wp.array([R], dtype=wp.mat33d, device=device)
    pose.v, pose.L, pose.spin = (wp.zeros(1, dtype=wp.vec3d, device=device) for _ in range(3))
    return pose


@wp.func
def rotation(turn: wp.vec3d) -> wp.mat33d:
    """The rotation by the vector ``turn`` [rad] (Rodrigues)."""
    one = wp.identity(n=3, dtype=wp.float64)
    angle = wp.length(turn)
    if angle == wp.float64(0.0):
        return one
    K = wp.skew(turn / angle)
    return one + wp.sin(angle) * K + (wp.float64(1.0) - wp.cos(angle)) * (K @ K)


def rotation_matrix(turn: np.ndarray) -> np.ndarray:
    """The same on the host, (3,) -> (3, 3)."""
    angle = float(np.linalg.norm(turn))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = turn / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * (K @ K)


def spatial(given: Any, dim: int, who: str) -> np.ndarray:
    """A vector of the space, (dim,), as one of three components; None is 0."""
    vector = np.zeros(3)
    if given is not None:
        values = real_array(given, who)
        if values.shape != (dim,):
            raise ValueError(f"{who} must be {dim} numbers in {dim}-D, got {short(given)}")
        vector[:dim] = values
    return vector


def turning(given: Any, dim: int, who: str) -> np.ndarray:
    """An axial vector as one of three components: three numbers in 3-D, one about z in 2-D, none in 1-D; None is 0."""
    count, vector = {1: 0, 2: 1, 3: 3}[dim], np.zeros(3)
    if given is not None:
        values = real_array(given, who)
        if values.shape != (count,):
            raise ValueError(f"{who} must be {count} numbers in {dim}-D (one about z in 2-D), got {short(given)}")
        vector[3 - count :] = values
    return vector


class RigidMotion(ABC):
    """How a rigid body moves; ``bind`` makes the part that acts."""

    @abstractmethod
    def bind(self, assembly: Assembly, solid: Solid, pose: Pose) -> "BoundRigidMotion":
        """Set up from the ``pose`` at the start, which it keeps up to date, and complete it with the velocities.

        Raises:
            ValueError: a motion that the shape or the dimension does not allow.
        """


class BoundRigidMotion:
    """A motion at work.

    Attributes:
        pose: at the end of the last step. at: at the time that was asked for last.
        recordable: whether it launches kernels and nothing else.
        inverse_mass, inverse_inertia: 1/kg and, about the principal axes, 1/(kg m²), 0 where nothing can move it.
        work: energy [J] put in since the start, a one-element array.
    """

    recordable = True
    inverse_mass = 0.0
    inverse_inertia = wp.vec3d()

    def __init__(self, space: Space, pose: Pose, device: wp.DeviceLike):
        self.space, self.pose, self._launch = space, pose, Launcher(device)
        self.at = make_pose(pose.x.numpy()[0], pose.R.numpy()[0], device)
        self.work = wp.zeros(1, dtype=wp.float64, device=device)

    def look(self, clock: ClockArrays, fraction: float) -> None:
        """Pose ``at`` time t + fraction · Δt."""

    def advance(self, clock: ClockArrays, wrench: wp.array) -> None:
        """Pose ``pose`` at the end of the step, in which bodies pushed by ``wrench``."""

    def ahead(self, clock: ClockArrays, fraction: float, wrench: wp.array) -> Pose:
        """The pose, with the velocities that it has ``fraction`` · Δt later by the forces of bodies on it."""
        return self.pose

    def kinetic(self) -> float:
        """Kinetic energy [J]; reads the device."""
        return 0.0

    def evolving(self) -> dict[str, wp.array]:
        """Arrays by name that a step reads before it writes them."""
        return {name: getattr(self.pose, name) for name in POSE} | {"work": self.work}


@functools.cache
def _make_carry(space: Space, along: bool) -> wp.Kernel:
    """Kernel: the pose that is prescribed for time t + fraction · Δt, and the velocity there.

    ``along`` a displacement of one row, otherwise at a constant velocity.
    """
    Clock, row, dim = clock_structure(space), space.row(space.dim), space.dim

    @wp.kernel(module="unique", enable_backward=False)
    def carry(
        clock: Clock,
        fraction: wp.float64,
        start: Pose,
        displacement: wp.array(dtype=row),
        before: wp.array(dtype=row),
        out: Pose,
    ):
        t = clock.t[0] + fraction * clock.dt[0]
        v = start.v[0]
        shift = t * v
        if wp.static(along):
            v = wp.vec3d()
            for i in range(wp.static(dim)):
                shift[i] = wp.float64(displacement[0][i])
                if clock.dt[0] > wp.float64(0.0):
                    v[i] = wp.float64(displacement[0][i] - before[0][i]) / clock.dt[0]
        out.x[0] = start.x[0] + shift
        out.R[0] = rotation(t * start.spin[0]) @ start.R[0]
        out.v[0] = v
        out.spin[0] = start.spin[0]

    return carry


@functools.cache
def _make_settle() -> wp.Kernel:
    """Kernel: the prescribed pose becomes that of the body; its drive did what bodies took from it."""

    @wp.kernel(module="unique", enable_backward=False)
    def settle(
        wrench: wp.array(dtype=Wrench),
        there: Pose,
        dt: wp.array(dtype=wp.float64),
        pose: Pose,
        work: wp.array(dtype=wp.float64),
    ):
        w, moved = wrench[0], there.x[0] - pose.x[0]
        force, moment = wp.vec3d(w[0], w[1], w[2]), wp.vec3d(w[3], w[4], w[5])
        work[0] = work[0] - wp.dot(force, moved) - dt[0] * wp.dot(moment, there.spin[0])
        pose.x[0] = there.x[0]
        pose.R[0] = there.R[0]
        pose.v[0] = there.v[0]
        pose.spin[0] = there.spin[0]

    return settle


class Prescribed(BoundRigidMotion):
    """Moves a body as is prescribed, at a constant velocity or along a displacement, whatever pushes it."""

    def __init__(self, assembly: Assembly, pose: Pose, displacement: Callable[..., Any] | None):
        super().__init__(assembly.space, pose, assembly.device)
        device = assembly.device
        self.start = make_pose(pose.x.numpy()[0], pose.R.numpy()[0], device)
        for other in (self.start, self.at):
            other.v.assign(pose.v)
            other.spin.assign(pose.spin)
        self._rows = [wp.zeros(1, dtype=self.space.row(self.space.dim), device=device) for _ in range(2)]
        self._values = []
        self._along = displacement is not None
        if displacement is not None:
            self._centre = wp.array(pose.x.numpy()[:, : self.space.dim], dtype=self.space.vec, device=device)
            only = wp.zeros(1, dtype=wp.int32, device=device)
            self._values = [
                Value(assembly, np.zeros(1, dtype=int), self.space.dim, displacement, "Driven", places=only)
                for _ in range(2)
            ]
            self.recordable = self._values[0].recordable

    def look(self, clock: ClockArrays, fraction: float) -> None:
        rows = self._rows
        if self._along:
            now, before = self._values
            rows = [now.at(self._centre, clock, fraction), before.at(self._centre, clock, fraction - 1.0)]
        self._launch.once(_make_carry(self.space, self._along), 1, [clock, fraction, self.start, *rows, self.at])

    def advance(self, clock: ClockArrays, wrench: wp.array) -> None:
        self.look(clock, 0.0)
        self._launch.once(_make_settle(), 1, [wrench, self.at, clock.dt, self.pose, self.work])


@dataclass(frozen=True)
class Held(RigidMotion):
    """Stays where it is."""

    def bind(self, assembly: Assembly, solid: Solid, pose: Pose) -> BoundRigidMotion:
        return BoundRigidMotion(assembly.space, pose, assembly.device)


@dataclass(frozen=True)
class Moving(RigidMotion):
    """Moves at a constant velocity, whatever pushes it.

    Args:
        velocity: of its centre [m/s], (dim,); at rest by default.
        spin: angular velocity [rad/s], (3,) in 3-D, (1,) about z in 2-D; none by default.
    """

    velocity: Sequence[float] | None = None
    spin: Sequence[float] | None = None

    def bind(self, assembly: Assembly, solid: Solid, pose: Pose) -> BoundRigidMotion:
        dim = assembly.space.dim
        pose.v.assign([spatial(self.velocity, dim, "Moving: velocity")])
        pose.spin.assign([turning(self.spin, dim, "Moving: spin")])
        return Prescribed(assembly, pose, None)


@dataclass(frozen=True, eq=False)
class Driven(RigidMotion):
    """Moves along, as a function of time says, without turning.

    Args:
        displacement: function of the initial place of the centre [m] and time [s] -> displacement [m], zero at the
            start: a ``wp.func``, or a Python function of places (1, dim), which keeps steps with the host.
    """

    displacement: Callable[..., Any]

    def bind(self, assembly: Assembly, solid: Solid, pose: Pose) -> BoundRigidMotion:
        if not callable(self.displacement):
            raise ValueError(
                "Driven: displacement must be a function of the initial place and time such as lambda x, t: ..., got "
                f"{short(self.displacement)}; Moving(velocity) is for a constant velocity"
            )
        return Prescribed(assembly, pose, self.displacement)
