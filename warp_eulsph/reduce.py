"""Sums over particles on the device in a fixed order: the same bits every run."""

import functools
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp

from .execution import Launcher

# One thread sums at least this many values, and there are at most this many threads: enough to keep a GPU busy.
LEAST, MOST_BLOCKS = 64, 16384


def _scalar(dtype: type) -> type:
    """Scalar type of a scalar or vector type."""
    return getattr(dtype, "_wp_scalar_type_", dtype)


@functools.cache
def _make_partial(dtype: type) -> wp.Kernel:
    """Kernel: Σ of each of ``blocks`` equal parts of ``n`` values."""
    zero = _scalar(dtype)(0)

    @wp.kernel(module="unique", enable_backward=False)
    def partial(first: int, values: wp.array(dtype=dtype), n: int, blocks: int, out: wp.array(dtype=dtype)):
        block = first + wp.tid()
        total = dtype(zero)
        # 64-bit: block · n overflows 32 bits
        start = int(wp.int64(block) * wp.int64(n) // wp.int64(blocks))
        end = int(wp.int64(block + 1) * wp.int64(n) // wp.int64(blocks))
        for i in range(start, end):
            total += values[i]
        out[block] = total

    return partial


class Sum:
    """Σ over values of one Warp type, ``most`` at most, into a one-element array; allocates at construction only."""

    def __init__(self, dtype: type, most: int, device: wp.DeviceLike):
        self.dtype, self._launch = dtype, Launcher(device)
        blocks = min(most // LEAST, MOST_BLOCKS)
        self._scratch = [wp.zeros(size, dtype=dtype, device=device) for size in (blocks, blocks // LEAST)]

    def __call__(self, values: wp.array, out: wp.array) -> None:
        """``out[0]`` ← Σ values, in parts of parts."""
        n, (into, then) = len(values), self._scratch
        while n > LEAST:
            blocks = min(n // LEAST, MOST_BLOCKS)
            self._launch(_make_partial(self.dtype), blocks, [values, n, blocks, into])
            values, n, into, then = into, blocks, then, into
        self._launch(_make_partial(self.dtype), 1, [values, n, 1, out])


@functools.cache
def _make_sum_parts(dtype: type) -> wp.Kernel:
    """Kernel: Σ of the values from each of ``bounds`` to the next."""
    zero = _scalar(dtype)(0)

    @wp.kernel(module="unique", enable_backward=False)
    def sum_parts(
        first: int, values: wp.array(dtype=dtype), bounds: wp.array(dtype=wp.int32), out: wp.array(dtype=dtype)
    ):
        part = first + wp.tid()
        total = dtype(zero)
        for i in range(bounds[part], bounds[part + 1]):
            total += values[i]
        out[part] = total

    return sum_parts


class SumOfRuns:
    """Σ over the values of each run by itself, which follow each other: the bits of a ``Sum`` of them alone.

    Args:
        sizes: how many values each run has, at least one.
    """

    def __init__(self, dtype: type, sizes: Sequence[int], device: wp.DeviceLike):
        self.dtype, self._launch = dtype, Launcher(device)
        self._levels: list[tuple[wp.array, wp.array | None]] = []
        sizes = list(sizes)
        last = False
        while not last:
            last = max(sizes) <= LEAST
            parts = [1 if last else n if n <= LEAST else min(n // LEAST, MOST_BLOCKS) for n in sizes]
            starts = np.cumsum([0, *sizes]).tolist()
            bounds = [start + k * n // m for start, n, m in zip(starts, sizes, parts, strict=False) for k in range(m)]
            bounds = wp.array([*bounds, starts[-1]], dtype=wp.int32, device=device)
            into = None if last else wp.zeros(sum(parts), dtype=dtype, device=device)
            self._levels.append((bounds, into))
            sizes = parts

    def __call__(self, values: wp.array, out: wp.array) -> None:
        """``out[r]`` ← Σ of the values of run r, in parts of parts."""
        for bounds, into in self._levels:
            self._launch(_make_sum_parts(self.dtype), len(bounds) - 1, [values, bounds, out if into is None else into])
            values = into


def sum_of(dtype: type, sizes: Sequence[int], device: wp.DeviceLike) -> Sum | SumOfRuns:
    """Sums over runs of these sizes, or over the only one."""
    return Sum(dtype, sizes[0], device) if len(sizes) == 1 else SumOfRuns(dtype, sizes, device)


class SumOfParticles:
    """Σ over particles, run by run, of what a kernel makes of each, without an array of all that on the CPU.

    The kernel's parameters are the number of the block that its thread 0 has, ``bounds``, its own ones, and an array,
    whose element k takes the sum over the particles from bounds[k] to bounds[k + 1]. Blocks are single particles on
    GPUs, whose threads must read side by side.

    Args:
        sizes: particles of each run, in their order.
    """

    def __init__(self, dtype: type, sizes: Sequence[int], device: wp.DeviceLike):
        self.each, self._launch = LEAST if wp.get_device(device).is_cpu else 1, Launcher(device)
        starts = np.cumsum([0, *sizes])
        bounds = [np.arange(start, end, self.each) for start, end in pairwise(starts)]
        self._bounds = wp.array(np.concatenate([*bounds, starts[-1:]]), dtype=wp.int32, device=device)
        self._blocks = wp.zeros(len(self._bounds) - 1, dtype=dtype, device=device)
        self._sum = sum_of(dtype, [len(each) for each in bounds], device)

    def __call__(self, kernel: wp.Kernel, arguments: Sequence[Any], out: wp.array) -> None:
        """``out[r]`` ← Σ over run r of what ``kernel`` makes of its ``arguments``."""
        arguments = [self._bounds, *arguments, self._blocks]
        self._launch(kernel, len(self._blocks), arguments, each=self.each)
        self._sum(self._blocks, out)
