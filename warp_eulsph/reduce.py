"""Sums over particles on the device in a fixed order: the same bits every run."""

import functools
from typing import Any

import warp as wp

from .execution import Launcher

BLOCKS = 256


def _scalar(dtype: Any) -> Any:
    """Scalar type of a scalar or vector type."""
    return getattr(dtype, "_wp_scalar_type_", dtype)


@functools.cache
def _make_partial(dtype: Any) -> Any:
    zero = _scalar(dtype)(0)

    @wp.kernel(module="unique", enable_backward=False)
    def partial(values: wp.array(dtype=dtype), n: int, out: wp.array(dtype=dtype)):
        block = wp.tid()
        total = dtype(zero)
        # 64-bit: block · n overflows 32 bits from 16 million values on
        first = int(wp.int64(block) * wp.int64(n) // wp.int64(BLOCKS))
        last = int(wp.int64(block + 1) * wp.int64(n) // wp.int64(BLOCKS))
        for i in range(first, last):
            total += values[i]
        out[block] = total

    return partial


@functools.cache
def _make_final(dtype: Any) -> Any:
    zero = _scalar(dtype)(0)

    @wp.kernel(module="unique", enable_backward=False)
    def final(partial: wp.array(dtype=dtype), out: wp.array(dtype=dtype)):
        total = dtype(zero)
        for block in range(BLOCKS):
            total += partial[block]
        out[0] = total

    return final


class Sum:
    """Σ over (n,) values of one Warp type into a one-element array, without allocation after construction."""

    def __init__(self, dtype: Any, device: Any):
        self.partial = wp.zeros(BLOCKS, dtype=dtype, device=device)
        self.dtype, self._launch = dtype, Launcher(device)

    def __call__(self, values: wp.array, out: wp.array) -> None:
        """``out[0]`` ← Σ values."""
        self._launch.once(_make_partial(self.dtype), BLOCKS, [values, len(values), self.partial])
        self._launch.once(_make_final(self.dtype), 1, [self.partial, out])
