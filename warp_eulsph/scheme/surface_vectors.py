"""Surface vectors: the defect of the dual divergence taken back particle by particle (M10)."""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..fields import structure
from ..reduce import Sum
from ..space import Space
from .dissipation import UpwindForces
from .reference import Configuration
from .stabiliser import Stabiliser

# Sums of one body about the origin, padded to 3-D: force, torque, m x, m, inertia (xx, yy, zz, xy, yz, zx).
_Sums = wp.types.vector(length=16, dtype=wp.float64)


@dataclass(frozen=True)
class SurfaceVectors:
    """Force correction Q_a (e_a − s_a) (M10): the cheap choice, momentum not exact by itself.

    Args:
        project: take the net force and torque of the correction off each body by the mass-weighted least change. For
            free bodies; a supported body must not be projected, its supports carry the difference.
    """

    project: bool = False

    def build(self, space: Space, particles: Any, bodies: list[range], device: Any) -> "SurfaceForces":
        """Allocate for ``bodies``, each a range of particles."""
        return SurfaceForces(self, space, particles, bodies, device)


@functools.cache
def _make_correction(space: Space) -> Any:
    """Kernel: the correction force and its share in the sums of its body."""
    vec, mat, dim = space.vec, space.mat, space.dim
    Particles, Reference, Forces = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        structure(space, "Forces"),
    )

    @wp.kernel(module="unique", enable_backward=False)
    def correction(
        particles: Particles,
        reference: Reference,
        Q: wp.array(dtype=mat),
        defect: wp.array(dtype=vec),
        forces: Forces,
        sums: wp.array(dtype=_Sums),
    ):
        a = wp.tid()
        force = Q[a] @ defect[a]
        forces.correction[a] = force
        f = wp.vec3d()
        x = wp.vec3d()
        for i in range(wp.static(dim)):
            f[i] = wp.float64(force[i])
            x[i] = wp.float64(reference.x[a][i])
        m = wp.float64(particles.mass[a])
        torque = wp.cross(x, f)
        s = m * x
        rr = wp.dot(x, x)
        # fmt: off
        sums[a] = _Sums(
            f[0], f[1], f[2], torque[0], torque[1], torque[2], s[0], s[1], s[2], m,
            m * (rr - x[0] * x[0]), m * (rr - x[1] * x[1]), m * (rr - x[2] * x[2]),
            -s[0] * x[1], -s[1] * x[2], -s[2] * x[0],
        )
        # fmt: on

    return correction


@functools.cache
def _make_project(space: Space) -> Any:
    """Kernel: f_a ← f_a − m_a (α + ω × x_a) with α, ω such that the body's force and torque vanish."""
    vec, dim, real = space.vec, space.dim, space.real
    Particles, Reference, Forces = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        structure(space, "Forces"),
    )

    @wp.kernel(module="unique", enable_backward=False)
    def project(first: int, particles: Particles, reference: Reference, total: wp.array(dtype=_Sums), forces: Forces):
        a = first + wp.tid()
        t = total[0]
        force = wp.vec3d(t[0], t[1], t[2])
        torque = wp.vec3d(t[3], t[4], t[5])
        s = wp.vec3d(t[6], t[7], t[8])
        m = t[9]
        omega = wp.vec3d()
        if wp.static(dim > 1):
            inertia = wp.mat33d(t[10], t[13], t[15], t[13], t[11], t[14], t[15], t[14], t[12])
            central = inertia - (wp.identity(n=3, dtype=wp.float64) * wp.dot(s, s) - wp.outer(s, s)) / m
            omega = wp.inverse(central) @ (torque - wp.cross(s, force) / m)
        alpha = (force - wp.cross(omega, s)) / m
        x = wp.vec3d()
        for i in range(wp.static(dim)):
            x[i] = wp.float64(reference.x[a][i])
        change = (alpha + wp.cross(omega, x)) * wp.float64(particles.mass[a])
        corrected = vec()
        for i in range(wp.static(dim)):
            corrected[i] = forces.correction[a][i] - real(change[i])
        forces.correction[a] = corrected

    return project


class SurfaceForces(Stabiliser):
    """M9 and M10 at work."""

    def __init__(self, option: SurfaceVectors, space: Space, particles: Any, bodies: list[range], device: Any):
        n = len(particles.mass)
        self.option, self.space, self.particles, self.bodies, self.device = option, space, particles, bodies, device
        self.upwind = UpwindForces(space, device)
        self.defect = wp.zeros(n, dtype=space.vec, device=device)
        self._each = wp.zeros(n, dtype=_Sums, device=device)
        self._total, self._sum = wp.zeros(1, dtype=_Sums, device=device), Sum(_Sums, device)

    def refresh(self, configuration: Configuration, state: Any) -> None:
        """The defect e_a − s_a of the new reference."""
        configuration.defect(state.surface, self.defect)

    def compute(
        self,
        configuration: Configuration,
        flux: Any,
        v: wp.array,
        grad_v: wp.array,
        epsilon: float,
        sensor: wp.array | None,
        forces: Any,
    ) -> None:
        """Internal force (M5), dissipation (M9) and correction (M10) into ``forces``."""
        self.upwind.compute(configuration, flux, v, grad_v, epsilon, sensor, forces)
        arguments = [self.particles, configuration.fields, flux.Q, self.defect, forces, self._each]
        wp.launch(_make_correction(self.space), len(v), arguments, device=self.device)
        if self.option.project:
            for body in self.bodies:
                self._sum(self._each[body.start : body.stop], self._total)
                arguments = [body.start, self.particles, configuration.fields, self._total, forces]
                wp.launch(_make_project(self.space), len(body), arguments, device=self.device)
