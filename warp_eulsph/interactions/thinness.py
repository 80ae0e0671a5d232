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

    Bonded ones are one: a thin coat of something thick is not thin. 2 V/A of a block is less than its shortest side,
    that of a cube a third of it.

    Args:
        world: at its start.
        assembly: what the contact was bound with. skin: of its bodies.
        touching: names of two bodies that touch each other, both ways round.
        wettings: solids in the sums of liquids.
    """
    if not wettings:
        return
    by_number, area = assembly.order.by_number, np.zeros(len(assembly.X))
    area[skin.indices] = np.where(skin.there.numpy() == 1, skin.area.numpy(), 0.0)
    particles = world.particles
    V0, spacing, h, group = (
        by_number(array.numpy()) for array in (particles.V0, particles.spacing, particles.h, particles.group)
    )
    for wetting in wettings:
        liquid = np.arange(wetting.medium.span.start, wetting.medium.span.stop)
        dx, support = float(spacing[liquid].max()), wetting.medium.configuration.weight.support
        reach = support * float(h[liquid].max()) - 0.5 * dx  # from the surface: the liquid's outermost lie before it
        names = [name for name, own in assembly.bodies.items() if own.start in wetting.medium.span]
        bonded: dict[int, list[str]] = {}
        for name, own in assembly.bodies.items():
            if own.start not in wetting.medium.span and any((each, name) in touching for each in names):
                bonded.setdefault(int(group[own.start]), []).append(name)
        for solids in bonded.values():
            numbers = np.concatenate([assembly.bodies[name] for name in solids])
            if (faces := area[numbers].sum()) == 0.0:
                continue
            thick = 2.0 * float(V0[numbers].sum() / faces)
            if thick < reach:
                log.warning(
                    "Contact: %s is some %.3g m thick (2 V/A), and the weight of %s reaches %.3g m into it: the liquid "
                    "feels what is behind, and may pass; its spacing should be %.3g m or less, is %.3g m. Make it "
                    "finer, or give it weight=CubicSpline(), dilation=1.3, which reaches 2.6 spacings",
                    " with ".join(map(repr, solids)),
                    thick,
                    ", ".join(map(repr, names)),
                    reach,
                    thick * dx / reach,
                    dx,
                )
