"""Wendland function C6 (Wendland 1995): no pairing at large dilations (Dehnen & Aly 2012)."""

import functools
import math

import warp as wp

from .base import Weight


class WendlandC6(Weight):
    """(1 − q/2)⁸ (1 + 4q + 25/4 q² + 4q³), support 2 h; the same profile in 1-D, 2-D and 3-D."""

    support = 2.0
    sigma = (15.0 / 16.0, 39.0 / (14.0 * math.pi), 1365.0 / (512.0 * math.pi))
    slope_cpp = "[](V u) { V c = u * u * u; return T(5.5) * c * c * u; }(1 - T(0.5) * q) * (1 + q * (T(3.5) + 4 * q))"

    def profile(self, real: type) -> tuple[wp.Function, wp.Function]:
        return _profile(real)


@functools.cache
def _profile(real: type) -> tuple[wp.Function, wp.Function]:
    @wp.func
    def value(q: real) -> real:
        u = real(1.0) - real(0.5) * q
        u4 = u * u * u * u
        return u4 * u4 * (real(1.0) + q * (real(4.0) + q * (real(6.25) + real(4.0) * q)))

    @wp.func
    def slope(q: real) -> real:
        u = real(1.0) - real(0.5) * q
        u3 = u * u * u
        return real(5.5) * u3 * u3 * u * (real(1.0) + q * (real(3.5) + real(4.0) * q))

    return value, slope
