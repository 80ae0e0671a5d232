"""Necking: a steel bar pulled by its ends to 40 % of its length, in plane strain and round, until it hangs by a thread.

R 6.413 mm, L 53.334 mm, E 206.9 GPa, ν 0.29, y = 0.45 + 0.265 (1 − e^(−16.93 α)) + 0.12924 α GPa: the standard problem
of necking, after a measured rod (Simo, Comput. Methods Appl. Mech. Eng. 68, 1988). Its ends are held, and it narrows to
0.982 R at the middle, so that it knows where to neck. Pulled at 20 m/s it is as good as at rest: less than 1 % of the
work is kinetic.

The largest load has a closed form. A long bar necks where dσ/dε = σ (Considère), at F = A y(ε) e^(−ε), in plane
strain with ε → 2ε/√3 and 2/√3 y: what is pulled here must lie between that of its narrowest section and that of the
widest. How the neck then narrows is compared over resolutions, between the arrangement of the start, the default, and
one that is read anew, until that comes apart, and with finite elements.
"""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from ...boundaries import Motion
from ...failure import UnstableError
from ...geometry import box, cylinder
from ...materials import J2, Voce
from ...scheme.arrangement import Arrangement, Convected, Current
from ...simulation import Body, Simulation
from ...space import Space
from ..case import Case
from ..report import Figure

RADIUS, LENGTH, WAIST = 6.413e-3, 53.334e-3, 0.982  # m, m, of the radius
SPEED, RISE = 20.0, 1e-4  # m/s of the ends from each other, and the time [s] in which it is reached
HARDENING = Voce(yield_stress=0.45e9, saturation=0.265e9, rate=16.93, modulus=0.12924e9)
STEEL = J2(density=7850.0, young=206.9e9, poisson=0.29, hardening=HARDENING)
#: Elongation -> radius over ``RADIUS`` of the layer half a spacing from the middle, 6 per radius, of a round bar of
#: finite elements (``validation/rod_elements.py``); later particles are too few for the neck.
ELEMENTS = {0.1: 0.919, 0.2: 0.674}
ELONGATIONS = np.arange(0.02, 0.405, 0.02)


@functools.cache
def apart(dim: int) -> Any:
    """``wp.func`` displacement [m] of the ends (X [m], t [s])."""
    vec, last = Space(dim).vec, dim - 1
    speed, rise, half, gain = 0.5 * SPEED, RISE, 0.5 * RISE, 0.25 * SPEED / RISE

    @wp.func
    def apart(X: vec, t: wp.float64) -> vec:
        way = wp.float64(speed) * (t - wp.float64(half))
        if t < wp.float64(rise):
            way = wp.float64(gain) * t * t
        out = vec()
        out[wp.static(last)] = way * wp.sign(X[wp.static(last)])
        return out

    return apart


def build(dim: int, k: int, arrangement: Arrangement | None = None) -> tuple[Simulation, Motion]:
    """The bar about the origin, ``k`` particles per radius, its ends two layers deep; and what moves the upper end."""
    spacing = RADIUS / k
    volume: Any
    if dim == 2:
        x, volume = box((-RADIUS, -0.5 * LENGTH), (RADIUS, 0.5 * LENGTH), spacing)
    else:
        x, volume = cylinder((0.0, 0.0, -0.5 * LENGTH), (0.0, 0.0, 0.5 * LENGTH), RADIUS, spacing)
    narrow = narrowing(x[:, -1])
    x[:, :-1] *= narrow[:, None]
    depth = 0.5 * LENGTH - 2.01 * spacing
    ends = [Motion(apart(dim), x[:, -1] < -depth), Motion(apart(dim), x[:, -1] > depth)]
    body = Body(x=x, volume=volume * narrow ** (dim - 1), material=STEEL, name="bar")
    return Simulation(body, boundaries=ends, arrangement=arrangement or Convected()), ends[1]


def narrowing(z: np.ndarray) -> np.ndarray:
    """Radius over ``RADIUS`` at the start at heights z [m]."""
    return WAIST + (1.0 - WAIST) * np.abs(z) / (0.5 * LENGTH)


def neck(simulation: Simulation, k: int) -> float:
    """Radius, or half width, at the middle over ``RADIUS``: by the mean square distance from the axis of two layers."""
    X, x = simulation.X, simulation.x
    middle = np.abs(X[:, -1]) < 1.01 * RADIUS / k
    before, now = (np.square(y[middle, :-1]).sum() for y in (X, x))
    return float(np.sqrt(now / before) * narrowing(X[middle, -1]).mean())


class Pulled(NamedTuple):
    """By elongation: neck over radius, load [N], or [N/m] in plane strain; and the shares of the work at the end."""

    elongation: np.ndarray
    neck: np.ndarray
    load: np.ndarray
    shares: dict[str, float]


def pull(dim: int, k: int, arrangement: Arrangement | None = None, until: float = 0.4) -> Pulled:
    """The bar pulled until this elongation, or until it fails."""
    simulation, end = build(dim, k, arrangement)
    rows = []
    for elongation in ELONGATIONS[: round(until / 0.02)]:
        try:
            simulation.run(elongation * LENGTH / SPEED + 0.5 * RISE)
        except UnstableError:
            break
        rows.append((elongation, neck(simulation, k), abs(simulation.reaction(end)[-1])))
    energy = simulation.energy()
    work = energy["constraint"]
    names = ("kinetic", "material", "dissipation", "tied", "stepping", "residual")
    shares = {name: energy[name] / work for name in names}
    strain, width, force = np.array(rows).T
    return Pulled(strain, width, force, shares | {"strain": float(simulation.history("plastic_strain").max())})


def load(dim: int, strain: np.ndarray | float) -> np.ndarray:
    """Load [N], [N/m] in plane strain, of a long bar at these logarithmic strains, elastic ones left out."""
    factor, area = (2.0 / np.sqrt(3.0), 2.0 * RADIUS) if dim == 2 else (1.0, np.pi * RADIUS**2)
    alpha, c = factor * np.asarray(strain), HARDENING
    stress = c.yield_stress + c.saturation * (1.0 - np.exp(-c.rate * alpha)) + c.modulus * alpha
    return factor * stress * np.exp(-np.asarray(strain)) * area


def of(name: str, dim: int, found: Pulled, until: float = 0.4) -> list[Figure]:
    """Load between its bounds, 1 % for looks that are 2 % of elongation apart and for inertia; necks by elongation.

    What the neck bears at the end over the long bar's load at the same section is 1 for a gentle neck, more for a
    sharp one (Bridgman), and nothing once it has come apart.
    """
    highest, waist = found.load.max() / load(dim, np.linspace(0.0, 0.4, 4001)).max(), WAIST ** (dim - 1)
    borne = found.load[-1] / float(load(dim, -(dim - 1) * np.log(found.neck[-1])))
    figures = [
        Figure(f"{name}_largest_load_over_considere", highest, 0.99 * waist, 1.01, 0.5 * (1.0 + waist)),
        Figure(f"{name}_elongation_reached", float(found.elongation[-1]), until - 1e-9, until + 1e-9, until),
        Figure(f"{name}_load_at_the_end_over_gentle_neck", float(borne), 0.95, 2.0, 1.0),
        Figure(f"{name}_kinetic_share", found.shares["kinetic"], 0.0, 0.01, 0.0),
        Figure(f"{name}_plastic_share", -found.shares["material"], 0.9, 1.0),
        Figure(f"{name}_dissipation_share", -found.shares["dissipation"], 0.0, 0.05, 0.0),
        Figure(f"{name}_made_by_stepping", found.shares["stepping"], -1e-3, 1e-3, 0.0),
        Figure(f"{name}_ledger_residual", abs(found.shares["residual"]), 0.0, 1e-11, 0.0),
        Figure(f"{name}_largest_plastic_strain", found.shares["strain"]),
    ]
    for elongation in (0.1, 0.2, 0.26, 0.3, 0.4):
        if elongation < found.elongation[-1] + 1e-9:
            figures.append(Figure(f"{name}_neck_at_{100 * elongation:.0f}%", _at(found, elongation)))
    return figures


def _at(found: Pulled, elongation: float) -> float:
    return float(np.interp(elongation, found.elongation, found.neck))


def run(quick: bool) -> Sequence[Figure]:
    """To 40 % by default, without coming apart; necks of neighbouring resolutions and of both arrangements agree.

    Quick: plane strain at 4 per radius, to 20 %.
    """
    if quick:
        return of("plane_4", 2, pull(2, 4, until=0.2), 0.2)
    found = {f"plane_{k}": pull(2, k) for k in (6, 8)}
    figures = [figure for name, pulled in found.items() for figure in of(name, 2, pulled)]
    for elongation, band in ((0.2, 0.05), (0.3, 0.1)):
        ratio = _at(found["plane_6"], elongation) / _at(found["plane_8"], elongation)
        name = f"plane_6_over_8_at_{100 * elongation:.0f}%"
        figures.append(Figure(name, ratio, 1.0 - band, 1.0 + band, 1.0))
    anew = pull(2, 6, Current(), until=0.24)
    for elongation in (0.08, 0.16):
        ratio = _at(anew, elongation) / _at(found["plane_6"], elongation)
        figures.append(Figure(f"plane_6_read_anew_over_kept_at_{100 * elongation:.0f}%", ratio, 0.97, 1.03, 1.0))
    bar = pull(3, 6)
    for elongation, radius in ELEMENTS.items():
        name = f"round_6_over_elements_at_{100 * elongation:.0f}%"
        figures.append(Figure(name, _at(bar, elongation) / radius, 0.97, 1.03, 1.0))
    return [*figures, *of("round_6", 3, bar)]


CASE = Case(
    name="necking",
    title="Bar pulled to 40 %: necks in plane strain and 3-D",
    source="Considère's largest load; resolutions and arrangements against each other",
    run=run,
)
