"""Shapes as particles."""

from .lattice import box, nodes

__all__ = ["box", "nodes"]
