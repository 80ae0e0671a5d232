"""What may be mended in a mesh of triangles, said by the user: corners, openings, facets that face the wrong way."""

import logging
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..checks import real_number
from .faces import components

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Repair:
    """How a surface is made closed that is not, for ``mesh``. What was done is logged.

    Args:
        weld: corners nearer than this are one [m]; None is 1e-6 of the file's size, and only where the surface is not
            closed without; 0 joins only what is equal to the last bit.
        close: close openings, each by triangles in the plane that fits its rim best.
        turn: turn facets so that neighbours face the same way, each piece as most of its area does.
        take: take the surface as it is then, be it open or passing through itself: inside is where its winding number
            is more than ½, and the volume is that of the particles of the filling that lie there.
    """

    weld: float | None = None
    close: bool = False
    turn: bool = False
    take: bool = False

    def __post_init__(self) -> None:
        checked_weld(self.weld)


def checked_weld(given: float | None) -> None:
    """ValueError unless it is a length [m] or None."""
    if given is not None and not 0.0 <= real_number(given, "weld") < math.inf:
        raise ValueError(f"weld must be a length [m], at least 0, got {given}; None takes 1e-6 of the size")


@dataclass(frozen=True)
class Edges:
    """The sides of triangles.

    Attributes:
        ends: corners of each edge, the lower number first, (k, 2).
        of: edge of each side of each triangle, (m, 3).
        ways: +1 where the side runs from the lower number to the higher, −1 otherwise, (m, 3).
    """

    ends: np.ndarray
    of: np.ndarray
    ways: np.ndarray

    @property
    def times(self) -> np.ndarray:
        """How many triangles each edge has, (k,)."""
        return np.bincount(self.of.reshape(-1), minlength=len(self.ends))

    @property
    def balance(self) -> np.ndarray:
        """How many more triangles run along each edge one way than the other, (k,); 0 where all is closed."""
        return np.bincount(self.of.reshape(-1), self.ways.reshape(-1), len(self.ends)).astype(int)


def edges_of(triangles: np.ndarray) -> Edges:
    """The edges of triangles, (m, 3) numbers of corners."""
    sides = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    ends, of = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
    ways = np.where(sides[:, 0] < sides[:, 1], 1, -1)
    return Edges(ends, of.reshape(-1, 3), ways.reshape(-1, 3))


def turned_alike(points: np.ndarray, triangles: np.ndarray, who: str) -> np.ndarray:
    """The triangles, (m, 3), turned so that any two that share an edge with no third run along it both ways.

    Each piece faces as most of its area did.

    Raises:
        ValueError: a surface of one side, as Möbius' band.
    """
    m, edges = len(triangles), edges_of(triangles)
    # Each triangle as it is, number a, and turned, m + a; which of them go together?
    shared = (edges.times == 2)[edges.of]
    first = np.full(len(edges.ends), 3 * m)
    np.minimum.at(first, edges.of.reshape(-1), np.arange(3 * m))
    is_first = first[edges.of] == np.arange(3 * m).reshape(m, 3)
    along = np.where(is_first, edges.ways, -edges.ways) > 0
    alone = 2 * len(edges.ends) + np.arange(2 * m)[:, None]
    groups = np.concatenate([2 * edges.of + along, 2 * edges.of + ~along])
    labels = components([np.where(np.tile(shared, (2, 1)), groups, alone)])
    if (labels[:m] == labels[m:]).any():
        raise ValueError(f"{who}: the surface has one side only, so that nothing is inside; cut it in a mesh tool")
    corners = points[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    kept = np.bincount(labels, np.concatenate([area, 0.0 * area]), 2 * m)
    as_is, other = labels[:m], labels[m:]
    turn = (kept[as_is] < kept[other]) | ((kept[as_is] == kept[other]) & (as_is > other))
    if turn.any():
        log.warning("%s: %d of %d triangles turned to face as their neighbours do", who, turn.sum(), m)
    return np.where(turn[:, None], triangles[:, ::-1], triangles)


def closed(points: np.ndarray, triangles: np.ndarray, who: str) -> np.ndarray:
    """The triangles, (m, 3), and those that close their openings.

    Raises:
        ModuleNotFoundError: manifold3d is not installed.
        ValueError: triangles that turn against each other, so that there is no rim.
    """
    rims = _rims(triangles, who)
    if not rims:
        return triangles
    triangulate = manifold3d().triangulate
    caps = []
    for rim in rims:
        places = points[rim] - points[rim].mean(axis=0)
        normal = np.cross(places, np.roll(places, -1, axis=0)).sum(axis=0)  # Newell's: twice the area
        across = np.linalg.svd(places, full_matrices=False)[2]
        if np.linalg.norm(normal) > 1e-12 * np.ptp(places, axis=0).max() ** 2:
            normal /= np.linalg.norm(normal)
            one = across[0] - normal * (across[0] @ normal)
            one /= np.linalg.norm(one)
            across = np.stack([one, np.cross(normal, one)])
        flat = np.ascontiguousarray(places @ across[:2].T)
        caps.append(np.array(rim)[np.asarray(triangulate([flat]), dtype=int)])
    widest = max(float(np.ptp(points[rim], axis=0).max()) for rim in rims)
    log.warning("%s: %d openings closed, the widest of %.4g m", who, len(rims), widest)
    return np.concatenate([triangles, *caps])


def _rims(triangles: np.ndarray, who: str) -> list[list[int]]:
    """Closed rows of corners around openings, as triangles that close them have to run."""
    edges = edges_of(triangles)
    balance = edges.balance
    if (np.abs(balance) > 1).any():
        raise ValueError(
            f"{who}: triangles along {(np.abs(balance) > 1).sum()} edges turn against each other, so that openings "
            "have no rim; turn them alike first by repair=Repair(close=True, turn=True), or take the surface as it "
            "is by repair=Repair(take=True)"
        )
    onward: dict[int, list[int]] = {}
    for (low, high), way in zip(edges.ends[balance != 0].tolist(), balance[balance != 0].tolist(), strict=True):
        start, end = (high, low) if way > 0 else (low, high)
        onward.setdefault(start, []).append(end)
    rims = []
    while onward:
        path = [next(iter(onward))]
        place = {path[0]: 0}
        while path:
            following = onward[path[-1]]
            corner = following.pop()
            if not following:
                del onward[path[-1]]
            if corner in place:  # a rim is cut off where the path meets itself
                rims.append(path[place[corner] :])
                for gone in rims[-1][1:]:
                    del place[gone]
                path = path[: place[corner] + 1]
                if len(path) == 1 and path[0] not in onward:
                    break
            else:
                place[corner] = len(path)
                path.append(corner)
    return rims


def manifold3d() -> Any:
    """The library.

    Raises:
        ModuleNotFoundError: it is not installed.
    """
    try:
        import manifold3d as library
    except ModuleNotFoundError:
        raise ModuleNotFoundError(
            "surfaces that lie in each other or are open need manifold3d: pip install 'warp_eulsph[mesh]'"
        ) from None
    return library
