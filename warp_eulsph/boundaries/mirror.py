"""Mirror ghosts: particles behind a plane that copy those in front of it, so that the plane has no one-sided sums."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..checks import real_array
from ..execution import Launcher
from ..fields import structure
from ..space import Space
from ..structs import ClockArrays, StateArrays
from .base import Assembly, Bound, Boundary, unit_vector


@dataclass(frozen=True)
class Image:
    """How a ghost copies its source; ``Wall`` or ``Antisymmetry``."""

    odd: ClassVar[bool]


@dataclass(frozen=True)
class Wall(Image):
    """Symmetry plane, frictionless wall, or fixed end in 1-D: v' = R v, F' = R F R with R = I − 2 n⊗n."""

    odd = False


@dataclass(frozen=True)
class Antisymmetry(Image):
    """Plane that holds tangential motion and bears no normal traction; the free end of a bar in 1-D. Linear laws only.

    The displacement turns its sign with the reflection: u' = −R u, v' = −R v, F' − I = −R (F − I) R, and so the stress.
    """

    odd = True


@dataclass(frozen=True)
class NoSlip(Image):
    """Wall that a viscous fluid sticks to, by which the mean of a particle and its ghost moves: v' = 2 v_w − v.

    Args:
        velocity: v_w of the wall within its plane [m/s], (dim,); None is a wall at rest.
    """

    velocity: Sequence[float] | None = None
    odd = False


@dataclass(frozen=True, eq=False)
class MirrorGhosts(Boundary):
    """Overwrites the ghosts that ``mirror`` made; list it after the conditions on its sources.

    Args:
        body: name of the body.
        sources: particles of the body that are copied, (k,).
        ghosts: particles of the body that copy them, (k,).
        point: a point of the plane [m], (dim,).
        normal: unit normal of the plane, (dim,).
        image: Wall(), Antisymmetry() or NoSlip().
    """

    body: str
    sources: np.ndarray
    ghosts: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    image: Image

    def bind(self, assembly: Assembly) -> "BoundMirrorGhosts":
        return BoundMirrorGhosts(self, assembly)


def mirror(
    body: Any, *, point: Sequence[float], normal: Sequence[float], depth: float, image: Image = Wall()
) -> tuple[Any, MirrorGhosts]:
    """The body with ghosts behind a plane, and the condition that moves them.

    Ghosts are ordinary particles. Those next to the plane need all of their own neighbours, and these theirs, so take
    ``depth`` = three support radii = 3 · weight.support · dilation · spacing; two are enough where the arrangement is
    read anew, or dissipation switched off. They are flattened with what they copy, and what was further away at the
    start has none: where matter flows take what may come near. Two planes: mirror the result again; ghosts of ghosts
    fill the corner.

    Args:
        body: a ``Body`` in front of the plane.
        point: a point of the plane [m], (dim,).
        normal: normal of the plane, pointing out of the body, (dim,).
        depth: distance from the plane within which particles get a ghost [m].
        image: Wall(), NoSlip() for a viscous fluid, or Antisymmetry() for a linear law.

    Raises:
        ValueError: particles on or behind the plane, none within ``depth``, Antisymmetry without a linear law, a wall
            that does not move within its plane.
    """
    dim = body.x.shape[1]
    n, p = unit_vector(normal, dim, "mirror"), real_array(point, "mirror: point")
    if p.shape != (dim,) or not np.isfinite(p).all():
        raise ValueError(f"mirror: point must be ({dim},) finite numbers, got {point}")
    if image.odd and not body.material.linear:
        raise ValueError(
            "mirror: Antisymmetry needs a linear law such as Bar or LinearElastic, got "
            f"{type(body.material).__name__}; a free surface needs no ghosts otherwise"
        )
    if isinstance(image, NoSlip) and image.velocity is not None:
        speed = real_array(image.velocity, "mirror: velocity of the wall")
        if speed.shape != (dim,) or abs(speed @ n) > 1e-12 * np.linalg.norm(speed):
            raise ValueError(f"mirror: a wall must move within its plane, ({dim},), got the velocity {image.velocity}")
    distance = (p - body.x) @ n
    spacing = np.broadcast_to(body.spacing, len(body.x))
    if (distance < 0.01 * spacing).any():
        worst = int(distance.argmin())
        raise ValueError(
            f"mirror: particles must lie in front of the plane and off it, got particle {worst} at {body.x[worst]} m, "
            f"{-distance[worst]:.6g} m along the normal; put the nearest ones half a spacing in front"
        )
    sources = np.flatnonzero(distance < depth)
    if sources.size == 0:
        raise ValueError(
            f"mirror: no particle within depth {depth} m of the plane, the nearest is {distance.min():.6g} m away"
        )
    shift = 2.0 * distance[sources, None] * n
    fields = {name: np.concatenate([field, field[sources]]) for name, field in _fields(body)}
    if body.surface is not None:
        fields["surface"] = np.concatenate([body.surface, body.surface[sources] @ _reflection(n)])
    extended = replace(body, x=np.concatenate([body.x, body.x[sources] + shift]), **fields)
    ghosts = np.arange(len(body.x), len(extended.x))
    return extended, MirrorGhosts(body.name, sources, ghosts, p, n, image)


def _reflection(n: np.ndarray) -> np.ndarray:
    return np.eye(len(n)) - 2.0 * np.outer(n, n)


def _fields(body: Any) -> list[tuple[str, np.ndarray]]:
    n, dim = body.x.shape
    shapes = {"volume": (n,), "spacing": (n,), "velocity": (n, dim)}
    return [(name, np.broadcast_to(getattr(body, name), shape)) for name, shape in shapes.items()]


@functools.cache
def _make_reflect(space: Space, odd: bool, sticks: bool) -> wp.Kernel:
    real, vec, State = space.real, space.vec, structure(space, "State")

    @wp.kernel(module="unique", enable_backward=False)
    def reflect(
        first: int,
        sources: wp.array(dtype=wp.int32),
        ghosts: wp.array(dtype=wp.int32),
        X: wp.array(dtype=vec),
        point: vec,
        normal: vec,
        wall: vec,
        state: State,
    ):
        k = first + wp.tid()
        a = sources[k]
        g = ghosts[k]
        unit = wp.identity(n=wp.static(space.dim), dtype=real)
        R = unit - wp.outer(normal, normal) * real(2.0)
        if wp.static(odd):
            state.v[g] = -(R @ state.v[a])
            state.F[g] = unit - R @ (state.F[a] - unit) @ R
            state.x[g] = X[g] - R @ (state.x[a] - X[a])
        else:
            if wp.static(sticks):
                state.v[g] = wall * real(2.0) - state.v[a]
            else:
                state.v[g] = R @ state.v[a]
            state.F[g] = R @ state.F[a] @ R
            state.x[g] = point + R @ (state.x[a] - point)

    return reflect


@functools.cache
def _make_copy(space: Space) -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False)
    def copy(
        first: int,
        sources: wp.array(dtype=wp.int32),
        ghosts: wp.array(dtype=wp.int32),
        values: wp.array(dtype=space.real),
    ):
        k = first + wp.tid()
        values[ghosts[k]] = values[sources[k]]

    return copy


class BoundMirrorGhosts(Bound):
    """Writes velocity, deformation gradient and position of the ghosts."""

    recordable = True
    sortable = True
    independent = True

    def __init__(self, condition: MirrorGhosts, assembly: Assembly):
        self.space, self.device, self.image = assembly.space, assembly.device, condition.image
        self._launch = Launcher(assembly.device)
        first = assembly.bodies[condition.body][0] if condition.body in assembly.bodies else 0
        self.indices = assembly.select(first + condition.ghosts, condition.body, "MirrorGhosts")
        sources = (first + condition.sources).astype(np.int32)
        self._sources, self._ghosts = (assembly.order.places_of(numbers) for numbers in (sources, self.indices))
        self._X = assembly.order.carry(assembly.X, self.space.vec)
        share = assembly.particles.share.numpy().copy()
        share[self._ghosts.numpy()] = 0.0
        assembly.particles.share.assign(share)
        self._sticks = isinstance(self.image, NoSlip)
        moving = getattr(self.image, "velocity", None)
        wall = np.zeros(self.space.dim) if moving is None else moving
        self._plane = [self.space.vec(*given) for given in (condition.point, condition.normal, wall)]

    def impose(self, state: StateArrays, clock: ClockArrays, fraction: float) -> None:
        arguments = [self._sources, self._ghosts, self._X, *self._plane, state]
        kernel = _make_reflect(self.space, self.image.odd, self._sticks)
        self._launch(kernel, len(self.indices), arguments)

    def reflect(self, values: wp.array) -> None:
        self._launch(_make_copy(self.space), len(self.indices), [self._sources, self._ghosts, values])
