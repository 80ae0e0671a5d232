"""Small clouds with edges and corners, and the library's configuration on them."""

import numpy as np
import warp as wp

from warp_eulsph import CubicSpline, Space
from warp_eulsph.fields import allocate
from warp_eulsph.scheme.reference import Configuration


def cloud(dim, side=6, jitter=0.2, seed=1):
    """Jittered lattice in the unit box: positions (side^dim, dim) and equal volumes."""
    rng = np.random.default_rng(seed)
    ticks = np.stack(np.meshgrid(*[np.arange(side)] * dim, indexing="ij"), -1).reshape(-1, dim)
    return (ticks + 0.5 + rng.uniform(-jitter, jitter, ticks.shape)) / side, np.full(len(ticks), float(side) ** -dim)


def configuration_of(x, volume, h, *, weight=CubicSpline(), real=wp.float64, box=None, density=1.0):
    """The reference on positions ``x`` (n, dim), refreshed; ``h`` a number or (n,)."""
    n, dim = x.shape
    space = Space(dim, real, box is not None)
    particles = allocate(space, "Particles", n, "cpu")
    particles.mass.assign(density * volume)
    particles.V0.assign(volume)
    particles.spacing.assign(volume ** (1.0 / dim))
    particles.h.assign(np.broadcast_to(h, n))
    state = allocate(space, "State", n, "cpu")
    state.x.assign(x)
    state.F.assign(np.broadcast_to(np.eye(dim), (n, dim, dim)))
    configuration = Configuration(space, weight, particles, box if box is not None else (0.0,) * dim, "cpu")
    configuration.refresh(state)
    return configuration
