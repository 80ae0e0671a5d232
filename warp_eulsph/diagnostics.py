"""Momenta and extrema of a state, reduced on the device in float64."""

import functools
from typing import Any

import numpy as np
import warp as wp

from .fields import structure
from .linalg import det
from .reduce import Sum
from .space import Space

_Vec6 = wp.types.vector(length=6, dtype=wp.float64)


@functools.cache
def _make_momenta(space: Space) -> Any:
    """Kernel: (m v, m x × v) of each particle, padded to 3-D."""
    Particles, State, dim = structure(space, "Particles"), structure(space, "State"), space.dim

    @wp.kernel(module="unique", enable_backward=False)
    def momenta(particles: Particles, state: State, out: wp.array(dtype=_Vec6)):
        a = wp.tid()
        x = wp.vec3d()
        p = wp.vec3d()
        for i in range(wp.static(dim)):
            x[i] = wp.float64(state.x[a][i])
            p[i] = wp.float64(particles.share[a] * particles.mass[a]) * wp.float64(state.v[a][i])
        L = wp.cross(x, p)
        out[a] = _Vec6(p[0], p[1], p[2], L[0], L[1], L[2])

    return momenta


@functools.cache
def _make_jacobian(space: Space) -> Any:
    real, mat = space.real, space.mat
    determinant = det(space)

    @wp.kernel(module="unique", enable_backward=False)
    def jacobian(F: wp.array(dtype=mat), out: wp.array(dtype=real)):
        a = wp.tid()
        out[a] = determinant(F[a])

    return jacobian


@functools.cache
def _make_extrema(space: Space) -> Any:
    """Kernel: least and largest det F, largest speed; minima and maxima do not depend on the order."""
    State, determinant, real = structure(space, "State"), det(space), space.real

    @wp.kernel(module="unique", enable_backward=False)
    def find_extrema(state: State, out: wp.array(dtype=real)):
        a = wp.tid()
        J = determinant(state.F[a])
        wp.atomic_min(out, 0, J)
        wp.atomic_max(out, 1, J)
        wp.atomic_max(out, 2, wp.length(state.v[a]))

    return find_extrema


class Diagnostics:
    """Sums over all particles of a state, without allocation after construction."""

    def __init__(self, space: Space, particles: Any, device: Any):
        n = len(particles.mass)
        self.space, self.particles, self.device = space, particles, device
        self._each = wp.zeros(n, dtype=_Vec6, device=device)
        self._total = wp.zeros(1, dtype=_Vec6, device=device)
        self._jacobian = wp.zeros(n, dtype=space.real, device=device)
        self._extrema = wp.zeros(3, dtype=space.real, device=device)
        self._sum = Sum(_Vec6, device)

    def momenta(self, state: Any) -> tuple[np.ndarray, np.ndarray]:
        """Linear [kg m/s] and angular momentum about the origin [kg m²/s], both padded to (3,)."""
        arguments = [self.particles, state, self._each]
        wp.launch(_make_momenta(self.space), len(self._each), arguments, device=self.device)
        self._sum(self._each, self._total)
        total = self._total.numpy()[0].copy()
        return total[:3], total[3:]

    def extrema(self, state: Any) -> tuple[float, float, float]:
        """Least and largest det F [-], and largest speed [m/s]."""
        self._extrema.assign([np.inf, -np.inf, 0.0])
        wp.launch(_make_extrema(self.space), len(self._each), [state, self._extrema], device=self.device)
        least, largest, speed = self._extrema.numpy().tolist()
        return least, largest, speed

    def jacobians(self, state: Any) -> np.ndarray:
        """det F of each particle, (n,)."""
        wp.launch(_make_jacobian(self.space), len(self._each), [state.F, self._jacobian], device=self.device)
        return self._jacobian.numpy().copy()
