"""Traction per initial area on a face."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..execution import Launcher
from ..space import Space
from ..structs import ClockArrays, StateArrays
from .base import Assembly, Bound, Boundary, Region, rows_of, unit_vector
from .face import faces_along
from .value import Value


@dataclass(frozen=True, eq=False)
class Traction(Boundary):
    """Nominal traction t on a face: force t (s_0·n) with the initial area vectors s_0, fixed in direction.

    The region names the face by its outermost particles; how deep it reaches beneath them does not matter. The force
    goes to all particles whose area vectors make up the face, down three support radii, so that a uniform stress t⊗n
    is in equilibrium particle by particle; its sum is t times the area of the face, projected along n where it is
    curved.

    Args:
        value: t [N per initial m^(dim−1)]; constant, array or function of (x, t) (see ``Value``), taken at the
            outermost particles.
        normal: outward unit normal n of the face, (dim,), of any length.
        region: particles (see ``Region``) that hold the outermost ones of the face; None takes all that faces n.
        body: name of the body, any by default.

    Raises:
        ValueError: when the simulation is built: the region holds no outermost particle that faces n.
    """

    value: Any
    normal: Sequence[float]
    region: Region | None = None
    body: str | None = None

    def bind(self, assembly: Assembly) -> "BoundTraction":
        return BoundTraction(self, assembly)


@functools.cache
def _make_load(space: Space) -> wp.Kernel:
    real, vec = space.real, space.vec

    @wp.kernel(module="unique", enable_backward=False)
    def load(
        first: int,
        indices: wp.array(dtype=wp.int32),
        rows: wp.array(dtype=wp.int32),
        values: wp.array(dtype=vec),
        areas: wp.array(dtype=real),
        external: wp.array(dtype=vec),
    ):
        k = first + wp.tid()
        a = indices[k]
        external[a] = external[a] + values[rows[k]] * areas[k]

    return load


class BoundTraction(Bound):
    """Adds the traction force.

    Attributes:
        face: the particles that carry it, and their areas, which sum to the area of the face; from ``start`` on.
    """

    reads_surface = False
    sortable = True

    def __init__(self, condition: Traction, assembly: Assembly):
        who = type(condition).__name__
        self.condition, self.assembly = condition, assembly
        self.space, self.device = assembly.space, assembly.device
        self._launch = Launcher(assembly.device)
        self.normal = unit_vector(condition.normal, self.space.dim, who)
        self.indices = assembly.select(condition.region, condition.body, who)
        self.values = Value(assembly, self.indices, self.space.dim, condition.value, who)
        self.recordable = self.independent = self.values.recordable

    def start(self, state: StateArrays) -> None:
        face = faces_along(self.assembly, state, self.indices, self.condition.body, self.normal, "Traction")
        self.face, self._places = face, self.assembly.order.places_of(face.members)
        rows = rows_of(self.indices, face.tops[face.columns])
        self._rows = wp.array(rows, dtype=wp.int32, device=self.device)
        self._areas = wp.array(face.areas, dtype=self.space.real, device=self.device)

    def load(self, state: StateArrays, clock: ClockArrays, fraction: float, external: wp.array) -> None:
        values = self.values.at(state.x, clock, fraction)
        arguments = [self._places, self._rows, values, self._areas, external]
        self._launch(_make_load(self.space), len(self._places), arguments)
