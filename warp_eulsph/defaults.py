"""The scheme and the weight of bodies that were given none: solids and gases, what yields, liquids."""

from collections.abc import Sequence
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

#: Dissipation by forces alone takes a sixth of what yielding takes when metal is struck, and feet stay narrow; with its
#: stress half as much. Rubber that is twisted fast needs what it takes (docs/method.md, §6).
YIELDING = COMMON._replace(scheme=Verlet(dissipation=Upwind(stress=True)))

#: Pressure follows the arrangement (M27) and is even (M24), the arrangement is
#: kept so (M15), and particles do not pair up by this weight (Dehnen & Aly 2012). In smooth waves half of M9 is as much
#: by it as the whole is by the common one: its fourth moment is twice as large (``tests/test_defaults.py``). Not for
#: gases: their pressure at rest moves particles wherever the arrangement is uneven.
LIQUID = Suited(
    Verlet(dissipation=Upwind(epsilon=0.5, volume=True), correction=Uncorrected(), shifting=Shifting()),
    WendlandC2(),
    1.8,
)


def suited(matter: Sequence[Material]) -> Suited:
    """What suits a body of this matter, or bonded bodies of these: they are one medium, and one that yields decides."""
    if all(material.liquid for material in matter):
        return LIQUID
    return YIELDING if any(material.yields for material in matter) else COMMON
