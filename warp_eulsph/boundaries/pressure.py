"""Pressure that follows the surface."""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..fields import structure
from ..space import Space
from .base import Assembly, Bound, Boundary, Region
from .value import Value


@dataclass(frozen=True, eq=False)
class Pressure(Boundary):
    """−p s_a on a region, s_a the present area vectors (M10): a follower load, zero inside the body.

    The area vectors of a surface spread over the particles within two support radii of it, the outermost one holding
    more than its share and those beneath it taking that back: select all of these layers, not the outermost alone.

    Args:
        value: p [Pa]; constant, array or function of (x, t) (see ``Value``).
        region: particles (see ``Region``); None takes the whole surface of the body.
        body: name of the body, any by default.
    """

    value: Any
    region: Region | None = None
    body: str | None = None

    def bind(self, assembly: Assembly) -> "BoundPressure":
        return BoundPressure(self, assembly)


@functools.cache
def _make_load(space: Space) -> Any:
    vec, one, State = space.vec, space.row(1), structure(space, "State")

    @wp.kernel(module="unique", enable_backward=False)
    def load(
        indices: wp.array(dtype=wp.int32), values: wp.array(dtype=one), state: State, external: wp.array(dtype=vec)
    ):
        k = wp.tid()
        a = indices[k]
        external[a] = external[a] - state.surface[a] * values[k][0]

    return load


class BoundPressure(Bound):
    """Adds the pressure force."""

    sortable = True

    def __init__(self, condition: Pressure, assembly: Assembly):
        who = type(condition).__name__
        self.space, self.device = assembly.space, assembly.device
        self.indices = assembly.select(condition.region, condition.body, who)
        self.values = Value(assembly, self.indices, 1, condition.value, who)
        self.recordable = self.values.recordable

    def load(self, state: Any, clock: Any, fraction: float, external: wp.array) -> None:
        values = self.values.at(state.x, clock, fraction)
        arguments = [self.values.places, values, state, external]
        wp.launch(_make_load(self.space), len(self.indices), arguments, device=self.device)
