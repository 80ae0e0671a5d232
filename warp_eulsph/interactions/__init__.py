"""Interactions: forces between bodies, or between bodies and something that moves beside them."""

from .base import BoundInteraction, Interaction

__all__ = ["BoundInteraction", "Interaction"]
