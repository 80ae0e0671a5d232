"""Materials, one law per file."""

from .base import Law, Material
from .neo_hookean import NeoHookean

__all__ = ["Law", "Material", "NeoHookean"]
