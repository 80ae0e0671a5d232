"""Boundary conditions, one per file."""

from .base import Assembly, Bound, Boundary, Region
from .velocity import Fixed, Velocity

__all__ = ["Assembly", "Bound", "Boundary", "Fixed", "Region", "Velocity"]
