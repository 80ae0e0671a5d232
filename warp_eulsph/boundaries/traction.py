"""Traction per initial area on a flat face."""

import functools
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..space import Space
from .base import Assembly, Bound, Boundary, Region, unit_vector
from .value import Value

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Traction(Boundary):
    """Nominal traction t on a flat face: force t (s_0·n) with the initial area vectors s_0, fixed in direction.

    The area vectors of a face spread over the particles within two support radii of it, the outermost one holding more
    than its share (1.37 times at dilation 1.3) and those beneath it taking that back: select all of these layers. Then
    the sum of (s_0·n) is the area of the face, and a uniform stress P = t⊗n is in equilibrium particle by particle.

    Args:
        value: t [N per initial m^(dim−1)]; constant, array or function of (x, t) (see ``Value``).
        normal: outward unit normal n of the face, (dim,), of any length.
        region: particles (see ``Region``); None takes all of the body, for a body with one face along n.
        body: name of the body, any by default.
    """

    value: Any
    normal: Sequence[float]
    region: Region | None = None
    body: str | None = None

    def bind(self, assembly: Assembly) -> "BoundTraction":
        return BoundTraction(self, assembly)


@functools.cache
def _make_load(space: Space) -> Any:
    real, vec = space.real, space.vec

    @wp.kernel(module="unique", enable_backward=False)
    def load(
        indices: wp.array(dtype=wp.int32),
        values: wp.array(dtype=vec),
        areas: wp.array(dtype=real),
        external: wp.array(dtype=vec),
    ):
        k = wp.tid()
        a = indices[k]
        external[a] = external[a] + values[k] * areas[k]

    return load


class BoundTraction(Bound):
    """Adds the traction force.

    Attributes:
        areas: initial areas (s_0·n) [m^(dim−1)] of the particles, (k,); their sum is the area of the face.
    """

    reads_surface = False
    sortable = True

    def __init__(self, condition: Traction, assembly: Assembly):
        who = type(condition).__name__
        self.space, self.device = assembly.space, assembly.device
        self.normal = unit_vector(condition.normal, self.space.dim, who)
        self.indices = assembly.select(condition.region, condition.body, who)
        self.values = Value(assembly, self.indices, self.space.dim, condition.value, who)
        self.recordable = self.values.recordable
        self.areas = wp.zeros(len(self.indices), dtype=self.space.real, device=self.device)

    def start(self, state: Any) -> None:
        areas = state.surface.numpy()[self.values.places.numpy()] @ self.normal
        self.areas.assign(areas.astype(self.space.numpy))
        if areas.min() > -0.01 * np.abs(areas).max():
            log.warning(
                "Traction: the region seems to hold only the outermost layer of a face, whose areas sum to %.6g, more "
                "than the face; select particles down to two support radii beneath it",
                areas.sum(),
            )

    def load(self, state: Any, clock: Any, fraction: float, external: wp.array) -> None:
        values = self.values.at(state.x, clock, fraction)
        arguments = [self.values.places, values, self.areas, external]
        wp.launch(_make_load(self.space), len(self.indices), arguments, device=self.device)
