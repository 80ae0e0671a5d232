"""Rows of neighbours in slices: those of 32 particles interleaved, as threads of a GPU read them side by side.

"Sliced ELLPACK" (Monakov, Lokhmotov & Avetisyan, HiPEAC 2010), with slices of a warp's threads.
"""

import functools

import numpy as np
import warp as wp

from ..atomics import raise_to
from ..execution import Launcher
from ..structs import NeighbourRows

#: Rows of a slice: the threads of a warp.
SLICE = 32


@functools.cache
def _make_measure() -> wp.Kernel:
    """Kernel, thread by slice: the places it takes, and ``longest`` ← the longest row if that is longer."""
    raise_longest = raise_to(wp.int32)

    @wp.kernel(module="unique", enable_backward=False)
    def measure(
        first: int,
        count: wp.array(dtype=wp.int32),
        n: int,
        width: wp.array(dtype=wp.int32),
        longest: wp.array(dtype=wp.int32),
    ):
        s = first + wp.tid()
        most = int(0)
        for a in range(s * SLICE, wp.min((s + 1) * SLICE, n)):
            most = wp.max(most, count[a])
        width[s] = SLICE * most
        raise_longest(longest, most)

    return measure


@functools.cache
def _make_lay() -> wp.Kernel:
    """Kernel: where each row begins and stops."""

    @wp.kernel(module="unique", enable_backward=False)
    def lay(
        first: int,
        count: wp.array(dtype=wp.int32),
        begin: wp.array(dtype=wp.int32),
        n: int,
        start: wp.array(dtype=wp.int32),
        stop: wp.array(dtype=wp.int32),
    ):
        a = first + wp.tid()
        row = begin[a // SLICE] + a % SLICE
        start[a] = row
        stop[a] = row + SLICE * count[a]
        if a == n - 1:
            start[n] = begin[a // SLICE + 1]

    return lay


class Slices:
    """Where the rows of n particles lie: slices one behind another, each as wide as its longest row.

    Attributes:
        longest: neighbours in the longest row, (1,).
    """

    def __init__(self, n: int, device: wp.DeviceLike):
        self._launch = Launcher(device)
        self._width, self._begin = (wp.zeros(-(-n // SLICE) + 1, dtype=wp.int32, device=device) for _ in range(2))
        self.longest = wp.zeros(1, dtype=wp.int32, device=device)

    def lay(self, count: wp.array, rows: NeighbourRows) -> None:
        """``rows.start``, with the places that all take behind the last, and ``rows.stop`` from lengths, (n + 1,)."""
        n = len(count) - 1
        self.longest.zero_()
        self._launch(_make_measure(), len(self._width) - 1, [count, n, self._width, self.longest])
        wp.utils.array_scan(self._width, self._begin, inclusive=False)
        self._launch(_make_lay(), n, [count, self._begin, n, rows.start, rows.stop])

    def release(self) -> None:
        """Let go of the lengths."""
        self._launch.forget()


def places_taken(count: np.ndarray) -> int:
    """Places that rows of these lengths take in slices, (n,), counted without running over."""
    whole = np.zeros(-(-len(count) // SLICE) * SLICE, dtype=np.int64)
    whole[: len(count)] = count
    return SLICE * int(whole.reshape(-1, SLICE).max(axis=1, initial=0).sum())
