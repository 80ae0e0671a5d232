"""Sums over particles on the device in a fixed order: the same bits every run."""

import functools
from collections.abc import Sequence
from typing import Any

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


class SumOfParticles:
    """Σ over ``n`` particles of what a kernel makes of each, without an array of all that on the CPU.

    The kernel's parameters are the number of the block that its thread 0 has, n, the size of a block, its own ones, and
    an array, whose element k takes the sum over block k. Blocks are single particles on GPUs, whose threads must read
    side by side.
    """

    def __init__(self, dtype: type, n: int, device: wp.DeviceLike):
        self.n, self.each, self._launch = n, LEAST if wp.get_device(device).is_cpu else 1, Launcher(device)
        self._blocks = wp.zeros(-(-n // self.each), dtype=dtype, device=device)
        self._sum = Sum(dtype, len(self._blocks), device)

    def __call__(self, kernel: wp.Kernel, arguments: Sequence[Any], out: wp.array) -> None:
        """``out[0]`` ← Σ of what ``kernel`` makes of its ``arguments``."""
        arguments = [self.n, self.each, *arguments, self._blocks]
        self._launch(kernel, len(self._blocks), arguments, each=self.each)
        self._sum(self._blocks, out)
