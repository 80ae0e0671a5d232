"""Solids thinner than a liquid beside them reaches: it feels what is behind them, so somebody should say so."""

import logging
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..boundaries import Assembly
from ..boundaries.outermost import BLOCKING, pairs

if TYPE_CHECKING:
    from ..scheme.world import World
    from .skin import Skin
    from .wetting_solids import WettingOfSolids

log = logging.getLogger(__name__)

# Cosine between the ways out of opposite faces: 120°, so that sides that meet in a corner are none.
OPPOSITE = -0.5
# Spacings from a corner, whose way out leads along a diagonal, to the next particle of each of its faces: √2 and some.
BESIDE = 1.5
# Particles whose pairs are in memory at once: some hundred each where they are five times as fine as the liquid.
AT_ONCE = 4096


def thickness(x: np.ndarray, outward: np.ndarray, spacing: np.ndarray, reach: float) -> float:
    """How thick matter is beneath its outermost particles [m], of a box its shortest side; inf beyond ``reach``.

    Beneath each it is how far the opposite face lies along the normal, there or beneath a particle beside. The share
    1/dim of them have no more: the two faces across the shortest side of a box are as much of its surface or more.

    Args:
        x: places of the outermost particles [m], (k, dim). outward: vectors out of the matter there, (k, dim).
        spacing: of each [m], (k,); they lie half of it beneath the surface. reach: [m].
    """
    normal = outward / np.linalg.norm(outward, axis=1, keepdims=True)
    own, least = np.full((2, len(x)), np.inf)
    for part in np.array_split(np.arange(len(x)), len(x) // AT_ONCE + 1):
        a, b = pairs(x[part], x, reach)
        a = part[a]
        opposite = (normal[a] * normal[b]).sum(axis=1) < OPPOSITE
        a, b = a[opposite], b[opposite]
        away, mean = x[a] - x[b], 0.5 * (spacing[a] + spacing[b])
        depth, length = (away * normal[a]).sum(axis=1), np.linalg.norm(away, axis=1)
        across = np.linalg.norm(away - depth[:, None] * normal[a], axis=1)
        through = (depth > 0.0) & (across < BLOCKING * mean) & (length + mean < reach)
        np.minimum.at(own, a[through], (length + mean)[through])
    a, b = pairs(x, x, BESIDE * float(spacing.max()))
    np.minimum.at(least, a, own[b])
    return float(np.sort(least)[(len(x) - 1) // x.shape[1]])


def tell_thin(
    world: "World",
    assembly: Assembly,
    skin: "Skin",
    touching: Collection[tuple[str, str]],
    wettings: Sequence["WettingOfSolids"],
) -> None:
    """Warn of bodies in the sums of a liquid (M28) that are thinner than its weight reaches.

    Bonded ones are one: a thin coat of something thick is not thin.

    Args:
        world: at its start.
        assembly: what the contact was bound with. skin: of its bodies.
        touching: names of two bodies that touch each other, both ways round.
        wettings: solids in the sums of liquids.
    """
    if not wettings:
        return
    by_number, particles = assembly.order.by_number, world.particles
    outward, spacing, h, group = (
        by_number(array.numpy()) for array in (particles.outward, particles.spacing, particles.h, particles.group)
    )
    outermost = skin.indices[skin.there.numpy() == 1]
    outermost = outermost[outward[outermost].any(axis=1)]
    for wetting in wettings:
        liquid = np.arange(wetting.medium.span.start, wetting.medium.span.stop)
        dx, support = float(spacing[liquid].max()), wetting.medium.configuration.weight.support
        reach = support * float(h[liquid].max()) - 0.5 * dx  # from the surface: the liquid's outermost lie before it
        names = [name for name, own in assembly.bodies.items() if own.start in wetting.medium.span]
        bonded: dict[int, list[str]] = {}
        for name, own in assembly.bodies.items():
            if own.start not in wetting.medium.span and any((each, name) in touching for each in names):
                bonded.setdefault(int(group[own.start]), []).append(name)
        for number, solids in bonded.items():
            own = outermost[group[outermost] == number]
            thick = thickness(assembly.X[own], outward[own], spacing[own], reach) if len(own) else np.inf
            if thick < reach:
                log.warning(
                    "Contact: %s is %.3g m thick, and the weight of %s reaches %.3g m into it: the liquid feels what "
                    "is behind, and may pass; its spacing should be %.3g m or less, is %.3g m. Make it finer, or give "
                    "it weight=CubicSpline(), dilation=1.3, which reaches 2.6 spacings",
                    " with ".join(map(repr, solids)),
                    thick,
                    ", ".join(map(repr, names)),
                    reach,
                    thick * dx / reach,
                    dx,
                )
