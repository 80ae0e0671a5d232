"""Low-dispersion cube: a standing pressure wave in the unit cube."""

from collections.abc import Sequence

from ..case import Case
from ..report import Figure
from ..standing_wave import figures

LEVELS, QUICK = (10, 13, 16, 20), (6, 8, 10)


def run(quick: bool) -> Sequence[Figure]:
    """Second order less a twentieth; quick levels are too coarse for more than the order's first half, 1.6."""
    return figures(3, QUICK if quick else LEVELS, least_order=1.6 if quick else 1.9)


CASE = Case(
    name="low_dispersion_cube",
    title="Low-dispersion cube, 3-D, small strains: order of convergence of v, F and P",
    source="exact standing wave of linear elasticity",
    run=run,
)
