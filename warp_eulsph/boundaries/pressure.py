"""Pressure that follows the surface."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..execution import Launcher
from ..fields import structure
from ..linalg import cofactor
from ..space import Space
from ..structs import ClockArrays, StateArrays
from .base import Assembly, Bound, Boundary, Region, rows_of, unit_vector
from .face import faces_along, surfaces_held
from .named_surface import find_surface
from .value import Value


@dataclass(frozen=True, eq=False)
class Pressure(Boundary):
    """−p s_a on a surface, s_a the present area vectors (M10): a follower load.

    The region names the surface by its outermost particles; how deep it reaches beneath them does not matter. The force
    goes to all particles whose area vectors make up that surface, down three support radii, in the proportion in which
    they answer a uniform stress; its sum is p times the vector area of the surface. Without a normal all of the surface
    that the region holds is loaded, whichever way it faces; with one only what faces it.

    Args:
        value: p [Pa]; constant, array or function of (x, t) (see ``Value``), taken at the outermost particles.
        region: particles (see ``Region``) that hold the outermost ones of the surface; None takes all of it.
        body: name of the body, any by default.
        normal: initial outward normal of the face that is loaded, (dim,), of any length; None takes all that the
            region holds.

    Raises:
        ValueError: when the simulation is built: the region holds no outermost particle, or none that faces the normal.
    """

    value: Any
    region: Region | None = None
    body: str | None = None
    normal: Sequence[float] | None = None

    def bind(self, assembly: Assembly) -> "Bound":
        whole = self.region is None and self.normal is None
        return BoundPressure(self, assembly) if whole else BoundFacePressure(self, assembly)


@functools.cache
def _make_load(space: Space) -> wp.Kernel:
    vec, one, State = space.vec, space.row(1), structure(space, "State")

    @wp.kernel(module="unique", enable_backward=False)
    def load(
        first: int,
        indices: wp.array(dtype=wp.int32),
        values: wp.array(dtype=one),
        state: State,
        external: wp.array(dtype=vec),
    ):
        k = first + wp.tid()
        a = indices[k]
        external[a] = external[a] - state.surface[a] * values[k][0]

    return load


@functools.cache
def _make_load_face(space: Space) -> wp.Kernel:
    """Kernel: −p (c s_a + cof(F) r_a): the face's part of the area vector, c s_a and a rest r_a where faces meet."""
    real, vec, one, State, cof = space.real, space.vec, space.row(1), structure(space, "State"), cofactor(space)

    @wp.kernel(module="unique", enable_backward=False)
    def load_face(
        first: int,
        indices: wp.array(dtype=wp.int32),
        rows: wp.array(dtype=wp.int32),
        values: wp.array(dtype=one),
        shares: wp.array(dtype=real),
        rests: wp.array(dtype=vec),
        state: State,
        external: wp.array(dtype=vec),
    ):
        k = first + wp.tid()
        a = indices[k]
        area = state.surface[a] * shares[k] + cof(state.F[a]) @ rests[k]
        external[a] = external[a] - area * values[rows[k]][0]

    return load_face


class BoundPressure(Bound):
    """Adds the pressure on the whole surface."""

    sortable = True

    def __init__(self, condition: Pressure, assembly: Assembly):
        who = type(condition).__name__
        self.space, self.device = assembly.space, assembly.device
        self._launch = Launcher(assembly.device)
        self.indices = assembly.select(condition.region, condition.body, who)
        self.values = Value(assembly, self.indices, 1, condition.value, who)
        self.recordable = self.independent = self.values.recordable

    def load(self, state: StateArrays, clock: ClockArrays, fraction: float, external: wp.array) -> None:
        values = self.values.at(state.x, clock, fraction)
        arguments = [self.values.places, values, state, external]
        self._launch(_make_load(self.space), len(self.indices), arguments)


class BoundFacePressure(BoundPressure):
    """Adds the pressure on the part of the surface that the region holds.

    Attributes:
        members: numbers of the particles that carry it, (k,), and ``areas``, their initial area vectors [m^(dim−1)],
            (k, dim), which sum to the vector area of that part; from ``start`` on.
    """

    def __init__(self, condition: Pressure, assembly: Assembly):
        super().__init__(condition, assembly)
        self.condition, self.assembly = condition, assembly
        self.normal = None
        if condition.normal is not None:
            self.normal = unit_vector(condition.normal, self.space.dim, "Pressure")

    def start(self, state: StateArrays) -> None:
        assembly = self.assembly
        if self.normal is not None:
            face = faces_along(assembly, state, self.indices, self.condition.body, self.normal, "Pressure")
            self.members, self.areas = face.members, face.areas[:, None] * self.normal
            tops = face.tops[face.columns]
        else:
            vectors, top = np.zeros(assembly.X.shape), np.full(len(assembly.X), -1)
            for own, surface, chosen in surfaces_held(assembly, state, self.indices, self.condition.body):
                vectors[own], found = find_surface(surface, chosen, "Pressure")
                top[own] = np.where(found < 0, -1, found + own[0])
            self.members = np.flatnonzero(top >= 0)
            self.areas, tops = vectors[self.members], top[self.members]
        s = assembly.order.by_number(state.surface.numpy())[self.members].astype(float)
        square = (s**2).sum(axis=1)
        shares = np.where(square > 0.0, (self.areas * s).sum(axis=1) / np.where(square > 0.0, square, 1.0), 0.0)
        rests = self.areas - shares[:, None] * s
        self._places = assembly.order.places_of(self.members.astype(np.int32))
        self._rows = wp.array(rows_of(self.indices, tops), dtype=wp.int32, device=self.device)
        self._shares = wp.array(shares, dtype=self.space.real, device=self.device)
        self._rests = wp.array(rests, dtype=self.space.vec, device=self.device)

    def load(self, state: StateArrays, clock: ClockArrays, fraction: float, external: wp.array) -> None:
        values = self.values.at(state.x, clock, fraction)
        arguments = [self._places, self._rows, values, self._shares, self._rests, state, external]
        self._launch(_make_load_face(self.space), len(self.members), arguments)
