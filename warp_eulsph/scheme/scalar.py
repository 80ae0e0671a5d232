"""Scalar conservation laws U_t + ∇·f(U) = 0 on a fixed cloud, by the paper's two schemes (§4.1)."""

import functools
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..boundaries.base import Assembly, Region
from ..execution import Launcher, device_of
from ..fields import allocate, structure
from ..order import Order
from ..space import Space
from ..structs import ParticleArrays
from ..turns import in_turn
from ..weights import CubicSpline, Weight
from .reference import Configuration
from .smoothing import NeighbourAverage, Smoothing


@dataclass(frozen=True)
class LinearAdvection:
    """f(U) = a U.

    Args:
        velocity: a [m/s], one component per dimension.
    """

    velocity: tuple[float, ...]

    def __post_init__(self) -> None:
        if not all(math.isfinite(component) for component in self.velocity):
            raise ValueError(f"advection velocity must be finite, got {self.velocity} m/s")


class ScalarScheme(ABC):
    """How one step advances U."""

    smoothing: Smoothing | None

    @abstractmethod
    def step(self, law: "ConservationLaw", dt: float) -> None:
        """Advance ``law.U`` by ``dt`` [s]."""


@dataclass(frozen=True)
class OneStepLax(ScalarScheme):
    """U^{n+1} = S(Uⁿ) − Δt ∇·f(Uⁿ): first order, stable to CFL 1 on three particles.

    Args:
        smoothing: S; NeighbourAverage() is the paper's. LinearExact() is too weak: long waves grow.
    """

    smoothing: Smoothing = NeighbourAverage()

    def step(self, law: "ConservationLaw", dt: float) -> None:
        law.smooth(self.smoothing, law.half)  # S(Uⁿ)
        law.differentiate(law.U)  # ∇·f(Uⁿ)
        law.advance(law.half, dt, law.U)
        law.hold(law.U)


@dataclass(frozen=True)
class TwoStepLaxWendroff(ScalarScheme):
    """U^{n+½} = S(Uⁿ) − Δt/2 ∇·f(Uⁿ), U^{n+1} = Uⁿ − Δt ∇·f(U^{n+½}) (P8): second order, CFL 2 on three particles.

    Args:
        smoothing: S; None is the identity (explicit midpoint), which is unstable for advection without dissipation.
    """

    smoothing: Smoothing | None = NeighbourAverage()

    def step(self, law: "ConservationLaw", dt: float) -> None:
        law.smooth(self.smoothing, law.half)  # S(Uⁿ)
        law.differentiate(law.U)  # ∇·f(Uⁿ)
        law.advance(law.half, 0.5 * dt, law.half)  # U^{n+½}
        law.hold(law.half)
        law.differentiate(law.half)  # ∇·f(U^{n+½})
        law.advance(law.U, dt, law.U)  # U^{n+1}
        law.hold(law.U)


@functools.cache
def _linear_flux(space: Space, velocity: tuple[float, ...]) -> wp.Function:
    """``wp.func`` U -> a U."""
    real, vec, dim = space.real, space.vec, space.dim
    a = vec(*velocity)

    @wp.func
    def linear_flux(U: real) -> vec:
        f = vec()
        for i in range(wp.static(dim)):
            f[i] = a[i] * U
        return f

    return linear_flux


@functools.cache
def _make_flux(space: Space, function: Any) -> wp.Kernel:
    """Kernel: f(U_a)."""
    vec, row = space.vec, space.row(1)

    @wp.kernel(module="unique", enable_backward=False)
    def compute_flux(first: int, U: wp.array(dtype=row), out: wp.array(dtype=vec)):
        a = first + wp.tid()
        out[a] = function(U[a][0])

    return compute_flux


@functools.cache
def _make_advance(space: Space) -> wp.Kernel:
    """Kernel: out = base − Δt ∇·f."""
    real, mat, row = space.real, space.mat, space.row(1)

    @wp.kernel(module="unique", enable_backward=False)
    def advance(first: int, base: wp.array(dtype=row), dt: real, grad_f: wp.array(dtype=mat), out: wp.array(dtype=row)):
        a = first + wp.tid()
        out[a] = base[a] - row(dt * wp.trace(grad_f[a]))

    return advance


@functools.cache
def _make_hold(space: Space) -> wp.Kernel:
    row = space.row(1)

    @wp.kernel(module="unique", enable_backward=False)
    def hold(first: int, indices: wp.array(dtype=wp.int32), values: wp.array(dtype=row), U: wp.array(dtype=row)):
        k = first + wp.tid()
        U[indices[k]] = values[k]

    return hold


@in_turn("run")
class ConservationLaw:
    """A scalar conservation law on particles that do not move.

    Args:
        x: positions [m], (n, dim).
        volume: volumes [m^dim], a number or (n,).
        U: initial values, (n,).
        flux: LinearAdvection(velocity), or a ``wp.func`` of one real that returns the flux vector.
        scheme: OneStepLax() or TwoStepLaxWendroff().
        weight: SPH weight.
        dilation: smoothing length over spacing, spacing = volume^(1/dim).
        periodic: lengths [m] of a periodic box with a corner at the origin, (dim,), 0 where open; None is open.
        held: region whose particles keep their initial value, such as an inflow; None holds none.
        dtype: ``wp.float64`` or ``wp.float32``.
        device: Warp device name; the default device if None.

    Attributes:
        U, half: (n,) of one-component rows, Uⁿ and the half step.
        t: time [s].
        flux: as given.
        start: initial values, (n,).
        held: numbers of the held particles, (k,).
    """

    def __init__(
        self,
        x: np.ndarray,
        volume: Any,
        U: np.ndarray,
        *,
        flux: Any,
        scheme: ScalarScheme = TwoStepLaxWendroff(),
        weight: Weight = CubicSpline(),
        dilation: float = 1.3,
        periodic: Sequence[float] | None = None,
        held: Region | None = None,
        dtype: type = wp.float64,
        device: wp.DeviceLike = None,
    ):
        x = np.asarray(x, dtype=float)
        if x.ndim != 2 or x.shape[1] not in (1, 2, 3):
            raise ValueError(f"positions must have shape (n, 1), (n, 2) or (n, 3), got {x.shape}")
        n, dim = x.shape
        if np.shape(U) != (n,):
            raise ValueError(f"initial values must have shape ({n},), got {np.shape(U)}")
        self.space = space = Space(dim, dtype, periodic is not None)
        self.device, self.scheme, self.n, self.t = device_of(device), scheme, n, 0.0
        self.flux, self._function, self._launch = flux, flux, Launcher(device)
        if isinstance(flux, LinearAdvection):
            if len(flux.velocity) != dim:
                raise ValueError(f"advection velocity must have {dim} components, got {flux.velocity}")
            self._function = _linear_flux(space, flux.velocity)
        volume = np.broadcast_to(np.asarray(volume, dtype=float), n)
        if not (volume > 0.0).all():
            raise ValueError(f"volumes must be positive, got a least one of {volume.min()} m^{dim}")
        spacing = volume ** (1.0 / dim)
        particles: ParticleArrays = allocate(space, "Particles", n, self.device)
        for field, values in (("mass", volume), ("V0", volume), ("h", dilation * spacing), ("spacing", spacing)):
            getattr(particles, field).assign(values)
        state = structure(space, "State")()
        state.x = wp.array(x, dtype=space.vec, device=self.device)
        state.F = wp.array(np.broadcast_to(np.eye(dim), (n, dim, dim)), dtype=space.mat, device=self.device)
        box = tuple(periodic) if periodic is not None else (0.0,) * dim
        self.configuration = Configuration(space, weight, particles, box, self.device)
        self.configuration.refresh(state)
        row = space.row(1)
        self.U = wp.array(np.reshape(U, (n, 1)), dtype=row, device=self.device)
        self.half = wp.zeros(n, dtype=row, device=self.device)
        self._grad_U = wp.zeros(n, dtype=space.row_gradient(1), device=self.device)
        self._flux = wp.zeros(n, dtype=space.vec, device=self.device)
        self._grad_flux = wp.zeros(n, dtype=space.mat, device=self.device)
        chosen = np.zeros(0, dtype=np.int32)
        if held is not None:
            chosen = Assembly(space, self.device, x, particles, {}, Order(n, self.device)).select(held, None, "held")
        self.start, self.held = np.array(U, dtype=float), chosen
        self._held = wp.array(chosen, dtype=wp.int32, device=self.device)
        self._held_values = wp.array(np.reshape(U, (n, 1))[chosen], dtype=row, device=self.device)

    @property
    def values(self) -> np.ndarray:
        """U, a copy of shape (n,)."""
        return self.U.numpy()[:, 0].copy()

    def run(self, until: float, dt: float) -> None:
        """Steps of ``dt`` [s] to the time ``until`` [s]; the last one is shortened if it must be."""
        if not (math.isfinite(dt) and dt > 0.0):
            raise ValueError(f"time step must be positive and finite, got {dt} s")
        # A remainder of less than 1e-9 steps is rounding of the caller's numbers, not another step
        for k in range(math.ceil((until - self.t) / dt - 1e-9), 0, -1):
            self.step(dt if k > 1 else until - self.t)

    def step(self, dt: float) -> None:
        """One step of ``dt`` [s]."""
        self.scheme.step(self, dt)
        self.t += dt

    def smooth(self, smoothing: Smoothing | None, out: wp.array) -> None:
        """``out`` ← S(U)."""
        if smoothing is None:
            wp.copy(out, self.U)
            return
        if smoothing.needs_gradient:
            self.configuration.gradient(self.U, self._grad_U)
        smoothing.apply(self.space, self.configuration, self.U, self._grad_U, out)

    def differentiate(self, U: wp.array) -> None:
        """∇f(U) (M4), whose trace ``advance`` takes."""
        self._launch(_make_flux(self.space, self._function), self.n, [U, self._flux])
        self.configuration.gradient(self._flux, self._grad_flux)

    def advance(self, base: wp.array, dt: float, out: wp.array) -> None:
        """``out`` ← base − Δt ∇·f of the last ``differentiate``."""
        self._launch(_make_advance(self.space), self.n, [base, dt, self._grad_flux, out])

    def hold(self, U: wp.array) -> None:
        """Give the held particles their initial value."""
        if len(self._held):
            arguments = [self._held, self._held_values, U]
            self._launch(_make_hold(self.space), len(self._held), arguments)
