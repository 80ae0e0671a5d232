"""Bodies that tests share: blocks of rubber on a lattice in the unit box."""

import numpy as np

import warp_eulsph as es

RUBBER = es.NeoHookean(density=1100.0, young=17e6, poisson=0.45)
COMPRESSIBLE = es.NeoHookean(density=1100.0, young=17e6, poisson=0.3)


def lattice(dim, n):
    """Centres of the n^dim cells of the unit box, (n^dim, dim)."""
    s = (np.arange(n) + 0.5) / n
    return np.stack(np.meshgrid(*[s] * dim, indexing="ij"), -1).reshape(-1, dim)


def block(dim, n, jitter=0.0, seed=0, **options):
    """The unit box of rubber of n^dim particles, jittered by a share of the spacing; options are those of Body."""
    x = lattice(dim, n)
    if jitter:
        x = x + jitter / n * np.random.default_rng(seed).uniform(-1, 1, x.shape)
    return es.Body(**{"x": x, "volume": float(n) ** -dim, "material": RUBBER, **options})


def bits(simulation):
    """All that evolves and what is summed of it, to compare bit by bit."""
    listed = {name: array.numpy().tobytes() for name, array in simulation.evolving().items()}
    return {**listed, **simulation.counters, "energy": simulation.energy(), "extrema": simulation.extrema()}
