"""The oscillation sensor d of the paper (§5): 0 where the velocity is smooth, 1 where it needs dissipation."""

import functools
import math
from abc import ABC
from dataclasses import dataclass
from typing import ClassVar

import warp as wp

from ..execution import Launcher
from ..fields import neighbour_structure, structure
from ..operators.second_derivative import make_second_derivative
from ..space import Space
from ..structs import FluxArrays, ParticleArrays
from .reference import Configuration


@dataclass(frozen=True)
class Sensor(ABC):
    """d_a = min(1, X max |∇²v_i|) over the support of a, one value per direction i.

    ∇²v_i is the compact second derivative of component i, which sees the saw-tooth.

    Args:
        X: gain, in the unit of the subclass.
    """

    X: float

    #: The gain is X h²/c instead of X.
    dimensionless: ClassVar[bool]

    def __post_init__(self) -> None:
        if not (math.isfinite(self.X) and self.X >= 0.0):
            raise ValueError(f"sensor X must be finite and at least 0, got {self.X}; 0 switches the dissipation off")


@dataclass(frozen=True)
class PaperSensor(Sensor):
    """As printed: X in m·s, to be tuned to spacing and speed; the paper's bar has 5.5e-7."""

    X: float = 5.5e-7
    dimensionless = False


@dataclass(frozen=True)
class DimensionlessSensor(Sensor):
    """X h²/c with the pressure-wave speed c, so that d depends on the velocity jump over c alone.

    The paper's bar (h = dx = 3.3 mm, c = 5053 m/s) has X = 250: d reaches 1 at a jump of 0.4 % of c.
    """

    X: float = 250.0
    dimensionless = True


@functools.cache
def modulation(space: Space, dimensionless: bool) -> wp.Function:
    """``wp.func`` d in [0, 1] from X, |∇²v_i| [1/(m s)], h [m] and c [m/s]."""
    real = space.real

    @wp.func
    def modulation(X: real, curvature: real, h: real, c: real) -> real:
        strength = X * curvature
        if wp.static(dimensionless):
            strength = strength * h * h
            # Compared before dividing: c may be zero where a law softens
            if strength >= c and strength > real(0.0):
                strength = real(1.0)
            elif c > real(0.0):
                strength = strength / c
        return wp.min(strength, real(1.0))

    return modulation


@functools.cache
def _make_sense(space: Space, dimensionless: bool) -> wp.Kernel:
    """Kernel: d_a from the largest |∇²v| of a and its neighbours, direction by direction."""
    real, vec, dim = space.real, space.vec, space.dim
    Reference, Flux, Neighbours = structure(space, "Reference"), structure(space, "Flux"), neighbour_structure(space)
    d_of = modulation(space, dimensionless)

    @wp.kernel(module="unique", enable_backward=False)
    def sense(
        first: int,
        reference: Reference,
        near: Neighbours,
        flux: Flux,
        curvature: wp.array(dtype=vec),
        X: real,
        d: wp.array(dtype=vec),
    ):
        a = first + wp.tid()
        largest = wp.abs(curvature[a])
        for k in range(near.start[a], near.stop[a], near.stride):
            largest = wp.max(largest, wp.abs(curvature[near.index[k]]))
        d_a = vec()
        for i in range(wp.static(dim)):
            d_a[i] = d_of(X, largest[i], reference.h[a], flux.speed[a])
        d[a] = d_a

    return sense


class SensorField:
    """A sensor at work.

    Attributes:
        d: (n,) of vec in [0, 1].
    """

    def __init__(self, option: Sensor, space: Space, particles: ParticleArrays, device: wp.DeviceLike):
        self.option, self.space, self.device, n = option, space, device, len(particles.mass)
        self._launch = Launcher(device)
        self.d, self._curvature = (wp.zeros(n, dtype=space.vec, device=device) for _ in range(2))

    def compute(self, configuration: Configuration, flux: FluxArrays, v: wp.array, grad_v: wp.array) -> None:
        """``d`` of velocities ``v`` [m/s] with gradients ``grad_v`` [1/s] and the wave speeds in ``flux``."""
        second = [configuration.fields, configuration.near, v, grad_v, self._curvature]
        self._launch(make_second_derivative(self.space, self.space.dim), len(v), second)
        arguments = [configuration.fields, configuration.near, flux, self._curvature, self.option.X, self.d]
        self._launch(_make_sense(self.space, self.option.dimensionless), len(v), arguments)
