"""Bodies that tests of contact share: bars, rectangles, rubber rings."""

import numpy as np
import pytest

import warp_eulsph as es
from warp_eulsph.geometry import annulus

REFERENCES = pytest.mark.parametrize("arrangement", [es.Convected(), es.Current()], ids=["fixed", "moving"])
SOFT = es.NeoHookean(density=1000.0, young=1e7, poisson=0.3)
C_P = float(np.sqrt(1e7 * 0.7 / (1.3 * 0.4) / 1000.0))


def rectangle(columns, rows, spacing, at=(0.0, 0.0)):
    """Centres of square cells above and right of ``at``."""
    cells = np.stack(np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5, indexing="ij"), -1).reshape(-1, 2)
    return cells * spacing + np.array(at)


def bar(n, start, length, density, young=1.0, **options):
    """A bar along x whose waves run at √(young/density), ν = 0."""
    x = start + (np.arange(n)[:, None] + 0.5) * length / n
    material = es.NeoHookean(density=density, young=young, poisson=0.0)
    return es.Body(x=x, volume=length / n, material=material, **options)


def mean_velocity(simulation, name):
    own = simulation.ranges[name]
    return simulation.v[own.start : own.stop].mean(axis=0)


def bits(simulation):
    listed = {name: array.numpy().tobytes() for name, array in simulation.evolving().items()}
    return {**listed, **simulation.counters, "energy": simulation.energy()}


def rings(speed, circles=4, **options):
    """Two rubber rings that fly at each other, each at ``speed`` of its pressure waves."""
    x, volume = annulus(centre=(0.0, 0.0), inner=0.7, outer=1.0, rings=circles)
    v = speed * C_P
    left = es.Body(x=x, volume=volume, material=SOFT, velocity=(v, 0.0), name="left")
    right = es.Body(x=x + np.array([2.1, 0.1]), volume=volume, material=SOFT, velocity=(-v, 0.0), name="right")
    return es.Simulation([left, right], interactions=[es.Contact()], **options)
