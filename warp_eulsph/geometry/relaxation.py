"""Relaxation: particles that push each other apart until they lie evenly, and fit the surface."""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..execution import Launcher

Depth = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]

# Particles repel each other within this many spacings, and stay so many beneath the surface.
REACH, LEAST_DEPTH = 2.0, 0.25


@dataclass(frozen=True)
class Relaxation:
    """Particles repel each other and their mirror images in the surface, so that they come to lie evenly.

    Each sweep moves x_a by gain · s Σ_b (1 − r/2s)³ (x_a − x_b)/r, at most a tenth of the spacing s, over particles and
    images within 2 s. The outermost settle about half a spacing beneath the surface. Evenness over a few spacings
    comes first, over the whole shape last.

    Args:
        sweeps: how often particles move.
        gain: how far, over a spacing.
    """

    sweeps: int = 200
    gain: float = 0.1

    def __post_init__(self) -> None:
        if not 1 <= self.sweeps <= 10_000:
            raise ValueError(f"sweeps must be in [1, 10000], got {self.sweeps}; leave the relaxation out for none")
        if not 0.0 < self.gain <= 0.2:
            raise ValueError(f"gain must be in (0, 0.2], got {self.gain}; 0.1 is the tested value")

    def relax(self, x: np.ndarray, volume: float, depth: Depth, beneath: Depth) -> np.ndarray:
        """Positions [m], (n, dim), from those given; ``depth`` and ``beneath`` as in ``Solid``. On the host, to the
        same bits."""
        spacing = volume ** (1.0 / x.shape[1])
        x = x.copy()
        least = np.zeros(len(x))  # what the depth is at least, as particles move on from where it was measured
        for _ in range(self.sweeps):
            near = np.flatnonzero(least < REACH * spacing)
            # They stay inside: a quarter of a spacing beneath the surface, they move by a tenth.
            least[near], inward = self._inside(x, near, beneath, spacing)
            images = x[near] - 2.0 * least[near, None] * inward
            push = _push(x, images, REACH * spacing)
            length = np.linalg.norm(push, axis=1)
            step = spacing * self.gain / np.maximum(1.0, self.gain * length / 0.1)
            x += push * step[:, None]
            least -= length * step
        # But where the shape is thinner than that, the way back from one side leads out of the other.
        self._inside(x, np.flatnonzero(least < REACH * spacing), depth, spacing)
        return x

    @staticmethod
    def _inside(x: np.ndarray, near: np.ndarray, depth: Depth, spacing: float) -> tuple[np.ndarray, np.ndarray]:
        """Depth of the particles ``near`` the surface and unit vectors inwards; those that would leave are put back."""
        below, inward = depth(x[near])
        back = np.maximum(LEAST_DEPTH * spacing - below, 0.0)
        x[near] += back[:, None] * inward
        return below + back, inward


@functools.cache
def _make_push() -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False)
    def push(
        first: int,
        grid: wp.uint64,
        places: wp.array(dtype=wp.vec3d),
        reach: wp.float64,
        out: wp.array(dtype=wp.vec3d),
    ):
        a = first + wp.tid()
        x = places[a]
        total = wp.vec3d()
        for b in wp.hash_grid_query(grid, x, reach):
            away = x - places[b]
            square = wp.dot(away, away)
            # Most candidates are too far away, which shows without a root.
            if b != a and square < reach * reach and square > wp.float64(0.0):
                r = wp.sqrt(square)
                near = wp.float64(1.0) - r / reach
                total += away * (near * near * near / r)
        out[a] = total

    return push


def _push(x: np.ndarray, images: np.ndarray, reach: float) -> np.ndarray:
    """Σ_b (1 − r/reach)³ (x_a − x_b)/r over particles and images, (n, dim)."""
    n, dim = x.shape
    places = np.zeros((n + len(images), 3))
    places[:n, :dim], places[n:, :dim] = x, images
    points = wp.array(places, dtype=wp.vec3d, device="cpu")
    cells = np.clip((np.ptp(places, axis=0) / reach).astype(int) + 1, 1, 128)
    grid = wp.HashGrid(*(int(c) for c in cells), device="cpu", dtype=wp.float64)
    grid.build(points, reach)
    out = wp.zeros(n, dtype=wp.vec3d, device="cpu")
    Launcher("cpu")(_make_push(), n, [grid.id, points, reach, out])
    return out.numpy()[:, :dim]
