"""What is inside of closed surfaces that lie in each other: matter that any of them encloses, less its hollows."""

import logging
from itertools import combinations
from typing import Any

import numpy as np

from .repair import manifold3d
from .surface import Surface

log = logging.getLogger(__name__)

# Volumes and areas that differ by less than this share are the same.
SAME = 1e-9
# A hollow lies in a solid if no more than this share of it sticks out, be its surface of coarser facets.
STICKS_OUT = 1e-3


def united(surface: Surface, who: str) -> Surface:
    """The surface of all that closed surfaces enclose, facing outwards.

    Each piece that faces outwards encloses matter, one that faces inwards a hollow of the smallest piece around it.
    Where pieces lie in each other or touch, it is their union: what two of them enclose counts once, and a hollow of
    one is filled where another one lies in it. Whatever needs none of that is returned as it is.

    Raises:
        ModuleNotFoundError: pieces whose boxes meet, and manifold3d is not installed.
        ValueError: a hollow outside all matter, or a piece that passes through itself.
    """
    if surface.volume < 0.0:  # all face inwards
        surface = surface.turned()
    parts = surface.parts()
    if any(_meet(one, other) for one, other in combinations(parts, 2)):
        surface = _by_boolean(surface, parts, who)
    surface.check_simple(who)
    return surface


def _meet(one: Surface, other: Surface) -> bool:
    """Whether their boxes overlap or touch."""
    (low, high), (lower, upper) = one.extent, other.extent
    near = SAME * max(np.ptp([low, high], axis=0).max(), np.ptp([lower, upper], axis=0).max())
    return bool((np.minimum(high, upper) - np.maximum(low, lower) > -near).all())


def _by_boolean(surface: Surface, parts: list[Surface], who: str) -> Surface:
    library = manifold3d()
    solids = [(part.volume, _manifold(part, library, who), part) for part in parts if part.volume >= 0.0]
    hollows: list[list[Any]] = [[] for _ in solids]
    for part in (part for part in parts if part.volume < 0.0):
        hollow, size = _manifold(part.turned(), library, who), -part.volume
        around = [
            (volume, k)
            for k, (volume, solid, other) in enumerate(solids)
            if _meet(part, other) and (solid ^ hollow).volume() >= (1.0 - STICKS_OUT) * size
        ]
        if not around:
            raise ValueError(
                f"{who}: a piece of the surface that faces inwards must be a hollow within one that faces outwards, "
                f"got one at {part.points[part.triangles[0, 0]]} m that is not; turn it in a mesh tool, or take "
                "the surface as it is by repair=Repair(take=True)"
            )
        hollows[min(around)[1]].append(hollow)
    pieces = [
        library.Manifold.batch_boolean([solid, *inner], library.OpType.Subtract) if inner else solid
        for (_, solid, _), inner in zip(solids, hollows, strict=True)
    ]
    union = library.Manifold.batch_boolean(pieces, library.OpType.Add)
    volume, area = surface.volume, surface.area
    if abs(union.volume() - volume) <= SAME * volume and abs(union.surface_area() - area) <= SAME * area:
        return surface
    if volume - union.volume() > SAME * volume:
        log.warning(
            "%s: closed surfaces lie in each other; what several enclose counts once, %.6g m³ instead of %.6g m³; a "
            "hollow is a surface that faces inwards",
            who,
            union.volume(),
            volume,
        )
    mesh = union.to_mesh64()
    return Surface(
        np.asarray(mesh.vert_properties)[:, :3].astype(float), np.asarray(mesh.tri_verts).astype(int), surface.patches
    )


def _manifold(part: Surface, library: Any, who: str) -> Any:
    used, numbers = np.unique(part.triangles, return_inverse=True)
    triangles = numbers.reshape(-1, 3).astype(np.uint64)
    made = library.Manifold(library.Mesh64(np.ascontiguousarray(part.points[used]), np.ascontiguousarray(triangles)))
    if made.status() != library.Error.NoError:
        raise ValueError(
            f"{who}: pieces of the surface that meet must be of facets that border one other along each edge, got "
            f"{made.status()} for the one at {part.points[part.triangles[0, 0]]} m; unite them in a mesh tool, or take "
            "the surface as it is by repair=Repair(take=True)"
        )
    return made
