"""Interactions: forces between bodies, or between bodies and something that moves beside them."""

from .base import BoundInteraction, Interaction
from .contact import Contact
from .skin import Skin

__all__ = ["BoundInteraction", "Contact", "Interaction", "Skin"]
