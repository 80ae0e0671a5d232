"""SPH weights, one per file."""

from .base import Weight
from .cubic_spline import CubicSpline

__all__ = ["CubicSpline", "Weight"]
