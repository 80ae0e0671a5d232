"""Shapes as particles."""

from .lattice import box

__all__ = ["box"]
