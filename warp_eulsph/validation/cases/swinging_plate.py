"""Swinging plate: a standing shear wave on the unit square."""

from collections.abc import Sequence

from ..case import Case
from ..report import Figure
from ..standing_wave import figures

LEVELS, QUICK = (12, 16, 20, 28), (12, 16, 20)


def run(quick: bool) -> Sequence[Figure]:
    """Second order less a twentieth at these resolutions; the finest level is left out when quick."""
    return figures(2, QUICK if quick else LEVELS, least_order=1.9)


CASE = Case(
    name="swinging_plate",
    title="Swinging plate, 2-D, small strains: order of convergence of v, F and P",
    source="exact standing wave of linear elasticity",
    run=run,
)
