"""Surfaces that tests of meshes share, and files of them."""

import meshio
import numpy as np

CUBE = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


def brick(lower, upper):
    """Corners and outward triangles of a box."""
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], dtype=float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.array([[q[0], q[a], q[a + 1]] for q in quads for a in (1, 2)])
    return np.array(lower) + corners * (np.array(upper) - lower), triangles


def angle_profile():
    """Corners and triangles of an L: a unit square 1 m deep less its upper right quarter; concave."""
    outline = np.array([[0, 0], [1, 0], [1, 0.5], [0.5, 0.5], [0.5, 1], [0, 1]], dtype=float)
    points = np.concatenate([np.pad(outline, ((0, 0), (0, 1))), np.pad(outline, ((0, 0), (0, 1)), constant_values=1.0)])
    flat = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]])
    sides = [t for k in range(6) for t in ([k, (k + 1) % 6, (k + 1) % 6 + 6], [k, (k + 1) % 6 + 6, k + 6])]
    return points, np.concatenate([flat[:, ::-1], flat + 6, sides])


def write(path, points, triangles, **options):
    meshio.Mesh(points, [("triangle", np.asarray(triangles))]).write(path, **options)
    return path


def written(tmp_path, *boxes, inwards=()):
    """Bricks (lower, upper) in one file; those numbered in ``inwards`` face inwards."""
    pieces = [brick(*box) for box in boxes]
    turned = [triangles[:, ::-1] if k in inwards else triangles for k, (_, triangles) in enumerate(pieces)]
    points = np.concatenate([points for points, _ in pieces])
    return write(tmp_path / "pieces.vtk", points, np.concatenate([t + 8 * k for k, t in enumerate(turned)]))
