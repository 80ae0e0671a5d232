"""Boundary conditions, one per file."""

from .base import Assembly, Bound, Boundary, Region
from .body_force import BodyForce
from .clamped import Clamped
from .damping import Damping
from .gravity import Gravity
from .mirror import Antisymmetry, MirrorGhosts, NoSlip, Wall, mirror
from .motion import Motion
from .pressure import Pressure
from .roller import Roller
from .traction import Traction
from .velocity import Fixed, Velocity

__all__ = [
    "Antisymmetry",
    "Assembly",
    "BodyForce",
    "Bound",
    "Boundary",
    "Clamped",
    "Damping",
    "Fixed",
    "Gravity",
    "MirrorGhosts",
    "Motion",
    "NoSlip",
    "Pressure",
    "Region",
    "Roller",
    "Traction",
    "Velocity",
    "Wall",
    "mirror",
]
