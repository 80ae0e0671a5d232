"""Quartic spline of Schoenberg (1946)."""

import functools
import math

import warp as wp

from .base import Weight


class QuarticSpline(Weight):
    """Quartic B-spline, support 2.5 h."""

    support = 2.5
    sigma = (1.0 / 24.0, 96.0 / (1199.0 * math.pi), 1.0 / (20.0 * math.pi))
    slope_cpp = (
        "q < T(0.5) ? 30 - 24 * q * q : [](V a, V b) { return 4 * (a * a * a - 5 * b * b * b); }"
        "(T(2.5) - q, __builtin_elementwise_max(T(1.5) - q, (V)0)) / q"
    )

    def profile(self, real: type) -> tuple[wp.Function, wp.Function]:
        return _profile(real)


@functools.cache
def _profile(real: type) -> tuple[wp.Function, wp.Function]:
    @wp.func
    def fourth(x: real) -> real:
        return x * x * x * x

    @wp.func
    def value(q: real) -> real:
        w = fourth(real(2.5) - q)
        if q < real(1.5):
            w -= real(5.0) * fourth(real(1.5) - q)
        if q < real(0.5):
            w += real(10.0) * fourth(real(0.5) - q)
        return w

    @wp.func
    def slope(q: real) -> real:
        s = real(30.0) - real(24.0) * q * q
        if q >= real(0.5):
            a = real(2.5) - q
            b = wp.max(real(1.5) - q, real(0.0))
            s = real(4.0) * (a * a * a - real(5.0) * b * b * b) / q
        return s

    return value, slope
