"""Pictures and films of runs: matplotlib in 1-D and 2-D, PyVista in 3-D, both imported when something is drawn.

Every particle is drawn as the cell that its deformation gradient made of its first one, so that pictures show matter
rather than dots.
"""

from .draw import Picture, draw_frame, film, fitted, picture
from .quantity import Quantity, default_field, quantity

__all__ = ["Picture", "Quantity", "default_field", "draw_frame", "film", "fitted", "picture", "quantity"]
