"""SPH weights, one per file."""

from .base import Weight
from .cubic_spline import CubicSpline
from .quartic_spline import QuarticSpline
from .quintic_spline import QuinticSpline
from .wendland_c2 import WendlandC2
from .wendland_c4 import WendlandC4
from .wendland_c6 import WendlandC6

__all__ = ["CubicSpline", "QuarticSpline", "QuinticSpline", "Weight", "WendlandC2", "WendlandC4", "WendlandC6"]
