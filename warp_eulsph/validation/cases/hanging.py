"""A rubber cube let go under so much gravity that it hangs down to two and a half times its height, and comes back.

It hangs from one more layer of particles, held above its top; its sides are free. There is no closed form; gravity is
conservative, so that the cube must come back to where it was but for what M9 takes of its waves, and the largest
stretch must converge: two resolutions beside each other, on a lattice and on a jittered cloud.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...boundaries import BodyForce, Fixed
from ...geometry import box
from ...materials import NeoHookean
from ...scheme.policy import Always, ReferencePolicy
from ...simulation import Body, Simulation
from ..case import Case
from ..report import Figure

GRAVITY = 800.0  # m/s²
CUBE = NeoHookean(density=1000.0, young=1e6, poisson=0.3)
END_TIME, FRAME = 0.3, 0.0025


def build(dim: int, n: int, reference: ReferencePolicy, jitter: float = 0.0, **options: Any) -> Simulation:
    """The square or cube of n^dim particles, and the layer that it hangs from."""
    x, volume = box((0.0,) * dim, (1.0,) * (dim - 1) + (1.0 + 1.0 / n,), 1.0 / n)
    top = np.flatnonzero(x[:, -1] > 1.0)
    x = x + jitter / n * np.random.default_rng(0).uniform(-1.0, 1.0, x.shape)
    body = Body(x=x, volume=volume, spacing=1.0 / n, material=CUBE)
    pull = BodyForce([0.0] * (dim - 1) + [-GRAVITY])
    return Simulation(body, boundaries=[Fixed(top), pull], reference=reference, **options)


def measure(dim: int, n: int, jitter: float) -> dict[str, float]:
    """Largest stretch of the height, how far it comes back, least det F, and what M9 took over gravity's work."""
    simulation = build(dim, n, Always(), jitter)
    bottom = simulation.X[:, -1] < 1.0 / n
    height = 1.0 - 0.5 / n  # of the lowest layer below the top
    heights, J, work = [], [], []
    for _ in simulation.frames(np.arange(1, round(END_TIME / FRAME) + 1) * FRAME):
        heights.append((1.0 - simulation.x[bottom, -1].mean()) / height)
        J.append(simulation.extrema()["least J"])
        work.append(simulation.energy()["external"])
    lowest = int(np.argmax(heights))
    return {
        "stretch": float(np.max(heights)),
        "back": float(np.min(heights[lowest:])),
        "least_J": float(np.min(J)),
        "lost": -simulation.energy()["dissipation"] / float(np.max(work)),
    }


def run(quick: bool) -> Sequence[Figure]:
    """Largest stretches of two resolutions, and of a jittered cloud, within 2 % of each other; nothing torn."""
    cases = {"plane": (2, 16, 24)} if quick else {"plane": (2, 24, 48), "solid": (3, 8, 14)}
    figures = []
    for name, (dim, coarse, fine) in cases.items():
        finest, rough, jittered = measure(dim, fine, 0.0), measure(dim, coarse, 0.0), measure(dim, fine, 0.1)
        figures.append(Figure(f"{name}_largest_stretch", finest["stretch"]))
        for other, label in ((rough, f"{coarse}_across"), (jittered, "10_percent_jitter")):
            apart = other["stretch"] / finest["stretch"] - 1.0
            figures.append(Figure(f"{name}_largest_stretch_{label}", apart, -0.02, 0.02, 0.0))
        figures.append(Figure(f"{name}_comes_back_to", finest["back"], reference=1.0))
        figures.append(Figure(f"{name}_least_J", min(finest["least_J"], jittered["least_J"]), low=0.3, reference=1.0))
        figures.append(Figure(f"{name}_energy_lost", finest["lost"], 0.0, 0.05, 0.0))
    return figures


CASE = Case(
    name="hanging",
    title="Rubber cube let go under heavy gravity: stretch of two and a half and back",
    source="itself at two resolutions and with jitter; gravity is conservative",
    run=run,
)
