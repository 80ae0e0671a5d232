"""Body forces: gravity, centrifugal or manufactured ones."""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..execution import Launcher
from ..space import Space
from ..structs import ClockArrays, StateArrays
from .base import Assembly, Bound, Boundary, Region
from .value import Value


@dataclass(frozen=True, eq=False)
class BodyForce(Boundary):
    """Force per mass on a region, m_a b on each particle; gravity is ``BodyForce((0.0, 0.0, -9.81))``.

    Args:
        value: b [m/s²]; constant, array or function of (x, t) (see ``Value``).
        region: particles (see ``Region``); None takes all of the body.
        body: name of the body, any by default.
        material: a function takes the initial position X instead of the present x, as manufactured solutions state it.
    """

    value: Any
    region: Region | None = None
    body: str | None = None
    material: bool = False

    def bind(self, assembly: Assembly) -> "BoundBodyForce":
        return BoundBodyForce(self, assembly)


@functools.cache
def _make_load(space: Space) -> wp.Kernel:
    real, vec = space.real, space.vec

    @wp.kernel(module="unique", enable_backward=False)
    def load(
        first: int,
        indices: wp.array(dtype=wp.int32),
        values: wp.array(dtype=vec),
        mass: wp.array(dtype=real),
        external: wp.array(dtype=vec),
    ):
        k = first + wp.tid()
        a = indices[k]
        external[a] = external[a] + values[k] * mass[a]

    return load


class BoundBodyForce(Bound):
    """Adds the weight of the particles."""

    reads_surface = False
    sortable = True

    def __init__(self, condition: BodyForce, assembly: Assembly):
        who = type(condition).__name__
        self.space, self.device, self.mass = assembly.space, assembly.device, assembly.particles.mass
        self._launch = Launcher(assembly.device)
        self.indices = assembly.select(condition.region, condition.body, who)
        self.values = Value(assembly, self.indices, self.space.dim, condition.value, who)
        self.recordable = self.independent = self.values.recordable
        self.X: wp.array | None = None
        if condition.material:
            self.X = assembly.order.carry(assembly.X, self.space.vec)

    def load(self, state: StateArrays, clock: ClockArrays, fraction: float, external: wp.array) -> None:
        values = self.values.at(state.x if self.X is None else self.X, clock, fraction)
        arguments = [self.values.places, values, self.mass, external]
        self._launch(_make_load(self.space), len(self.indices), arguments)
