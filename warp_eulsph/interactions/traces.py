"""Traces: the points of a body's surface, each a mean of the particles beneath it, by which bodies touch.

The dual divergence (M5) answers a pressure on a flat face by area vectors that alternate over the layers beneath it.
Taken as weights, ω_c = s_c·n/Σ s·n down a column, they read positions on the face itself: Σ_c s_c ⊗ x_c = V I, so that
y = Σ_c ω_c x_c lies half a layer outside of the outermost particle. A force on y goes to the particles by the same
weights: it does on them the work that it does on y, and it has the moment of a force that acts at y.
"""

from typing import NamedTuple

import numpy as np

from ..boundaries import Assembly
from ..boundaries.face import SMOOTH, surfaces_held
from ..boundaries.named_surface import flat_faces
from ..boundaries.outermost import Surface, nearest, pairs, surface_particles
from ..structs import StateArrays

# Area vectors of a column below which, and above which, they are noise of an arrangement: parts of a particle's face.
LEAST, MOST = 0.5, 2.0


class Traces(NamedTuple):
    """Points of surfaces, as rows of members.

    Attributes:
        start: row k is ``start[k]:start[k + 1]`` of the next two, (m + 1,).
        members: numbers of particles, and their ``weights`` ω, which sum to 1 along a row.
        half: how far the face lies in front of each point at the start [m], (m,); about 0 for columns.
        areas: [m^(dim−1)], (m,).
        normals: outward at the start, (m, dim).
        tops: number of the outermost particle of each, (m,).
    """

    start: np.ndarray
    members: np.ndarray
    weights: np.ndarray
    half: np.ndarray
    areas: np.ndarray
    normals: np.ndarray
    tops: np.ndarray


def find_traces(assembly: Assembly, state: StateArrays, indices: np.ndarray, flowing: np.ndarray, who: str) -> Traces:
    """The traces of all bodies of which ``indices`` hold particles, to be asked for at the start of a run.

    Where ``flowing``, (n,) bool by number, particles change places: there each one is a point of its own, with half a
    spacing before it.
    """
    found: list[_Rows] = []
    for own, surface, chosen in surfaces_held(assembly, state, indices, None):
        rows = _of_liquid(surface, chosen) if flowing[own].any() else _of_solid(surface, chosen, who)
        rows.finish(surface, own[0])
        found.append(rows)
    return Traces(
        np.concatenate([[0], np.cumsum(np.concatenate([rows.counts for rows in found]))]),
        *(np.concatenate([getattr(rows, name) for rows in found]) for name in _Rows.LISTED),
    )


class _Rows:
    """Rows of one body as they are found."""

    LISTED = ("members", "weights", "half", "areas", "normals", "tops")

    def __init__(self) -> None:
        self._parts: list[tuple[np.ndarray, ...]] = []

    def add(
        self, tops: np.ndarray, normals: np.ndarray, members: np.ndarray, columns: np.ndarray, areas: np.ndarray
    ) -> None:
        """Columns of ``members`` that lie under ``tops``, with parts of the area vectors along the normals."""
        self._parts.append((tops, normals, members, columns, areas))

    def finish(self, body: Surface, first: int) -> None:
        """Weights, and what particles alone stand for; numbers from ``first`` on."""
        counts: list[np.ndarray] = []
        lists: dict[str, list[np.ndarray]] = {name: [] for name in self.LISTED}
        for tops, normals, members, columns, areas in self._parts:
            own_face = body.size[tops]
            total = np.bincount(columns, areas, minlength=len(tops))
            alone = (total < LEAST * own_face) | (total > MOST * own_face)
            kept = ~alone[columns]
            members = np.concatenate([members[kept], tops[alone]])
            areas = np.concatenate([areas[kept], own_face[alone]])
            columns = np.concatenate([columns[kept], np.flatnonzero(alone)])
            order = np.lexsort((members, columns))
            members, columns, areas = members[order], columns[order], areas[order]
            total = np.bincount(columns, areas, minlength=len(tops))
            weights = areas / total[columns]
            at = np.stack([np.bincount(columns, weights * row, minlength=len(tops)) for row in body.x[members].T], 1)
            half = -((at - body.x[tops]) * normals).sum(axis=1)
            if not body.exact:
                a, b = pairs(body.x[tops], body.x[tops], SMOOTH * body.spacing)
                layer = np.bincount(a, body.V[tops[b]]) / np.bincount(a, total[b])  # a mean, for single areas scatter
                half += 0.5 * layer
                total = body.V[tops] / layer
            counts.append(np.bincount(columns, minlength=len(tops)))
            for name, values in zip(
                self.LISTED, (members + first, weights, half, total, normals, tops + first), strict=True
            ):
                lists[name].append(values)
        self.counts = np.concatenate(counts)
        for name, values in lists.items():
            setattr(self, name, np.concatenate(values))


def _of_solid(body: Surface, chosen: np.ndarray, who: str) -> _Rows:
    """Flat faces one by one, so that a particle at an edge is in columns of both; the rest by the nearest particle."""
    rows = _Rows()
    faces, pool = flat_faces(body, chosen, who)
    for n, face in faces:
        normals = np.broadcast_to(n, (len(face.tops), len(n)))
        rows.add(face.tops, normals, face.members, face.columns, face.areas)
    if len(pool):
        skin = surface_particles(body)
        which, _ = nearest(body, skin)
        carried = np.flatnonzero((which >= 0) & np.isin(skin[which], pool))
        columns = np.searchsorted(pool, skin[which[carried]])
        total = np.stack([np.bincount(columns, row, minlength=len(pool)) for row in body.s[carried].T], 1)
        normals = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), np.finfo(float).tiny)
        rows.add(pool, normals, carried, columns, (body.s[carried] * normals[columns]).sum(axis=1))
    return rows


def _of_liquid(body: Surface, chosen: np.ndarray) -> _Rows:
    """Every particle, which may come to the surface; it faces whatever it meets."""
    rows, own = _Rows(), np.flatnonzero(chosen)
    rows.add(own, np.zeros((len(own), body.x.shape[1])), own, np.arange(len(own)), body.size[own])
    return rows
