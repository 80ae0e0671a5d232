"""Net force and torque taken off a body by the mass-weighted least change."""

import functools

import warp as wp

from ..execution import Launcher
from ..fields import structure
from ..reduce import Sum
from ..space import Space
from ..structs import ParticleArrays

# Sums of one body about the origin, padded to 3-D: force, torque, m x, m, inertia (xx, yy, zz, xy, yz, zx).
_Sums = wp.types.vector(length=16, dtype=wp.float64)


@functools.cache
def pad(space: Space) -> wp.Function:
    """``wp.func`` vec -> its 3-D vector in float64."""
    vec, dim = space.vec, space.dim

    @wp.func
    def pad(v: vec) -> wp.vec3d:
        padded = wp.vec3d()
        for i in range(wp.static(dim)):
            padded[i] = wp.float64(v[i])
        return padded

    return pad


@functools.cache
def _make_sums(space: Space) -> wp.Kernel:
    """Kernel: each particle's share in the sums of its body; ghosts have none."""
    vec, Particles, padded = space.vec, structure(space, "Particles"), pad(space)

    @wp.kernel(module="unique", enable_backward=False)
    def share_in_sums(
        first: int,
        particles: Particles,
        positions: wp.array(dtype=vec),
        forces: wp.array(dtype=vec),
        couples: wp.array(dtype=wp.vec3d),
        sums: wp.array(dtype=_Sums),
    ):
        a = first + wp.tid()
        own = wp.float64(particles.share[a])
        m = own * wp.float64(particles.mass[a])
        x = padded(positions[a])
        f = padded(forces[a]) * own
        torque = wp.cross(x, f) + couples[a] * own
        s = m * x
        rr = wp.dot(x, x)
        # fmt: off
        sums[a] = _Sums(
            f[0], f[1], f[2], torque[0], torque[1], torque[2], s[0], s[1], s[2], m,
            m * (rr - x[0] * x[0]), m * (rr - x[1] * x[1]), m * (rr - x[2] * x[2]),
            -s[0] * x[1], -s[1] * x[2], -s[2] * x[0],
        )
        # fmt: on

    return share_in_sums


@functools.cache
def _make_project(space: Space) -> wp.Kernel:
    """Kernel: f_a ← f_a − m_a (α + ω × x_a) with α, ω such that the body's force and torque vanish.

    In a periodic box, where there is no angular momentum to keep, α alone.
    """
    vec, real, dim = space.vec, space.real, space.dim
    turns = dim > 1 and not space.periodic
    Particles, padded = structure(space, "Particles"), pad(space)

    @wp.kernel(module="unique", enable_backward=False)
    def project(
        first: int,
        particles: Particles,
        positions: wp.array(dtype=vec),
        total: wp.array(dtype=_Sums),
        forces: wp.array(dtype=vec),
    ):
        a = first + wp.tid()
        t = total[0]
        force = wp.vec3d(t[0], t[1], t[2])
        torque = wp.vec3d(t[3], t[4], t[5])
        s = wp.vec3d(t[6], t[7], t[8])
        m = t[9]
        omega = wp.vec3d()
        if wp.static(turns):
            inertia = wp.mat33d(t[10], t[13], t[15], t[13], t[11], t[14], t[15], t[14], t[12])
            central = inertia - (wp.identity(n=3, dtype=wp.float64) * wp.dot(s, s) - wp.outer(s, s)) / m
            omega = wp.inverse(central) @ (torque - wp.cross(s, force) / m)
        alpha = (force - wp.cross(omega, s)) / m
        change = (alpha + wp.cross(omega, padded(positions[a]))) * wp.float64(particles.mass[a])
        corrected = forces[a]
        for i in range(wp.static(dim)):
            corrected[i] = corrected[i] - real(change[i])
        forces[a] = corrected

    return project


class Projection:
    """Projects fields of forces (or impulses) on the particles of each body onto no net force and no net torque.

    Attributes:
        couples: torques [N m] of the particles about themselves, (n,) of vec3d, zero unless written.
    """

    def __init__(self, space: Space, particles: ParticleArrays, bodies: list[range], device: wp.DeviceLike):
        n, self._launch = len(particles.mass), Launcher(device)
        self.space, self.particles, self.bodies, self.device = space, particles, bodies, device
        self.couples = wp.zeros(n, dtype=wp.vec3d, device=device)
        self._each = wp.zeros(n, dtype=_Sums, device=device)
        self._total, self._sum = wp.zeros(1, dtype=_Sums, device=device), Sum(_Sums, n, device)

    def __call__(self, x: wp.array, forces: wp.array) -> None:
        """Change ``forces`` [N] at positions ``x`` [m], both (n,) of vec, in place."""
        arguments = [self.particles, x, forces, self.couples, self._each]
        self._launch(_make_sums(self.space), len(forces), arguments)
        for body in self.bodies:
            self._sum(self._each[body.start : body.stop], self._total)
            self._launch(_make_project(self.space), len(body), [self.particles, x, self._total, forces], body.start)
