"""Prescribed velocities."""

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import warp as wp

from ..execution import Launcher
from ..space import Space
from ..structs import ClockArrays, StateArrays
from .base import Assembly, Bound, Boundary, Region
from .value import Value


@dataclass(frozen=True, eq=False)
class Velocity(Boundary):
    """v = value on a region, in all or some directions.

    Args:
        region: particles (see ``Region``); None takes all of the body.
        value: m/s; constant, array or function of (x, t) (see ``Value``).
        axes: directions that are prescribed, all by default.
        body: name of the body, any by default.
    """

    region: Region | None = None
    value: Any = 0.0
    axes: Sequence[int] | None = None
    body: str | None = None

    def bind(self, assembly: Assembly) -> "BoundVelocity":
        return BoundVelocity(self, assembly, "Velocity")


@functools.cache
def _make_impose(space: Space) -> wp.Kernel:
    vec, dim = space.vec, space.dim

    @wp.kernel(module="unique", enable_backward=False)
    def impose(
        first: int,
        indices: wp.array(dtype=wp.int32),
        values: wp.array(dtype=vec),
        axes: wp.vec3i,
        v: wp.array(dtype=vec),
    ):
        k = first + wp.tid()
        v_a = v[indices[k]]
        for i in range(wp.static(dim)):
            if axes[i] != 0:
                v_a[i] = values[k][i]
        v[indices[k]] = v_a

    return impose


class BoundVelocity(Bound):
    """Writes the value into the velocity; ``who`` is the condition that errors name."""

    sortable = True

    def __init__(self, condition: Velocity, assembly: Assembly, who: str):
        self.space, self.device = assembly.space, assembly.device
        self._launch = Launcher(assembly.device)
        self.indices = assembly.select(condition.region, condition.body, who)
        self.values = Value(assembly, self.indices, self.space.dim, condition.value, who)
        self.recordable = self.independent = self.values.recordable
        self.steady = self.values.function is None
        axes = range(self.space.dim) if condition.axes is None else condition.axes
        known = range(self.space.dim)
        if not isinstance(axes, Iterable):
            raise ValueError(f"{who}: axes must be a list among {list(known)}, got {axes!r}; write axes=[{axes}]")
        if not all(isinstance(axis, Integral) and axis in known for axis in axes) or len(list(axes)) == 0:
            raise ValueError(f"{who}: axes must be among {list(known)}, got {condition.axes}")
        self.axes = wp.vec3i(*[int(i in axes) for i in range(3)])

    def impose(self, state: StateArrays, clock: ClockArrays, fraction: float) -> None:
        values = self.values.at(state.x, clock, fraction)
        arguments = [self.values.places, values, self.axes, state.v]
        self._launch(_make_impose(self.space), len(self.indices), arguments)


@dataclass(frozen=True, eq=False)
class Fixed(Boundary):
    """v = 0 on a region.

    Args:
        region: particles (see ``Region``); None takes all of the body.
        axes: directions that are held, all by default.
        body: name of the body, any by default.
    """

    region: Region | None = None
    axes: Sequence[int] | None = None
    body: str | None = None

    def bind(self, assembly: Assembly) -> "BoundVelocity":
        return BoundVelocity(Velocity(self.region, 0.0, self.axes, self.body), assembly, "Fixed")
