"""Materials, one law per file."""

from .bar import Bar
from .base import Law, Material, Variable
from .damage import Failure, JohnsonCookFailure, PlasticStrain, PrincipalStrain, PrincipalStress
from .failing import Failing
from .hardening import Hardening, JohnsonCook, LinearHardening, Tabulated, Voce
from .j2 import J2
from .linear_elastic import LinearElastic
from .mooney_rivlin import MooneyRivlin
from .nearly_incompressible import NearlyIncompressible
from .neo_hookean import NeoHookean
from .neo_hookean_log import NeoHookeanLog
from .saint_venant_kirchhoff import SaintVenantKirchhoff
from .tait_liquid import TaitLiquid

__all__ = [
    "J2",
    "Bar",
    "Failing",
    "Failure",
    "Hardening",
    "JohnsonCook",
    "JohnsonCookFailure",
    "Law",
    "LinearElastic",
    "LinearHardening",
    "Material",
    "MooneyRivlin",
    "NearlyIncompressible",
    "NeoHookean",
    "NeoHookeanLog",
    "PlasticStrain",
    "PrincipalStrain",
    "PrincipalStress",
    "SaintVenantKirchhoff",
    "Tabulated",
    "TaitLiquid",
    "Variable",
    "Voce",
]
