"""Solids thinner than a liquid beside them reaches: it feels what is behind them, so somebody should say so."""

import logging
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..boundaries import Assembly

if TYPE_CHECKING:
    from ..scheme.world import World
    from .skin import Skin
    from .wetting_solids import WettingOfSolids

log = logging.getLogger(__name__)


def tell_thin(
    world: "World",
    assembly: Assembly,
    skin: "Skin",
    touching: Collection[tuple[str, str]],
    wettings: Sequence["WettingOfSolids"],
) -> None:
    """Warn of bodies in the sums of a liquid (M28) whose mean thickness, 2 V/A, is less than its weight reaches.

    Args:
        world: at its start.
        assembly: what the contact was bound with. skin: of its bodies.
        touching: names of two bodies that touch each other, both ways round.
        wettings: solids in the sums of liquids.
    """
    by_number, area = assembly.order.by_number, np.zeros(len(assembly.X))
    area[skin.indices] = np.where(skin.there.numpy() == 1, skin.area.numpy(), 0.0)
    V0, spacing, h = (
        by_number(array.numpy()) for array in (world.particles.V0, world.particles.spacing, world.particles.h)
    )
    for wetting in wettings:
        liquid = np.arange(wetting.medium.span.start, wetting.medium.span.stop)
        dx, support = float(spacing[liquid].max()), wetting.medium.configuration.weight.support
        reach = support * float(h[liquid].max()) - 0.5 * dx  # from the surface: the liquid's outermost lie before it
        names = [name for name, own in assembly.bodies.items() if own.start in wetting.medium.span]
        for name, own in assembly.bodies.items():
            faces = area[own.start : own.stop].sum()
            if faces == 0.0 or own.start in wetting.medium.span or not any((each, name) in touching for each in names):
                continue
            thick = 2.0 * float(V0[own.start : own.stop].sum() / faces)
            if thick < reach:
                log.warning(
                    "Contact: %r is some %.3g m thick, and the weight of %s reaches %.3g m into it: the liquid feels "
                    "what is behind, and may pass; its spacing should be %.3g m or less, is %.3g m. Make it finer, or "
                    "give it weight=CubicSpline(), dilation=1.3, which reaches 2.6 spacings",
                    name,
                    thick,
                    ", ".join(map(repr, names)),
                    reach,
                    thick * dx / reach,
                    dx,
                )
