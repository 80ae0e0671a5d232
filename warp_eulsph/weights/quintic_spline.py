"""Quintic spline of Schoenberg (1946)."""

import functools
import math

import warp as wp

from .base import Weight


class QuinticSpline(Weight):
    """Quintic B-spline, support 3 h."""

    support = 3.0
    sigma = (1.0 / 120.0, 7.0 / (478.0 * math.pi), 1.0 / (120.0 * math.pi))
    slope_cpp = (
        "q < 1 ? 120 - 120 * q * q + 50 * q * q * q : [](V a, V b) { return 5 * (a * a - 6 * b * b * b * b); }"
        "((3 - q) * (3 - q), __builtin_elementwise_max(2 - q, (V)0)) / q"
    )

    def profile(self, real: type) -> tuple[wp.Function, wp.Function]:
        return _profile(real)


@functools.cache
def _profile(real: type) -> tuple[wp.Function, wp.Function]:
    @wp.func
    def fifth(x: real) -> real:
        return x * x * x * x * x

    @wp.func
    def value(q: real) -> real:
        w = fifth(real(3.0) - q)
        if q < real(2.0):
            w -= real(6.0) * fifth(real(2.0) - q)
        if q < real(1.0):
            w += real(15.0) * fifth(real(1.0) - q)
        return w

    @wp.func
    def slope(q: real) -> real:
        s = real(120.0) - real(120.0) * q * q + real(50.0) * q * q * q
        if q >= real(1.0):
            a = (real(3.0) - q) * (real(3.0) - q)
            b = wp.max(real(2.0) - q, real(0.0))
            s = real(5.0) * (a * a - real(6.0) * b * b * b * b) / q
        return s

    return value, slope
