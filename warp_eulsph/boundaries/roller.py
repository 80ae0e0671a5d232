"""Frictionless rollers: no velocity along a normal."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import warp as wp

from ..execution import Launcher
from ..space import Space
from ..structs import ClockArrays, StateArrays
from .base import Assembly, Bound, Boundary, Region, unit_vector


@dataclass(frozen=True, eq=False)
class Roller(Boundary):
    """v·n = 0 on a region, for any normal n; along an axis ``Fixed(region, axes=...)`` does the same.

    Args:
        region: particles (see ``Region``); None takes all of the body.
        normal: direction n that is held, (dim,), of any length.
        body: name of the body, any by default.
    """

    region: Region | None
    normal: Sequence[float]
    body: str | None = None

    def bind(self, assembly: Assembly) -> "BoundRoller":
        return BoundRoller(self, assembly)


@functools.cache
def _make_impose(space: Space) -> wp.Kernel:
    vec = space.vec

    @wp.kernel(module="unique", enable_backward=False)
    def impose(first: int, indices: wp.array(dtype=wp.int32), normal: vec, v: wp.array(dtype=vec)):
        a = indices[first + wp.tid()]
        v[a] = v[a] - normal * wp.dot(normal, v[a])

    return impose


class BoundRoller(Bound):
    """Removes the velocity along the normal."""

    recordable = True
    sortable = True
    independent = True
    steady = True

    def __init__(self, condition: Roller, assembly: Assembly):
        who = type(condition).__name__
        self.space, self.device = assembly.space, assembly.device
        self._launch = Launcher(assembly.device)
        self.normal = unit_vector(condition.normal, self.space.dim, who)
        self.indices = assembly.select(condition.region, condition.body, who)
        self._places = assembly.order.places_of(self.indices)

    def impose(self, state: StateArrays, clock: ClockArrays, fraction: float) -> None:
        arguments = [self._places, self.space.vec(*self.normal), state.v]
        self._launch(_make_impose(self.space), len(self.indices), arguments)
