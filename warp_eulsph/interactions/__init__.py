"""Interactions: forces between bodies, or between bodies and something that moves beside them."""

from ..options import explain_mistakes
from .base import BoundInteraction, Interaction
from .contact import Contact
from .free import Free
from .rigid import BoundRigidBody, RigidBody
from .rigid_motion import Driven, Held, Moving, RigidMotion
from .shapes import Box, Cylinder, Plane, Shape, Sphere
from .skin import Skin
from .triangle_mesh import TriangleMesh

__all__ = [
    "BoundInteraction",
    "BoundRigidBody",
    "Box",
    "Contact",
    "Cylinder",
    "Driven",
    "Free",
    "Held",
    "Interaction",
    "Moving",
    "Plane",
    "RigidBody",
    "RigidMotion",
    "Shape",
    "Skin",
    "Sphere",
    "TriangleMesh",
]

explain_mistakes(
    ["Box", "Cylinder", "Driven", "Free", "Held", "Moving", "Plane", "Sphere", "TriangleMesh"], globals()
)  # the package's front door has the others
