"""Cubic spline of Monaghan & Lattanzio (1985)."""

import functools
import math

import warp as wp

from .base import Weight


class CubicSpline(Weight):
    """Cubic B-spline, support 2h."""

    support = 2.0
    sigma = (2.0 / 3.0, 10.0 / (7.0 * math.pi), 1.0 / math.pi)
    slope_cpp = "q < 1 ? 3 - T(2.25) * q : T(0.75) * (2 - q) * (2 - q) / q"

    def profile(self, real: type) -> tuple[wp.Function, wp.Function]:
        return _profile(real)


@functools.cache
def _profile(real: type) -> tuple[wp.Function, wp.Function]:
    @wp.func
    def value(q: real) -> real:
        w = real(0.25) * (real(2.0) - q) * (real(2.0) - q) * (real(2.0) - q)
        if q < real(1.0):
            w = real(1.0) - real(1.5) * q * q + real(0.75) * q * q * q
        return w

    @wp.func
    def slope(q: real) -> real:
        s = real(3.0) - real(2.25) * q
        if q >= real(1.0):
            s = real(0.75) * (real(2.0) - q) * (real(2.0) - q) / q
        return s

    return value, slope
