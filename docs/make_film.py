"""The film of the README: ``python docs/make_film.py`` runs a rubber column that is twisted, and draws it.

A minute on two cores; ``docs/film.gif`` is replaced.
"""

import tempfile
from pathlib import Path

import numpy as np

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.output import Run
from warp_eulsph.pictures import Picture, film

SIDE, FRAMES, END = 8, 30, 0.386  # particles across, frames, the period of the twist [s]


def main() -> None:
    """Run, draw."""
    x, volume = box((-0.5, 0.0, -0.5), (0.5, 6.0, 0.5), 1.0 / SIDE)
    spin = 100.0 * np.sin(np.pi * x[:, 1] / 12.0)  # rad/s
    velocity = np.stack([spin * x[:, 2], np.zeros(len(x)), -spin * x[:, 0]], axis=1)
    rubber = es.NeoHookean(density=1100.0, young=17e6, poisson=0.45)
    column = es.Body(x=x, volume=volume, material=rubber, velocity=velocity)
    simulation = es.Simulation(column, boundaries=[es.Clamped((0.0, 0.0, 0.0), (0.0, -1.0, 0.0))])
    with tempfile.TemporaryDirectory() as folder:
        simulation.run(until=END, every=END / FRAMES, output=folder)
        look = Picture(field="von_mises", size=(400, 480), limits=(0.0, 1e7), view=(0.6, 0.35, 1.0))
        print(film(Run(folder), Path(__file__).with_name("film.gif"), look, fps=15))


if __name__ == "__main__":
    main()
