"""The scheme and the weight of bodies that were given none: solids and gases, or liquids."""

from typing import NamedTuple

from .materials import Material
from .scheme.base import Scheme
from .scheme.dissipation import Upwind
from .scheme.shifting import Shifting
from .scheme.uncorrected import Uncorrected
from .scheme.verlet import Verlet
from .weights import CubicSpline, Weight, WendlandC2


class Suited(NamedTuple):
    """What suits a kind of matter: scheme, weight, smoothing length over spacing."""

    scheme: Scheme
    weight: Weight
    dilation: float


#: Gradients are exact for linear fields.
COMMON = Suited(Verlet(), CubicSpline(), 1.3)

#: Pressure follows the arrangement (M27) and is even (M24), the arrangement is
#: kept so (M15), and particles do not pair up by this weight (Dehnen & Aly 2012). In smooth waves half of M9 is as much
#: by it as the whole is by the common one: its fourth moment is twice as large (``tests/test_defaults.py``). Not for
#: gases: their pressure at rest moves particles wherever the arrangement is uneven.
LIQUID = Suited(
    Verlet(dissipation=Upwind(epsilon=0.5, volume=True), correction=Uncorrected(), shifting=Shifting()),
    WendlandC2(),
    1.8,
)


def suited(material: Material) -> Suited:
    """What suits this material."""
    return LIQUID if material.liquid else COMMON
