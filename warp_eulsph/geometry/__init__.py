"""Shapes as particles."""

from ..options import explain_mistakes
from .annulus import annulus
from .filling import BodyCentred, Filling, Lattice, Staggered
from .lattice import box, nodes
from .mesh import Patch, mesh
from .outline import outline
from .relaxation import Relaxation
from .repair import Repair
from .shapes import cylinder, disc, ring, sphere, tube

__all__ = [
    "BodyCentred",
    "Filling",
    "Lattice",
    "Patch",
    "Relaxation",
    "Repair",
    "Staggered",
    "annulus",
    "box",
    "cylinder",
    "disc",
    "mesh",
    "nodes",
    "outline",
    "ring",
    "sphere",
    "tube",
]

explain_mistakes(__all__, globals())
