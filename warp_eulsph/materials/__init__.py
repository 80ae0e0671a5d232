"""Materials, one law per file."""

from ..options import explain_mistakes
from .bar import Bar
from .base import Law, Material, Variable
from .damage import Failure, JohnsonCookFailure, PlasticStrain, PrincipalStrain, PrincipalStress
from .drucker_prager import DruckerPrager
from .failing import Failing
from .fluid import Fluid
from .hardening import Hardening, JohnsonCook, LinearHardening, Tabulated, Voce
from .j2 import J2
from .linear_elastic import LinearElastic
from .mie_gruneisen import MieGruneisen
from .mooney_rivlin import MooneyRivlin
from .nearly_incompressible import NearlyIncompressible
from .neo_hookean import NeoHookean
from .neo_hookean_log import NeoHookeanLog
from .saint_venant_kirchhoff import SaintVenantKirchhoff
from .stiffened_gas import IdealGas, StiffenedGas
from .tait_liquid import TaitLiquid
from .viscosity import Newtonian, PowerLaw, Viscosity

__all__ = [
    "J2",
    "Bar",
    "DruckerPrager",
    "Failing",
    "Failure",
    "Fluid",
    "Hardening",
    "IdealGas",
    "JohnsonCook",
    "JohnsonCookFailure",
    "Law",
    "LinearElastic",
    "LinearHardening",
    "Material",
    "MieGruneisen",
    "MooneyRivlin",
    "NearlyIncompressible",
    "NeoHookean",
    "NeoHookeanLog",
    "Newtonian",
    "PlasticStrain",
    "PowerLaw",
    "PrincipalStrain",
    "PrincipalStress",
    "SaintVenantKirchhoff",
    "StiffenedGas",
    "Tabulated",
    "TaitLiquid",
    "Variable",
    "Viscosity",
    "Voce",
]

explain_mistakes(__all__, globals())
