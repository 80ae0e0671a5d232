"""Interactions: forces between bodies, or between bodies and something that moves beside them."""

from .base import BoundInteraction, Interaction
from .skin import Skin

__all__ = ["BoundInteraction", "Interaction", "Skin"]
