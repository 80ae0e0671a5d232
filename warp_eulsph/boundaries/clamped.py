"""A clamp at a plane between particles: the material of the plane stays, not that of the nearest layer."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..execution import Launcher
from ..space import Space
from ..structs import ClockArrays, StateArrays
from .base import Assembly, Bound, Boundary, Region, unit_vector
from .face import faces_along
from .outermost import DEPTH

# Spacings between the plane and the outermost particles of the face it holds, at most.
NEAR = 1.5
# Sum of the areas of a column, over their mean, beneath which its weights would be those of noise.
LEAST_SUM = 0.3


@dataclass(frozen=True, eq=False)
class Clamped(Boundary):
    """v = 0 at a plane that closes the body, in every column of particles beneath it: Σ_a c_a v_a = 0.

    The weights c_a of a column are those with which a traction would act on it, Σ c_a = 1, Σ c_a d_a = 0 with the
    distances d_a from the plane: the sum is the velocity of the column at the plane, exact where it is linear, and what
    holds it there is a traction, in equilibrium with a uniform stress particle by particle. It exerts forces on
    particles of up to three support radii beneath the plane, does no work, and leaves the layers free to strain.

    Args:
        point: a point of the plane [m], (dim,); for bodies of cells the plane lies half a spacing outside of the
            outermost particles.
        normal: normal of the plane, pointing out of the body, (dim,), of any length.
        region: particles (see ``Region``) whose outermost ones are held; None takes all next to the plane.
        body: name of the body, any by default.

    Raises:
        ValueError: when the simulation is built: no outermost particle faces the plane within 1.5 spacings.
    """

    point: Sequence[float]
    normal: Sequence[float]
    region: Region | None = None
    body: str | None = None

    def bind(self, assembly: Assembly) -> "BoundClamped":
        return BoundClamped(self, assembly)


@functools.cache
def _make_hold(space: Space) -> wp.Kernel:
    """Kernel: takes Σ c_a v_a of a column off its velocities by the least change in kinetic energy."""
    real, vec = space.real, space.vec

    @wp.kernel(module="unique", enable_backward=False)
    def hold(
        first: int,
        start: wp.array(dtype=wp.int32),
        indices: wp.array(dtype=wp.int32),
        weights: wp.array(dtype=real),
        mass: wp.array(dtype=real),
        v: wp.array(dtype=vec),
    ):
        column = first + wp.tid()
        moves, square = vec(), real(0.0)
        for k in range(start[column], start[column + 1]):
            a = indices[k]
            moves += v[a] * weights[k]
            square += weights[k] * weights[k] / mass[a]
        for k in range(start[column], start[column + 1]):
            a = indices[k]
            v[a] = v[a] - moves * (weights[k] / (mass[a] * square))

    return hold


class BoundClamped(Bound):
    """Projects the velocities of the columns beneath the plane."""

    recordable = True
    sortable = True
    independent = True
    steady = True

    def __init__(self, condition: Clamped, assembly: Assembly):
        self.condition, self.assembly = condition, assembly
        self.space, self.device, self.mass = assembly.space, assembly.device, assembly.particles.mass
        self._launch = Launcher(assembly.device)
        dim = self.space.dim
        self.normal = unit_vector(condition.normal, dim, "Clamped")
        point = np.asarray(condition.point, dtype=float)
        if point.shape != (dim,) or not np.isfinite(point).all():
            raise ValueError(f"Clamped: point must be ({dim},) finite numbers, got {condition.point}")
        self._spacing = assembly.order.by_number(assembly.particles.spacing.numpy()).astype(float)
        self._distance = (point - assembly.X) @ self.normal
        held = assembly.select(condition.region, condition.body, "Clamped")
        near = np.abs(self._distance[held]) < NEAR * self._spacing[held]
        if not near.any():
            least = np.abs(self._distance[held]).min()
            raise ValueError(
                f"Clamped: the plane must lie within {NEAR} spacings of the outermost particles, the nearest particle "
                f"is {least:.6g} m away; move the point to the face of the body, half a spacing outside of them"
            )
        self._tops = held[near]
        behind = self._distance[held] < -0.55 * self._spacing[held]
        if behind.any():
            first = held[np.flatnonzero(behind)[0]]
            raise ValueError(
                f"Clamped: the plane must close the body, got {behind.sum()} particles more than half a spacing behind "
                f"it, the first at {assembly.X[first]} m; limit the region, or hold what lies inside by Fixed"
            )
        # more than it will be, until area vectors are known
        deep = (self._distance > -NEAR * self._spacing) & (self._distance < (DEPTH + NEAR) * self._spacing)
        self._start: wp.array | None = None
        self.indices = np.union1d(self._tops, np.flatnonzero(deep)).astype(np.int32)

    def start(self, state: StateArrays) -> None:
        face = faces_along(self.assembly, state, self._tops, self.condition.body, self.normal, "Clamped")
        order = np.lexsort((face.members, face.columns))
        members, columns, areas = face.members[order], face.columns[order], face.areas[order]
        count = len(face.tops)
        areas = _positive(columns, areas, members == face.tops[columns], count)
        weights = _exact_for_linear(columns, areas, self._distance[members] / self._spacing[members], count)
        self.indices = np.sort(members).astype(np.int32)
        self._start = wp.array(np.searchsorted(columns, np.arange(count + 1)), dtype=wp.int32, device=self.device)
        self._places = self.assembly.order.places_of(members.astype(np.int32))
        self._weights = wp.array(weights, dtype=self.space.real, device=self.device)
        self._hold(state.v)

    def impose(self, state: StateArrays, clock: ClockArrays, fraction: float) -> None:
        self._hold(state.v)

    def _hold(self, v: wp.array) -> None:
        if self._start is not None:  # initial velocities are imposed before area vectors are known, and again after
            arguments = [self._start, self._places, self._weights, self.mass, v]
            self._launch(_make_hold(self.space), len(self._start) - 1, arguments)


def _positive(columns: np.ndarray, areas: np.ndarray, top: np.ndarray, count: int) -> np.ndarray:
    """The areas, (k,), all with the outermost particle where disorder leaves a column with hardly any."""
    sums = np.bincount(columns, areas, minlength=count)
    poor = (sums < LEAST_SUM * sums.mean())[columns]
    return np.where(poor, top.astype(float), areas)


def _exact_for_linear(columns: np.ndarray, areas: np.ndarray, d: np.ndarray, count: int) -> np.ndarray:
    """Weights of each column next to its areas, (k,): Σ c = 1 and, where it is deeper than one particle, Σ c d = 0."""

    def total(values: np.ndarray) -> np.ndarray:
        return np.bincount(columns, values, minlength=count)

    c = areas / total(areas)[columns]
    # The least change of c within the two outermost layers: by 1 and d, weighted by how near they are
    w = np.exp(-d)
    m0, m1, m2 = total(w), total(w * d), total(w * d * d)
    determinant = m0 * m2 - m1 * m1
    deep = determinant > 1e-6 * m0 * m0
    moment = -total(c * d)
    slope = np.where(deep, moment * m0 / np.where(deep, determinant, 1.0), 0.0)
    return c + w * (slope[columns] * (d - (m1 / m0)[columns]))
