"""Closed outlines in the plane, read from mesh files, and the distance to them."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from os import PathLike

import numpy as np
import warp as wp

from ..execution import Launcher
from .faces import SURFACES
from .faces import weld as weld_points
from .filling import Filling, Lattice
from .mesh_file import MeshFile, read_mesh
from .relaxation import Relaxation
from .repair import checked_weld
from .solid import Solid
from .surface import WELD, Surface

# Corners and lines that miss each other by this share of the outline's size are taken to meet.
SAME = 1e-9
# Line elements by their nodes in turn.
_LINES = {"line": [0, 1], "line3": [0, 2, 1]}


def outline(
    file: str | PathLike,
    spacing: float,
    *,
    scale: float = 1.0,
    filling: Filling = Lattice(),
    relaxation: Relaxation | None = None,
    weld: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Particles inside a closed outline, 2-D.

    Inside is where a line to the far side crosses the outline an odd number of times, so that holes are holes.

    Args:
        file: any mesh that meshio reads: gmsh, VTK, VTU, OBJ; triangles and quadrangles in a plane of constant z, whose
            outer edges are taken, or lines that close.
        spacing: wanted spacing [m], the root of a particle's area.
        scale: length of the file's unit [m], 1e-3 for millimetres.
        filling: Lattice(), BodyCentred() or Staggered(), cut to the shape.
        relaxation: Relaxation() to make them even and fit the outline; None leaves the cut filling.
        weld: corners nearer than this are one [m]; None is 1e-6 of the outline's size, and only where it is not closed
            without; 0 joins only what is equal to the last bit.

    Returns:
        Positions [m], (n, 2), and areas [m²], (n,), all equal, whose sum is the area inside.

    Raises:
        ModuleNotFoundError: meshio is not installed.
        OSError: no such file.
        ValueError: not a mesh, not flat, an outline that is open or crosses itself, or a spacing too coarse.
    """
    lines = read_outline(file, scale, weld)
    who = f"outline {file}"
    lines.check_closed(who)
    lower, upper = lines.points[lines.segments].min(axis=(0, 1)), lines.points[lines.segments].max(axis=(0, 1))
    solid = Solid(lower, upper, lines.area(who), lines.query(inside=True), lines.query(inside=False))
    return solid.fill(spacing, filling, relaxation, who)


@dataclass(frozen=True)
class Outline:
    """Lines in the plane.

    Attributes:
        points: corners [m], (k, 2), each once.
        segments: numbers of the ends of the lines that bound the inside, (m, 2).
        patches: name -> ends of the lines of that group of the file, (l, 2).
    """

    points: np.ndarray
    segments: np.ndarray
    patches: dict[str, np.ndarray]

    def loose_ends(self) -> np.ndarray:
        """Numbers of the corners, (k,), in which an odd number of lines meet; none of a closed outline."""
        return np.flatnonzero(np.bincount(self.segments.ravel(), minlength=len(self.points)) % 2)

    def check_closed(self, who: str) -> None:
        """Raise ValueError unless an even number of lines meet in every corner."""
        loose = self.loose_ends()
        if len(loose):
            raise ValueError(
                f"{who}: the outline must be closed, got {len(loose)} loose ends, the first at "
                f"{self.points[loose[0]]} m; where corners miss each other join them by weld=..., or close the gaps "
                "in a mesh tool"
            )

    def area(self, who: str) -> float:
        """Area inside [m²]: trapezia between the lines, from one height of a corner to the next.

        Raises:
            ValueError: lines that cross, or an area of nothing.
        """
        ends = self.points[self.segments]
        ends = np.take_along_axis(ends, np.argsort(ends[:, :, 1], axis=1)[:, :, None], axis=1)  # lower end first
        heights = np.unique(ends[:, :, 1])
        tolerance = SAME * float(np.ptp(self.points, axis=0).max())
        total = 0.0
        for low, high in pairwise(heights):
            (x0, y0), (x1, y1) = ends[(ends[:, 0, 1] <= low) & (ends[:, 1, 1] >= high)].transpose(1, 2, 0)
            below, above = (x0 + (x1 - x0) * (y - y0) / (y1 - y0) for y in (low, high))
            order = np.argsort(below + above)
            below, above = below[order], above[order]
            if min(np.diff(below).min(initial=0.0), np.diff(above).min(initial=0.0)) < -tolerance:
                where = f"at y from {low:.6g} to {high:.6g} m"
                raise ValueError(f"{who}: the outline must not cross itself, it does {where}")
            total += 0.5 * (high - low) * float((below + above)[1::2].sum() - (below + above)[::2].sum())
        if not total > SAME * np.prod(np.ptp(self.points, axis=0)):
            raise ValueError(f"{who}: the outline must enclose an area, got {total:.6g} m^2")
        return total

    def part(self, patch: str) -> "Outline":
        """The lines of a patch.

        Raises:
            ValueError: no such patch.
        """
        if patch not in self.patches:
            raise ValueError(f"patch of the mesh must be one of {sorted(self.patches)}, got {patch!r}")
        return Outline(self.points, self.patches[patch], {})

    def query(self, inside: bool) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Function of positions [m], (k, 2) -> distance [m], (k,), and unit vectors along which it grows, (k, 2).

        With ``inside`` the distance is negative outside; such an outline must be closed. Distances are in single
        precision (``Surface.query``), the sign in double.
        """
        # Walls over the lines, so high that what is nearest to a point of the plane lies in the plane.
        count, height = len(self.points), max(float(np.ptp(self.points, axis=0).max()), 1e-300)
        corners = np.concatenate([np.pad(self.points, ((0, 0), (0, 1)), constant_values=z) for z in (-height, height)])
        a, b = self.segments.T
        walls = np.concatenate([np.stack([a, b, b + count], axis=1), np.stack([a, b + count, a + count], axis=1)])
        nearest = Surface(corners, walls, {}).query(winding=None)
        ends = self.points[self.segments]

        def distance(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            length, unit = nearest(np.pad(x, ((0, 0), (0, 1))))
            sign = np.where(_odd(x, ends), 1.0, -1.0) if inside else np.ones(len(x))
            return sign * length, sign[:, None] * unit[:, :2]

        return distance


def _odd(x: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Whether the line from each point towards larger x crosses an odd number of the lines, (n,) bool."""
    places = wp.array(x, dtype=wp.vec2d, device="cpu")
    starts, stops = (wp.array(np.ascontiguousarray(ends[:, k]), dtype=wp.vec2d, device="cpu") for k in (0, 1))
    odd = wp.zeros(len(x), dtype=wp.bool, device="cpu")
    Launcher("cpu")(_make_crossings(), len(x), [places, starts, stops, odd])
    return odd.numpy()


@functools.cache
def _make_crossings() -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False)
    def crossings(
        first: int,
        x: wp.array(dtype=wp.vec2d),
        starts: wp.array(dtype=wp.vec2d),
        stops: wp.array(dtype=wp.vec2d),
        odd: wp.array(dtype=wp.bool),
    ):
        a = first + wp.tid()
        p = x[a]
        found = bool(False)
        for k in range(starts.shape[0]):
            s = starts[k]
            e = stops[k]
            if (s[1] > p[1]) != (e[1] > p[1]) and p[0] < s[0] + (e[0] - s[0]) * (p[1] - s[1]) / (e[1] - s[1]):
                found = not found
        odd[a] = found

    return crossings


def read_outline(path: str | PathLike, scale: float = 1.0, weld: float | None = None) -> Outline:
    """The outline of a mesh file: outer edges of its triangles and quadrangles, or its lines where it has none.

    Elements of second order are cut at their midside nodes. ``weld`` as in ``outline``.

    Raises:
        ModuleNotFoundError, OSError: as ``read_mesh``.
        ValueError: as ``read_mesh``, or neither faces nor lines, or not in a plane of constant z.
    """
    checked_weld(weld)
    file = read_mesh(path, scale)
    edges = [_sides(file.cells[kind][:, SURFACES[kind]]) for kind in file.cells if kind in SURFACES]
    lines, groups = _lines(file)
    used = np.unique(np.concatenate([*(edge.ravel() for edge in edges), lines.ravel()]).astype(int))
    if not len(used):
        kinds = sorted(file.cells)
        raise ValueError(f"{path}: an outline must have triangles, quadrangles or lines, got cells {kinds}")
    corners = file.points[used]
    wide, deep = float(np.ptp(corners, axis=0).max()), float(np.ptp(corners[:, 2]))
    if deep > SAME * wide:
        raise ValueError(
            f"{path}: an outline must lie in a plane of constant z, got z over {deep:.6g} m; bodies in 3-D are meshes"
        )
    number = np.zeros(len(file.points), dtype=int)

    def joined(tolerance: float) -> Outline:
        points, number[used] = _corners(corners, tolerance)
        kept = number[lines[:, 0]] != number[lines[:, 1]]
        whole, of = number[lines][kept], groups[kept]
        bounds = _outer(number[np.concatenate(edges)]) if edges else whole
        return Outline(points, bounds, {file.patch(k, 1): whole[of == k] for k in np.unique(of) if k >= 0})

    exact = joined(weld or 0.0)
    if weld is not None or not len(exact.loose_ends()):
        return exact
    near = joined(WELD * wide)
    return near if len(near.segments) and not len(near.loose_ends()) else exact


def _sides(faces: np.ndarray) -> np.ndarray:
    """Sides of faces of nodes in turn, (k, 2)."""
    return np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)


def _lines(file: MeshFile) -> tuple[np.ndarray, np.ndarray]:
    """Line elements between neighbouring nodes, (k, 2), and their groups, (k,)."""
    lines, groups = [np.zeros((0, 2), dtype=int)], [np.zeros(0, dtype=int)]
    for kind, order in ((kind, order) for kind, order in _LINES.items() if kind in file.cells):
        for pair in pairwise(order):
            lines.append(file.cells[kind][:, pair])
            groups.append(file.groups[kind])
    return np.concatenate(lines), np.concatenate(groups)


def _corners(corners: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Places in the plane, each once, (k, 2), and which of them each corner is, as files may repeat corners."""
    points, places = np.unique(corners[:, :2], axis=0, return_inverse=True)
    if tolerance == 0.0:
        return points, places.reshape(-1)
    same = weld_points(np.pad(points, ((0, 0), (0, 1))), tolerance)
    return points[np.unique(same, return_index=True)[1]], same[places.reshape(-1)]


def _outer(edges: np.ndarray) -> np.ndarray:
    """The edges that are there once, (k, 2)."""
    distinct, times = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    return distinct[(times == 1) & (distinct[:, 0] != distinct[:, 1])]
