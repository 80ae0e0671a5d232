"""Faces of bodies: which particles carry a face that a region names, and what part of it each (M10)."""

import logging
from dataclasses import dataclass, fields

import numpy as np

from ..structs import StateArrays
from .base import Assembly
from .outermost import Surface, along, along_and_beside, column, nearest, outermost, pairs, surface_particles

log = logging.getLogger(__name__)

# Lengths below are in spacings.
# Scatter of the layers' distance above which particles lie in no layers, and how many standard errors it takes before
# cells that may be cubes are taken for something else.
SCATTER, CERTAIN = 0.2, 4.0
# Largest change from the sum of the area vectors to that of the cells that is believed.
LARGEST_CHANGE = 0.4
# Depth beneath which the area vectors of a face in a lattice have ended: less than this part of a particle's face.
ENDED, QUIET = 3.9, 0.02
# Part by which cells and vectors of a lattice whose faces overlap differ at most, from twelve particles across on.
APART = 0.003
# Range of the heights of the outermost particles of a flat face: of one layer, jittered at most, and of two at most.
EVEN, ROUGH = 0.45, 0.8
# Part of the outermost particles of a flat face that may lie at steps of a layer or two.
STEPPED = 0.25
# How far, by its cosine, a particle of a curved surface may look away from a normal and still belong to what faces it.
RIM_SLOPE = 0.3
# Radius within which the area vectors of a surface are summed to tell whether it faces a normal.
SMOOTH = 3.0


@dataclass(frozen=True)
class Face:
    """The part of a surface that faces a normal, under the outermost particles that a region holds.

    Attributes:
        members: particles that carry it, (k,), sorted.
        columns: for each member the place in ``tops`` of the outermost particle above it, (k,).
        areas: (s_a·n) of the members, scaled so that they sum to the face [m^(dim−1)], (k,).
        tops: the outermost particles that the region holds, (m,), sorted.
    """

    members: np.ndarray
    columns: np.ndarray
    areas: np.ndarray
    tops: np.ndarray


def find_face(body: Surface, chosen: np.ndarray, n: np.ndarray, who: str) -> Face:
    """The face along ``n`` whose outermost particles are among ``chosen``.

    The area vectors of a face spread over the layers within three support radii; the face of an outermost particle is
    the sum of them down the column beneath it. Where the face is flat and particles lie in layers the sum is scaled to
    the area of the cells of the outermost layer, which it is off where bodies are thin or particles disordered.

    Args:
        body: the body.
        chosen: whether the region holds each particle, (n,) bool.
        n: outward unit normal, (dim,).
        who: named in errors and warnings.

    Raises:
        ValueError: the region holds no particle of a face along ``n``.
    """
    tops = outermost(body, n)
    roughness = 0.0 if body.exact else roughness_of(body, tops, n, chosen)
    flat = roughness < ROUGH
    held = chosen[tops]
    if not flat and held.any():
        # those that look away a little carry no load, but have their share of the area vectors beneath the rim
        tops, bottoms = sloping(body, n, -RIM_SLOPE), sloping(body, -n, RIM_SLOPE)
        a, b = pairs(body.x[tops], body.x[surface_particles(body)], SMOOTH * body.spacing)
        mean = np.bincount(a, body.outward[surface_particles(body)[b]] @ n)  # the steps of a cut lattice look anywhere
        held = chosen[tops] & (mean > 0.0)
    if not held.any():
        raise ValueError(
            f"{who}: the region must hold outermost particles of a face along {row(n)}, it holds none of the body's "
            f"{len(tops)}; " + _remedy(body, tops, n)
        )
    kept = tops[held]
    if body.exact:
        return Face(kept, np.arange(len(kept)), body.s[kept] @ n, kept)
    if flat:
        above, depth = column(body, tops, n)
        _, height = column(body, outermost(body, -n), -n)
    else:
        above, depth = nearest(body, tops)
        _, height = nearest(body, bottoms)
    _warn_if_unclear(body, chosen, tops, held, above, depth, n, who)
    number = np.cumsum(held) - 1
    members = np.flatnonzero((above >= 0) & held[above] & (depth <= height + 1e-6 * body.spacing))
    columns, areas = number[above[members]], body.s[members] @ n
    of_cells = _area_of_cells(body, kept, tops, n) if roughness < EVEN else None
    if of_cells is not None and not _ends(body, Face(members, columns, areas, kept), depth, of_cells):
        area = areas.sum()
        if area > 0.0 and abs(of_cells / area - 1.0) < LARGEST_CHANGE:
            areas *= of_cells / area
        else:  # one or two layers, a corner of a face: the outermost particles alone
            members, columns = kept, np.arange(len(kept))
            areas = body.V[kept] * (of_cells / body.V[kept].sum())
    return Face(members, columns, areas, kept)


def _ends(body: Surface, face: Face, depth: np.ndarray, of_cells: float) -> bool:
    """Whether the area vectors end within the columns and sum to something else than the cells, which are then wrong.

    In lattices both are the face, the cells to round-off; beside staggered edges the sum is nearer.
    """
    deep = depth[face.members] > ENDED * body.spacing
    if len(np.unique(face.columns[deep])) < 0.9 * len(face.tops):
        return False
    quiet = (np.abs(face.areas[deep]) < QUIET * body.size[face.members[deep]]).mean()
    return bool(quiet > 0.35 and abs(of_cells / face.areas.sum() - 1.0) > APART)


def sloping(body: Surface, n: np.ndarray, least: float) -> np.ndarray:
    """Particles on the surface whose area vectors have a cosine with ``n`` above ``least``."""
    skin = surface_particles(body)
    return skin[along(body, skin) @ n > least]


def roughness_of(body: Surface, tops: np.ndarray, n: np.ndarray, chosen: np.ndarray) -> float:
    """Largest range of the heights [spacings] of neighbouring outermost particles that the region holds.

    Those of a flat face lie in planes across ``n``, with few steps between them. It is inf where the surface is curved:
    where ``tops`` misses particles that face ``n``, or many lie at steps of a layer or two.
    """
    kept = tops[chosen[tops]]
    if not len(kept):
        return np.inf
    facing = sloping(body, n, 0.6)
    if np.isin(facing[chosen[facing]], tops, invert=True).sum() > 0.1 * len(kept):
        return np.inf
    a, b = pairs(body.x[kept], body.x[kept], 3.0 * body.spacing)
    step, beside = along_and_beside(body, kept[a], kept[b], n)
    neighbours = np.linalg.norm(beside, axis=1) < 1.7
    stepped = neighbours & (np.abs(step) > ROUGH) & (np.abs(step) < 2.5)
    if len(np.unique(a[stepped])) > STEPPED * len(kept):
        return np.inf
    linked = neighbours & (np.abs(step) < 0.9)
    a, b = a[linked], b[linked]
    # a slope shows over the whole of a plane, not from one particle to the next
    level = np.arange(len(kept))
    while True:
        lower = level.copy()
        np.minimum.at(lower, a, level[b])
        lower = lower[lower]
        if (lower == level).all():
            break
        level = lower
    at = body.x[kept] @ n / body.spacing
    low, high = np.full(len(kept), np.inf), np.full(len(kept), -np.inf)
    np.minimum.at(low, level, at)
    np.maximum.at(high, level, at)
    return float((high - low).max())


def _area_of_cells(body: Surface, kept: np.ndarray, tops: np.ndarray, n: np.ndarray) -> float | None:
    """Area of the cells of the outermost layer [m^(dim−1)]: volumes over the distance of layers; None without layers.

    The cells are cubes unless the distance says otherwise by more than its scatter.
    """
    dim = len(n)
    if dim == 1:
        return float(len(kept))
    inside = np.ones(len(body.x), dtype=bool)
    inside[tops] = False
    inner = np.flatnonzero(inside)
    cube = body.V[kept] ** (1.0 / dim)
    a, b = pairs(body.x[kept], body.x[inner], 1.9 * body.spacing)
    below, beside = along_and_beside(body, inner[b], kept[a], n)
    across = np.linalg.norm(beside, axis=1)
    near = (below > 0.35) & (below < 1.5) & (across < 1.1)
    a, below = a[near], below[near]
    least = np.full(len(kept), np.inf)
    np.minimum.at(least, a, below)
    next_layer = below < least[a] + 0.35
    a, below = a[next_layer], below[next_layer]
    count = np.bincount(a, minlength=len(kept))
    there = count > 0
    if not there.any():
        return float((body.V[kept] / cube).sum())
    layer = np.bincount(a, below, minlength=len(kept))[there] / count[there] * body.spacing / cube[there]
    scatter = layer.std()
    if scatter > SCATTER:
        return None
    mean, single = layer.mean(), (below * body.spacing / cube[a]).std()
    if abs(mean - 1.0) < CERTAIN * single / np.sqrt(len(layer)) + 1e-9:
        mean = 1.0
    return float((body.V[kept] / cube).sum() / mean)


def _warn_if_unclear(
    body: Surface,
    chosen: np.ndarray,
    tops: np.ndarray,
    held: np.ndarray,
    above: np.ndarray,
    depth: np.ndarray,
    n: np.ndarray,
    who: str,
) -> None:
    beneath = chosen & (above >= 0) & (depth > 0.5 * body.spacing) & (depth < 1.6 * body.spacing)
    uncovered = int((beneath & ~held[above]).sum())
    a, b = pairs(body.x[tops], body.x[tops], (2.2 if len(n) == 2 else 1.6) * body.spacing)
    a, b = a[a != b], b[a != b]
    around, with_it = np.bincount(a, minlength=len(tops)), np.bincount(a, held[b], minlength=len(tops))
    holes = int((~held & (around >= {1: 99, 2: 4, 3: 7}[len(n)]) & (with_it >= 0.75 * around)).sum())
    if holes or uncovered > 0.25 * held.sum():
        log.warning(
            "%s: the region cuts the face along %s: it leaves out %d outermost particles between those it holds, and "
            "holds %d particles beneath ones it leaves out; only what lies under outermost particles that it holds "
            "counts; let it hold all of the face's outermost layer",
            who,
            row(n),
            holes,
            uncovered,
        )


def _remedy(body: Surface, tops: np.ndarray, n: np.ndarray) -> str:
    if not len(tops):
        return "check the sign of the normal, which points out of the body"
    heights = body.x[tops] @ n
    return (
        f"those lie at {heights.min():.6g} to {heights.max():.6g} m along the normal; extend the region to them, or "
        "check the sign of the normal, which points out of the body"
    )


def row(n: np.ndarray) -> str:
    return "(" + ", ".join(f"{c:.4g}" for c in n) + ")"


def surfaces_held(
    assembly: Assembly, state: StateArrays, indices: np.ndarray, body: str | None
) -> list[tuple[range, Surface, np.ndarray]]:
    """The bodies of which ``indices`` hold particles: their particles, surface, and which of them are held, (n,) bool.

    Ghosts are not. To be asked for at the start of a run.
    """
    by_number, particles = assembly.order.by_number, assembly.particles
    arrays = (state.surface, particles.outward, particles.V0, particles.spacing)
    s, outward, V, spacing = (by_number(array.numpy()).astype(float) for array in arrays)
    chosen = np.zeros(len(assembly.X), dtype=bool)
    chosen[indices] = True
    chosen &= by_number(particles.share.numpy()) > 0.0
    return [
        (
            own,
            Surface(assembly.X[own], V[own], float(spacing[own].mean()), s[own], outward[own], assembly.surface_given),
            chosen[own],
        )
        for name, own in assembly.bodies.items()
        if body in (None, name) and chosen[own].any()
    ]


def faces_along(
    assembly: Assembly, state: StateArrays, indices: np.ndarray, body: str | None, n: np.ndarray, who: str
) -> Face:
    """The faces along ``n`` of all bodies of which ``indices`` hold outermost particles, by numbers of particles.

    Raises:
        ValueError: there is none.
    """
    found: list[Face] = []
    count, error = 0, ValueError(f"{who}: the region must hold outermost particles, it holds ghosts only")
    for own, surface, chosen in surfaces_held(assembly, state, indices, body):
        try:
            face = find_face(surface, chosen, n, who)
        except ValueError as missing:
            error = missing
            continue
        found.append(Face(face.members + own[0], face.columns + count, face.areas, face.tops + own[0]))
        count += len(face.tops)
    if not found:
        raise error
    return Face(*(np.concatenate([getattr(face, field.name) for face in found]) for field in fields(Face)))
