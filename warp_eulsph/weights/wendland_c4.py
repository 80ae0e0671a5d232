"""Wendland function C4 (Wendland 1995): no pairing at large dilations (Dehnen & Aly 2012)."""

import functools
import math

import warp as wp

from .base import Weight


class WendlandC4(Weight):
    """(1 − q/2)⁶ (1 + 3q + 35/12 q²), support 2 h; the same profile in 1-D, 2-D and 3-D."""

    support = 2.0
    sigma = (27.0 / 32.0, 9.0 / (4.0 * math.pi), 495.0 / (256.0 * math.pi))
    slope_cpp = "[](V u) { return T(14.0 / 3) * u * u * u * u * u; }(1 - T(0.5) * q) * (1 + T(2.5) * q)"

    def profile(self, real: type) -> tuple[wp.Function, wp.Function]:
        return _profile(real)


@functools.cache
def _profile(real: type) -> tuple[wp.Function, wp.Function]:
    @wp.func
    def value(q: real) -> real:
        u = real(1.0) - real(0.5) * q
        u3 = u * u * u
        return u3 * u3 * (real(1.0) + q * (real(3.0) + real(35.0) / real(12.0) * q))

    @wp.func
    def slope(q: real) -> real:
        u = real(1.0) - real(0.5) * q
        u2 = u * u
        return real(14.0) / real(3.0) * u2 * u2 * u * (real(1.0) + real(2.5) * q)

    return value, slope
