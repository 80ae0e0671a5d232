"""Faces of finite elements as triangles: of surface elements, and of solid ones those that no other solid shares."""

from collections.abc import Sequence

import numpy as np

# Corners of each face in turn, outwards for a cell of positive volume, midside nodes between their corners; the numbers
# are those of VTK and meshio. Nodes in the middle of faces and cells are left out.
SOLIDS: dict[str, list[list[int]]] = {
    "tetra": [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
    "pyramid": [[0, 3, 2, 1], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
    "wedge": [[0, 2, 1], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]],
    "hexahedron": [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]],
}
# Midside nodes: those of the edges in this order follow the corners.
_EDGES: dict[str, list[tuple[int, int]]] = {
    "tetra": [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)],
    "pyramid": [(0, 1), (1, 2), (2, 3), (0, 3), (0, 4), (1, 4), (2, 4), (3, 4)],
    "wedge": [(0, 1), (1, 2), (0, 2), (3, 4), (4, 5), (3, 5), (0, 3), (1, 4), (2, 5)],
    "hexahedron": [
        *[(0, 1), (1, 2), (2, 3), (0, 3), (4, 5), (5, 6), (6, 7), (4, 7)],
        *[(0, 4), (1, 5), (2, 6), (3, 7)],
    ],
}
_CORNERS = {"tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}
_SECOND_ORDER = {
    "tetra10": "tetra",
    "pyramid13": "pyramid",
    "pyramid14": "pyramid",
    "wedge15": "wedge",
    "wedge18": "wedge",
    "hexahedron20": "hexahedron",
    "hexahedron24": "hexahedron",
    "hexahedron27": "hexahedron",
}
#: Surface elements by their nodes in turn.
SURFACES: dict[str, list[int]] = {
    "triangle": [0, 1, 2],
    "triangle6": [0, 3, 1, 4, 2, 5],
    "triangle7": [0, 3, 1, 4, 2, 5],
    "quad": [0, 1, 2, 3],
    "quad8": [0, 4, 1, 5, 2, 6, 3, 7],
    "quad9": [0, 4, 1, 5, 2, 6, 3, 7],
}
# How a face of so many nodes is cut.
_CUTS = {
    3: [[0, 1, 2]],
    4: [[0, 1, 2], [0, 2, 3]],
    6: [[0, 1, 5], [1, 2, 3], [3, 4, 5], [1, 3, 5]],
    8: [[0, 1, 7], [1, 2, 3], [3, 4, 5], [5, 6, 7], [1, 3, 5], [1, 5, 7]],
}


def _with_midsides(kind: str) -> list[list[int]]:
    middle = {frozenset(edge): _CORNERS[kind] + k for k, edge in enumerate(_EDGES[kind])}
    return [
        [node for a, b in zip(face, [*face[1:], face[0]], strict=True) for node in (a, middle[frozenset((a, b))])]
        for face in SOLIDS[kind]
    ]


SOLIDS |= {kind: _with_midsides(plain) for kind, plain in _SECOND_ORDER.items()}


def surface_triangles(kind: str, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of surface elements, (m, 3), and the element that each is of, (m,)."""
    order = SURFACES[kind]
    cuts = np.array(_CUTS[len(order)])
    triangles = cells[:, order][:, cuts].reshape(-1, 3)
    return triangles, np.repeat(np.arange(len(cells)), len(cuts))


def outer_triangles(points: np.ndarray, cells: dict[str, np.ndarray]) -> np.ndarray:
    """Triangles, (m, 3), outwards, of the faces that belong to one solid element only."""
    pieces: dict[int, list[np.ndarray]] = {}
    used = [nodes.ravel() for kind, nodes in cells.items() if kind in SOLIDS]
    if not used:
        return np.zeros((0, 3), dtype=int)
    points = points - points[np.unique(np.concatenate(used))].mean(axis=0)  # for volumes far from the origin
    for kind, nodes in cells.items():
        if kind not in SOLIDS or not len(nodes):
            continue
        volume = sum(_volumes(points, nodes[:, face]) for face in SOLIDS[kind])
        for face in SOLIDS[kind]:
            polygons = nodes[:, face]
            inwards = np.asarray(volume) < 0.0
            polygons[inwards] = np.roll(polygons[inwards][:, ::-1], 1, axis=1)  # corners stay at even places
            pieces.setdefault(len(face), []).append(polygons)
    found = [np.zeros((0, 3), dtype=int)]
    for size, listed in pieces.items():
        polygons = np.concatenate(listed)
        _, first, times = np.unique(np.sort(polygons, axis=1), axis=0, return_index=True, return_counts=True)
        found.append(polygons[first[times == 1]][:, np.array(_CUTS[size])].reshape(-1, 3))
    return np.concatenate(found)


def _volumes(points: np.ndarray, polygons: np.ndarray) -> np.ndarray:
    """Six times the volumes between the first corner of each cell's face and the origin of the cells, (k,)."""
    total = np.zeros(len(polygons))
    for cut in _CUTS[polygons.shape[1]]:
        a, b, c = (points[polygons[:, node]] for node in cut)
        total += np.einsum("mi,mi->m", a, np.cross(b, c))
    return total


def weld(points: np.ndarray, tolerance: float) -> np.ndarray:
    """Number of the corner that each point is one with, (k,): those nearer than ``tolerance`` [m] along each axis.

    Points in one cell of twice that side are one; eight grids, shifted by half a cell, bring any such two together.
    """
    labels = np.arange(len(points))
    if tolerance > 0.0:
        low = points.min(axis=0)
        shifts = np.stack(np.meshgrid(*[[0.0, 0.5]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        cells = [
            np.unique(np.floor((points - low) / (2.0 * tolerance) + shift), axis=0, return_inverse=True)[1].reshape(-1)
            for shift in shifts
        ]
        labels = components(cells)
    return np.unique(labels, return_inverse=True)[1].reshape(-1)


def components(groupings: Sequence[np.ndarray]) -> np.ndarray:
    """Labels, (k,), equal for those that a grouping puts together, directly or not.

    A grouping has numbers of groups, from 0: one for each, (k,), or several, (k, l).
    """
    labels = np.arange(len(groupings[0]))
    while True:
        before = labels
        for groups in (grouping.reshape(len(labels), -1) for grouping in groupings):
            least = np.full(int(groups.max(initial=0)) + 1, len(labels))
            for column in groups.T:
                np.minimum.at(least, column, labels)
            labels = least[groups].min(axis=1)
        labels = labels[labels]
        if np.array_equal(labels, before):
            return labels
