"""Small clouds with edges and corners, the library's configuration on them, and dense numpy counterparts."""

import numpy as np
import warp as wp

from warp_eulsph import CubicSpline, Space
from warp_eulsph.fields import allocate
from warp_eulsph.geometry import box
from warp_eulsph.scheme.reference import Configuration


def cloud(dim, side=6, jitter=0.2, seed=1):
    """Jittered lattice in the unit box: positions (side^dim, dim) and equal volumes."""
    rng = np.random.default_rng(seed)
    ticks = np.stack(np.meshgrid(*[np.arange(side)] * dim, indexing="ij"), -1).reshape(-1, dim)
    return (ticks + 0.5 + rng.uniform(-jitter, jitter, ticks.shape)) / side, np.full(len(ticks), float(side) ** -dim)


#: Particles along an edge of a block, by dimension.
COUNT = {1: 16, 2: 8, 3: 6}


def block(dim, jitter=0.2, shape=None):
    """A block of unit spacing with edges and corners, (n, dim)."""
    shape = (COUNT[dim],) * dim if shape is None else shape
    x, _ = box((0.0,) * dim, tuple(map(float, shape)), 1.0)
    return x + jitter * np.random.default_rng(4).uniform(-1.0, 1.0, x.shape)


#: Blocks with all that shortens a step: edges, corners, jitter, two particles across.
BODIES = {
    "square": block(2, 0.0, (12, 12)),
    "jittered square": block(2, 0.2, (12, 12)),
    "strip": block(2, 0.0, (14, 2)),
    "cube": block(3, 0.0),
    "jittered cube": block(3),
    "jittered plate": block(3, 0.1, (7, 7, 2)),
    "rod": block(3, 0.0, (10, 2, 2)),
}


def configuration_of(x, volume, h, *, weight=CubicSpline(), real=wp.float64, box=None, density=1.0):
    """The reference on positions ``x`` (n, dim), refreshed; ``h`` a number or (n,)."""
    (n, dim), device = x.shape, wp.get_device()
    space = Space(dim, real, box is not None)
    particles = allocate(space, "Particles", n, device)
    particles.mass.assign(density * volume)
    particles.V0.assign(volume)
    particles.spacing.assign(volume ** (1.0 / dim))
    particles.h.assign(np.broadcast_to(h, n))
    state = allocate(space, "State", n, device)
    state.x.assign(x)
    state.F.assign(np.broadcast_to(np.eye(dim), (n, dim, dim)))
    configuration = Configuration(space, weight, particles, box if box is not None else (0.0,) * dim, device)
    configuration.refresh(state)
    return configuration


def cubic(r, h, dim):
    """Cubic spline W(r, h)."""
    q = r / h
    w = np.where(q < 1, 1 - 1.5 * q**2 + 0.75 * q**3, np.where(q < 2, 0.25 * (2 - q) ** 3, 0.0))
    return {1: 2 / 3, 2: 10 / (7 * np.pi), 3: 1 / np.pi}[dim] * w / h**dim


def dense_N(x, volume, h, linear):
    """N_ab = V_b W̃_b(x_a) from the definition: W̃_b(x_a) = W_ab (1, x_a − x_b)·c_a with the moments solved densely."""
    n, dim = x.shape
    offset = x[:, None] - x[None]
    W = cubic(np.linalg.norm(offset, axis=-1), 0.5 * (h[:, None] + h[None]), dim)
    basis = np.concatenate([np.ones((n, n, 1)), offset], axis=-1) if linear else np.ones((n, n, 1))
    moments = np.einsum("ab,abi,abj->aij", W * volume, basis, basis)
    first = np.zeros((n, basis.shape[-1], 1))
    first[:, 0] = 1.0
    c = np.linalg.solve(moments, first)[..., 0]
    return W * volume * np.einsum("abi,ai->ab", basis, c)
