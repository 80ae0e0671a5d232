"""A rigid body that moves freely: drift, kick, drift, with turns about the principal axes one after the other."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..boundaries import Assembly
from ..checks import positive, real_array, real_number, short
from ..structs import ClockArrays
from .rigid_motion import BoundRigidMotion, Pose, RigidMotion, Wrench, make_pose, spatial, turning
from .shapes import Solid


@wp.func
def turned(R: wp.mat33d, L: wp.vec3d, inverse: wp.vec3d, axis: int, dt: wp.float64) -> wp.mat33d:
    """Axes turned about one of them for a time ``dt`` by the share of L about it, which does not change by that.

    By Cayley's rotation, whose tangent of half the angle is half the angle: as symmetric, and without series.
    """
    t = wp.float64(0.5) * dt * inverse[axis] * wp.dot(wp.vec3d(R[0, axis], R[1, axis], R[2, axis]), L)
    about = wp.vec3d()
    about[axis] = wp.float64(1.0)
    K = wp.skew(about)
    return R + (wp.float64(2.0) * t / (wp.float64(1.0) + t * t)) * (R @ (K + t * (K @ K)))


@wp.func
def drifted(R: wp.mat33d, L: wp.vec3d, inverse: wp.vec3d, dt: wp.float64) -> wp.mat33d:
    """Axes after a time ``dt`` of free turning: symmetric and symplectic, L stays (Dullweber et al. 1997).

    A. Dullweber, B. Leimkuhler & R. McLachlan, J. Chem. Phys. 107, 5840.
    """
    half = wp.float64(0.5) * dt
    R = turned(R, L, inverse, 0, half)
    R = turned(R, L, inverse, 1, half)
    R = turned(R, L, inverse, 2, dt)
    R = turned(R, L, inverse, 1, half)
    return turned(R, L, inverse, 0, half)


@wp.func
def spin_of(R: wp.mat33d, L: wp.vec3d, inverse: wp.vec3d) -> wp.vec3d:
    """Angular velocity [1/s]."""
    return R @ wp.cw_mul(inverse, wp.transpose(R) @ L)


@functools.cache
def _make_drift() -> wp.Kernel:
    """Kernel: the pose after a share of a step without forces."""

    @wp.kernel(module="unique", enable_backward=False)
    def drift(pose: Pose, inverse: wp.vec3d, dt: wp.array(dtype=wp.float64), fraction: wp.float64, out: Pose):
        tau = fraction * dt[0]
        out.x[0] = pose.x[0] + tau * pose.v[0]
        out.R[0] = drifted(pose.R[0], pose.L[0], inverse, tau)
        out.v[0] = pose.v[0]
        out.L[0] = pose.L[0]
        out.spin[0] = spin_of(out.R[0], pose.L[0], inverse)

    return drift


@functools.cache
def _make_kick() -> wp.Kernel:
    """Kernel: v and L by the forces of bodies and its own, whose work is exact by the mean velocities."""

    @wp.kernel(module="unique", enable_backward=False)
    def kick(
        wrench: wp.array(dtype=Wrench),
        own: Wrench,
        inverse_mass: wp.float64,
        inverse: wp.vec3d,
        dt: wp.array(dtype=wp.float64),
        pose: Pose,
        work: wp.array(dtype=wp.float64),
    ):
        w = wrench[0] + own
        v, L, R = pose.v[0], pose.L[0], pose.R[0]
        v_new = v + dt[0] * inverse_mass * wp.vec3d(w[0], w[1], w[2])
        L_new = L + dt[0] * wp.vec3d(w[3], w[4], w[5])
        spin = spin_of(R, L + L_new, inverse)
        force, moment = wp.vec3d(own[0], own[1], own[2]), wp.vec3d(own[3], own[4], own[5])
        work[0] = work[0] + wp.float64(0.5) * dt[0] * (wp.dot(force, v + v_new) + wp.dot(moment, spin))
        pose.v[0] = v_new
        pose.L[0] = L_new

    return kick


@functools.cache
def _make_foresee() -> wp.Kernel:
    """Kernel: the pose to come, by forces as they are."""

    @wp.kernel(module="unique", enable_backward=False)
    def foresee(
        wrench: wp.array(dtype=Wrench),
        own: Wrench,
        inverse_mass: wp.float64,
        inverse: wp.vec3d,
        dt: wp.array(dtype=wp.float64),
        fraction: wp.float64,
        pose: Pose,
        out: Pose,
    ):
        w, tau = wrench[0] + own, fraction * dt[0]
        out.x[0] = pose.x[0]
        out.R[0] = pose.R[0]
        out.v[0] = pose.v[0] + tau * inverse_mass * wp.vec3d(w[0], w[1], w[2])
        out.spin[0] = spin_of(pose.R[0], pose.L[0] + tau * wp.vec3d(w[3], w[4], w[5]), inverse)

    return foresee


class BoundFree(BoundRigidMotion):
    """A free body at work; the same steps as Störmer and Verlet's (M14), whatever the scheme."""

    def __init__(self, assembly: Assembly, pose: Pose, mass: float, inertia: np.ndarray, own: np.ndarray):
        super().__init__(assembly.space, pose, assembly.device)
        count = {1: 0, 2: 1, 3: 3}[assembly.space.dim]
        inverse = np.zeros(3)
        inverse[3 - count :] = 1.0 / inertia[3 - count :]
        self._foreseen = make_pose(np.zeros(3), np.eye(3), assembly.device)
        self.inverse_mass, self.inverse_inertia, self._own = 1.0 / mass, wp.vec3d(*inverse), Wrench(*own)

    def look(self, clock: ClockArrays, fraction: float) -> None:
        self._drift(clock, fraction, self.at)

    def ahead(self, clock: ClockArrays, fraction: float, wrench: wp.array) -> Pose:
        numbers = [self._own, self.inverse_mass, self.inverse_inertia, clock.dt, fraction]
        self._launch.once(_make_foresee(), 1, [wrench, *numbers, self.pose, self._foreseen])
        return self._foreseen

    def advance(self, clock: ClockArrays, wrench: wp.array) -> None:
        self._drift(clock, 0.5, self.pose)
        arguments = [wrench, self._own, self.inverse_mass, self.inverse_inertia, clock.dt, self.pose, self.work]
        self._launch.once(_make_kick(), 1, arguments)
        self._drift(clock, 0.5, self.pose)

    def _drift(self, clock: ClockArrays, fraction: float, out: Pose) -> None:
        self._launch.once(_make_drift(), 1, [self.pose, self.inverse_inertia, clock.dt, fraction, out])

    def kinetic(self) -> float:
        v, L, R = (getattr(self.pose, name).numpy()[0] for name in ("v", "L", "R"))
        along = (R.T @ L) ** 2 @ np.array(self.inverse_inertia)
        return float(0.5 * (v @ v / self.inverse_mass + along))


@dataclass(frozen=True)
class Free(RigidMotion):
    """Moves by what bodies do to it and by forces of its own.

    Either ``mass`` or ``density`` is needed. The ledger has the work of its own forces as external.

    Args:
        mass: [kg], per metre of depth in 2-D and per square metre in 1-D.
        density: [kg/m³] instead, times the volume of the shape.
        inertia: principal moments about the centre of mass [kg m²] instead of those of an even density: (3,) along the
            shape's axes in 3-D, (1,) about z in 2-D.
        velocity: of the centre of mass at the start [m/s], (dim,); at rest by default.
        spin: angular velocity at the start [rad/s], (3,) in 3-D, (1,) about z in 2-D; none by default.
        gravity: weight, acceleration along −y in 2-D, −z in 3-D, −x in 1-D [m/s²].
        force: constant force on the centre of mass [N], (dim,).
        torque: constant moment [N m], (3,) in 3-D, (1,) in 2-D.

    Raises:
        ValueError: no mass, a mass that is not positive, or numbers that are none.
    """

    mass: float | None = None
    density: float | None = None
    inertia: Sequence[float] | None = None
    velocity: Sequence[float] | None = None
    spin: Sequence[float] | None = None
    gravity: float = 0.0
    force: Sequence[float] | None = None
    torque: Sequence[float] | None = None

    def __post_init__(self) -> None:
        if (self.mass is None) == (self.density is None):
            raise ValueError(
                "Free: a rigid body that moves freely needs either a mass or a density, got "
                f"{'neither' if self.mass is None else 'both'}; one that forces do not move is Held() or Moving(...)"
            )
        if self.mass is not None:
            positive(self.mass, "Free: mass", "give it in kg")
        if self.density is not None:
            positive(self.density, "Free: density", "give it in kg/m^3")
        if not np.isfinite(real_number(self.gravity, "Free: gravity")):
            raise ValueError(f"Free: gravity must be finite, got {self.gravity}; give it in m/s^2")

    def bind(self, assembly: Assembly, solid: Solid, pose: Pose) -> BoundRigidMotion:
        dim = assembly.space.dim
        if not np.isfinite(solid.volume):
            raise ValueError("Free: a plane without end cannot move freely; take a Box, or Held() or Moving(...)")
        mass = self.mass if self.mass is not None else float(self.density or 0.0) * solid.volume
        inertia = mass * solid.inertia
        if self.inertia is not None:
            count = {1: 0, 2: 1, 3: 3}[dim]
            given = real_array(self.inertia, "Free: inertia")
            if given.shape != (count,) or not (given > 0.0).all():
                raise ValueError(
                    f"Free: inertia must be {count} positive moments in {dim}-D, got {short(self.inertia)}"
                )
            inertia[3 - count :] = given
        own = np.concatenate([spatial(self.force, dim, "Free: force"), turning(self.torque, dim, "Free: torque")])
        own[dim - 1] -= mass * self.gravity
        R = pose.R.numpy()[0]
        pose.v.assign([spatial(self.velocity, dim, "Free: velocity")])
        spin = turning(self.spin, dim, "Free: spin")
        pose.spin.assign([spin])
        pose.L.assign([R @ (inertia * (R.T @ spin))])
        return BoundFree(assembly, pose, mass, inertia, own)
