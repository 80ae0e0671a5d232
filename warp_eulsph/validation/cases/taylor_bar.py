"""Taylor's bar: a copper rod strikes a rigid, frictionless wall and flows there until it is at rest.

R 3.2 mm, L 32.4 mm, 227 m/s; ρ0 8930 kg/m³, E 117 GPa, ν 0.35, y = 0.4 GPa + 0.1 GPa α, 80 µs: the standard problem of
metal impact. Published answers of finite elements and of particles: final length 21.4 to 21.7 mm, radius of the foot
6.9 to 7.25 mm, largest plastic strain 2.5 to 3.25. Length is an easy figure, the foot the telling one.

The wall is a plane of symmetry, ghosts behind it. At the foot particles are flattened to a tenth and spread to twice
the radius. What keeps a coarse foot narrow is dissipation (M9); with its stress, as metals have it by default, it takes
half as much, and the rod has the shape that finite elements give it (``validation/rod_elements.py``). Where neighbours
are read anew there is no such form, and the foot grows with resolution.
"""

import math
from collections.abc import Sequence

import numpy as np

from ...boundaries import mirror
from ...geometry import cylinder
from ...materials import J2, LinearHardening
from ...scheme.arrangement import Arrangement, Convected, Current
from ...simulation import Body, Simulation
from ..case import Case
from ..report import Figure

RADIUS, LENGTH, SPEED, END = 3.2e-3, 32.4e-3, 227.0, 80e-6  # m, m, m/s, s
COPPER = J2(density=8930.0, young=117e9, poisson=0.35, hardening=LinearHardening(yield_stress=0.4e9, modulus=0.1e9))
#: Neighbours kept from the start, the default, or read anew.
FORMS: dict[str, Arrangement] = {"kept": Convected(), "anew": Current()}
# Finite elements of revolution, 6 per radius: length, foot, radii at HEIGHTS [mm]
ELEMENTS = (21.44, 7.14, 5.02, 4.27, 3.45)
HEIGHTS = (2e-3, 5e-3, 10e-3)  # of the radii on the way [m]
OUTER = 0.7  # of the radius: particles further out show where the surface is


def build(k: int, arrangement: Arrangement) -> Simulation:
    """The rod above the wall z = 0, ``k`` particles per radius, and its mirror image as deep as its diameter."""
    x, volume = cylinder((0.0, 0.0, 0.0), (0.0, 0.0, LENGTH), RADIUS, RADIUS / k)
    rod = Body(x=x, volume=volume, material=COPPER, velocity=[0.0, 0.0, -SPEED], name="rod")
    rod, wall = mirror(rod, point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, -1.0), depth=2.0 * RADIUS)
    return Simulation(rod, boundaries=[wall], arrangement=arrangement)


def outline(X: np.ndarray, x: np.ndarray, radius: float = RADIUS) -> np.ndarray:
    """Radii and heights of the side [m], (layers, 2), the lowest first.

    Of each layer of the start, X, those at the initial ``radius`` on the line that fits the outer particles: how
    far beneath the surface the outermost ones of a lattice lie depends on its spacing.
    """
    R, layer = np.hypot(X[:, 0], X[:, 1]), np.round(X[:, 2] / X[:, 2].min()).astype(int)
    found = []
    for number in np.unique(layer):
        outer = (layer == number) & (OUTER * radius < R)
        line = np.stack([np.ones(outer.sum()), R[outer]], axis=-1)
        values = np.stack([np.hypot(x[outer, 0], x[outer, 1]), x[outer, 2]], axis=-1)
        found.append([1.0, radius] @ np.linalg.lstsq(line, values, rcond=None)[0])
    return np.array(found)


def measure(simulation: Simulation, k: int) -> dict[str, float]:
    """Shape [mm], largest plastic strain, and where the energy went, as shares of that at the start.

    The length is the mean height of the layer at the free end and half a spacing; radii are those of the outline, at
    the foot on at the wall, half a layer below the lowest.
    """
    X, half, ghosts = simulation.X, 0.5 * RADIUS / k, simulation.particles.share.numpy()
    own = simulation.order.by_number(ghosts) > 0.0
    X, x, strain = X[own], simulation.x[own], simulation.history("plastic_strain")[own]
    end, side = X[:, 2] > LENGTH - 2.0 * half, outline(X, x)
    energy, start = simulation.energy(), simulation.stepper.ledger.start
    found = {
        "length": 1e3 * (x[end, 2].mean() + half),
        "foot": 1e3 * float(1.5 * side[0, 0] - 0.5 * side[1, 0]),
    }
    for height in HEIGHTS:
        found[f"radius_at_{1e3 * height:.0f}mm"] = 1e3 * float(np.interp(height, side[:, 1], side[:, 0]))
    shares = {name: energy[name] / start for name in ("material", "dissipation", "stepping", "residual")}
    return found | {"plastic_strain": float(strain.max())} | shares


def run(quick: bool) -> Sequence[Figure]:
    """Against finite elements: lengths within 1 %; foot and radii within 4 %, the foot within 8 % where read anew.

    Quick: 4 particles per radius.
    """
    figures = []
    for k in (4,) if quick else (5, 6):
        for form, arrangement in FORMS.items():
            simulation = build(k, arrangement)
            simulation.run(END)
            now, (length, foot, *radii) = measure(simulation, k), ELEMENTS
            band, most = (0.04, 0.04) if form == "kept" else (0.08, 0.09)
            figures += [
                Figure(f"{form}_{k}_length_mm", now["length"], 0.99 * length, 1.01 * length, length),
                Figure(f"{form}_{k}_foot_radius_mm", now["foot"], (1.0 - band) * foot, (1.0 + band) * foot, foot),
                Figure(f"{form}_{k}_largest_plastic_strain", now["plastic_strain"], 2.0, 4.0, 2.9),
                Figure(f"{form}_{k}_plastic_share", -now["material"], 0.9, 1.0),
                Figure(f"{form}_{k}_dissipation_share", -now["dissipation"], 0.0, most, 0.0),
                Figure(f"{form}_{k}_made_by_stepping", now["stepping"], -0.005, 0.005, 0.0),
            ]
            for height, radius in zip(HEIGHTS, radii, strict=True):
                name, off = f"radius_at_{1e3 * height:.0f}mm", band * radius if form == "kept" else math.inf
                figures.append(Figure(f"{form}_{k}_{name}", now[name], radius - off, radius + off, radius))
    return figures


CASE = Case(
    name="taylor_bar",
    title="Copper rod on a rigid wall (Taylor's bar), 3-D, neighbours kept and read anew",
    source="finite elements of revolution; published ranges of length and foot radius",
    run=run,
)
