"""Closed outlines in the plane, read from mesh files, and the distance to them."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from os import PathLike
from typing import Any

import numpy as np
import warp as wp

from ..execution import Launcher
from .filling import Filling, Lattice
from .mesh_file import read_mesh
from .relaxation import Relaxation
from .solid import Solid
from .surface import Surface

# Corners and lines that miss each other by this share of the outline's size are taken to meet.
SAME = 1e-9


def outline(
    file: str | PathLike,
    spacing: float,
    *,
    scale: float = 1.0,
    filling: Filling = Lattice(),
    relaxation: Relaxation | None = None,
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

    Returns:
        Positions [m], (n, 2), and areas [m²], (n,), all equal, whose sum is the area inside.

    Raises:
        ModuleNotFoundError: meshio is not installed.
        OSError: no such file.
        ValueError: not a mesh, not flat, an outline that is open or crosses itself, or a spacing too coarse.
    """
    lines = read_outline(file, scale)
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

    def check_closed(self, who: str) -> None:
        """Raise ValueError unless an even number of lines meet in every corner."""
        meet = np.bincount(self.segments.ravel(), minlength=len(self.points))
        loose = np.flatnonzero(meet % 2)
        if len(loose):
            raise ValueError(
                f"{who}: the outline must be closed, got {len(loose)} loose ends, the first at "
                f"{self.points[loose[0]]} m; close the gaps in a mesh tool"
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
        nearest = Surface(corners, walls, {}).query(winding=False)
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
def _make_crossings() -> Any:
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


def read_outline(path: str | PathLike, scale: float = 1.0) -> Outline:
    """The outline of a mesh file: outer edges of its triangles and quadrangles, or its lines where it has none.

    Raises:
        ModuleNotFoundError, OSError: as ``read_mesh``.
        ValueError: as ``read_mesh``, or neither faces nor lines, or not in a plane of constant z.
    """
    file = read_mesh(path, scale)
    faces = [file.cells[kind] for kind in ("triangle", "quad") if kind in file.cells]
    lines = file.cells.get("line", np.zeros((0, 2), dtype=int))
    edges = [face[:, [k, (k + 1) % face.shape[1]]] for face in faces for k in range(face.shape[1])]
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
    # Each corner once: files may repeat those of single lines or facets.
    points, places = np.unique(corners[:, :2], axis=0, return_inverse=True)
    number = np.zeros(len(file.points), dtype=int)
    number[used] = places.reshape(-1)
    whole = number[lines][number[lines[:, 0]] != number[lines[:, 1]]]
    groups = file.groups.get("line", np.zeros(0, dtype=int))[number[lines[:, 0]] != number[lines[:, 1]]]
    if edges:
        every = np.sort(number[np.concatenate(edges)], axis=1)
        distinct, times = np.unique(every, axis=0, return_counts=True)
        segments = distinct[(times == 1) & (distinct[:, 0] != distinct[:, 1])]
    else:
        segments = whole
    return Outline(points, segments, {file.patch(k, 1): whole[groups == k] for k in np.unique(groups) if k >= 0})
