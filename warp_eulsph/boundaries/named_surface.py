"""The part of a surface that a region names, whichever way it faces: flat faces, edges between them, curved parts."""

import logging

import numpy as np

from .face import ROUGH, Face, find_face, roughness_of, row
from .outermost import Surface, along, nearest, outermost, surface_particles

log = logging.getLogger(__name__)

# Cosine within which directions are one flat face's.
ALIKE = 0.906


def find_surface(body: Surface, chosen: np.ndarray, who: str) -> tuple[np.ndarray, np.ndarray]:
    """Area vectors of the surface whose outermost particles are among ``chosen``.

    Flat faces are taken one by one, whole to round-off (``find_face``); what is left is curved, and its particles hand
    their area vectors to the nearest one on the surface.

    Returns:
        Area vectors [m^(dim−1)], (n, dim), and for each particle the outermost one that it goes by, (n,), −1 if none.

    Raises:
        ValueError: the region holds no outermost particle.
    """
    skin = surface_particles(body)
    if not chosen[skin].any():
        raise ValueError(
            f"{who}: the region must hold outermost particles of the body, it holds none of its {len(skin)}; "
            "extend it to the surface, or use BodyForce for a force inside"
        )
    vectors, top = np.zeros_like(body.x), np.full(len(body.x), -1)
    if body.exact:
        own = skin[chosen[skin]]
        vectors[own], top[own] = body.s[own], own
        return vectors, top
    faces, pool = flat_faces(body, chosen, who)
    for n, face in faces:
        vectors[face.members] += face.areas[:, None] * n
        top[face.members] = face.tops[face.columns]
    if len(pool):
        which, _ = nearest(body, skin)
        carried = np.flatnonzero((which >= 0) & np.isin(skin[which], pool))
        vectors[carried] = body.s[carried]
        top[carried] = skin[which[carried]]
    elif len(faces) > 1:
        _warn_of_strips(body, faces, who)
    return vectors, top


def flat_faces(body: Surface, chosen: np.ndarray, who: str) -> tuple[list[tuple[np.ndarray, Face]], np.ndarray]:
    """The flat faces whose outermost particles are among ``chosen``, with their normals, and the particles left over.

    Those left over lie on the surface where it is curved.
    """
    faces, pool = [], surface_particles(body)
    pool = pool[chosen[pool]]
    while len(pool):
        n = _commonest(body, pool, surface_particles(body))
        face = None if n is None else _flat_face(body, chosen, n, who)
        if n is None or face is None or not np.isin(pool, face.tops).any():
            break
        faces.append((n, face))
        pool = np.setdiff1d(pool, face.tops)
    return faces, pool


def _commonest(body: Surface, pool: np.ndarray, skin: np.ndarray) -> np.ndarray | None:
    """The direction that most of ``pool`` face, along an axis where it may be; None where no two agree.

    It is the mean over all of the body's surface that agrees: strips beside an edge are tilted.
    """
    facing = along(body, pool)
    trial = facing[:: max(1, len(facing) // 400)]
    agree = facing @ trial.T > ALIKE
    best = agree[:, agree.sum(axis=0).argmax()]
    if best.sum() < min(2, body.x.shape[1]):
        return None
    n = facing[best].mean(axis=0)
    for _ in range(2):
        alike = along(body, skin)
        alike = alike[alike @ n > ALIKE * np.linalg.norm(n)]
        n = alike.mean(axis=0)
    n /= np.linalg.norm(n)
    error = np.sqrt(((alike - n) ** 2).sum(axis=1).mean() / len(alike))
    axis = np.zeros(len(n))
    axis[np.abs(n).argmax()] = np.sign(n[np.abs(n).argmax()])
    return axis if np.linalg.norm(n - axis) < 4.0 * error + 1e-9 else n


def _flat_face(body: Surface, chosen: np.ndarray, n: np.ndarray, who: str) -> Face | None:
    tops = outermost(body, n)
    if not chosen[tops].any() or roughness_of(body, tops, n, chosen) >= ROUGH:
        return None
    return find_face(body, chosen, n, who)


def _warn_of_strips(body: Surface, faces: list[tuple[np.ndarray, Face]], who: str) -> None:
    """Warn where the region takes all of one face and parts of others, which is seldom meant."""
    part = []
    for n, face in faces:
        heights, all_of_it = body.x[face.tops] @ n, outermost(body, n)
        beside = body.x[all_of_it] @ n
        level = (beside > heights.min() - 0.5 * body.spacing) & (beside < heights.max() + 0.5 * body.spacing)
        part.append(len(face.tops) / level.sum())
    if max(part) == 1.0 and min(part) < 1.0:
        log.warning(
            "%s: the region holds the whole of the faces along %s and parts of those along %s, which are loaded too; "
            "to load one face give its normal",
            who,
            ", ".join(row(n) for (n, _), whole in zip(faces, part, strict=True) if whole == 1.0),
            ", ".join(row(n) for (n, _), whole in zip(faces, part, strict=True) if whole < 1.0),
        )
