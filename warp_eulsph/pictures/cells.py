"""The cells that particles are drawn as."""

import numpy as np

from ..output.reader import RunFrame

# Two particles of a body are next to each other within so many spacings, diagonals of cells among them.
NEXT = 1.6
SAMPLE = 100  # particles whose nearest neighbour is looked for


def spacing(x: np.ndarray) -> float:
    """Median distance from a particle to its nearest neighbour [m], of a sample; 1 for a single particle."""
    if len(x) < 2:
        return 1.0
    found = []
    for a in np.unique(np.linspace(0, len(x) - 1, SAMPLE).astype(int)):
        square = np.square(x - x[a]).sum(axis=1)
        square[a] = np.inf
        found.append(np.sqrt(square.min()))
    return float(np.median(found))


def rim(x: np.ndarray) -> np.ndarray | None:
    """Positions of the outermost particles [m], (k, 2): those with fewer than three quarters of the most neighbours
    within 1.8 spacings; None but in 2-D."""
    if x.shape[1] != 2:
        return None
    near = (1.8 * spacing(x)) ** 2
    # Blocks, because all distances at once take n² numbers
    blocks = np.array_split(x, max(1, len(x) // 256))
    counts = np.concatenate([(np.square(b[:, None] - x).sum(axis=-1) < near).sum(axis=1) for b in blocks])
    return x[counts < 0.75 * counts.max()]


def corners(frame: RunFrame, size: float) -> np.ndarray:
    """Corners of each particle's cell [m], (n, 2^dim, dim): x_a + F_a c with c those of a cube that holds its volume.

    Corner k has the bits of k as its places along the axes. Without a deformation gradient cells stay cubes; where the
    frame holds no volume, all have edges of ``size`` [m].
    """
    x = frame.x.astype(float)
    dim = x.shape[1]
    unit = np.array([[(k >> i & 1) - 0.5 for i in range(dim)] for k in range(2**dim)])
    F = frame.F.astype(float) if "deformation_gradient" in frame.units else np.eye(dim)[None]
    edges = np.full(len(x), size)
    if "volume" in frame.units:
        edges = (frame["volume"].astype(float) / np.abs(np.linalg.det(F))) ** (1.0 / dim)
    offsets = edges[:, None, None] * np.einsum("nij,kj->nki", F, unit)
    return x[:, None, :] + offsets


def sheet(frame: RunFrame, start: np.ndarray) -> np.ndarray:
    """Triangles between particles that were next to each other at the start and still are, (m, 3) of rows, in 2-D.

    They fill what opens between cells where neighbours deform differently, however far the body is sheared. Left out
    are those between bodies, and those that matter has left: edges of more than twice what the deformation gradient
    made of them.

    Args:
        start: positions of the same particles at the start [m], (n, 2).
    """
    from matplotlib.tri import Triangulation

    n = len(frame.x)
    if n < 3 or start.shape != (n, 2) or "deformation_gradient" not in frame.units:
        return np.zeros((0, 3), dtype=int)
    try:
        triangles = Triangulation(*start.astype(float).T).triangles
    except RuntimeError:  # all in a line
        return np.zeros((0, 3), dtype=int)
    x, stretch = frame.x.astype(float), np.linalg.svd(frame.F.astype(float), compute_uv=False)[:, 0]
    body = frame["body"] if "body" in frame.units else np.zeros(n)
    kept, near = np.ones(len(triangles), dtype=bool), NEXT * spacing(start)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        first, second = triangles[:, a], triangles[:, b]
        before, now = (np.linalg.norm(at[second] - at[first], axis=1) for at in (start, x))
        kept &= (before < near) & (body[first] == body[second])
        kept &= now < 2.0 * before * np.maximum(stretch[first], stretch[second])
    return triangles[kept]
