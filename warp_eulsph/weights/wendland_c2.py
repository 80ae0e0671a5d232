"""Wendland function C2 (Wendland 1995): no pairing at large dilations (Dehnen & Aly 2012)."""

import functools
import math

import warp as wp

from .base import Weight


class WendlandC2(Weight):
    """(1 − q/2)⁴ (1 + 2q), support 2 h; the same profile in 1-D, 2-D and 3-D."""

    support = 2.0
    sigma = (3.0 / 4.0, 7.0 / (4.0 * math.pi), 21.0 / (16.0 * math.pi))
    slope_cpp = "[](V u) { return 5 * u * u * u; }(1 - T(0.5) * q)"

    def profile(self, real: type) -> tuple[wp.Function, wp.Function]:
        return _profile(real)


@functools.cache
def _profile(real: type) -> tuple[wp.Function, wp.Function]:
    @wp.func
    def value(q: real) -> real:
        u = real(1.0) - real(0.5) * q
        u2 = u * u
        return u2 * u2 * (real(1.0) + real(2.0) * q)

    @wp.func
    def slope(q: real) -> real:
        u = real(1.0) - real(0.5) * q
        return real(5.0) * u * u * u

    return value, slope
