"""``spatial_order`` brings neighbours in space together in memory; ``Order`` forgets those who are gone."""

import numpy as np
import pytest
from clouds import cloud
from test_sorting import shuffle, two_blocks

import warp_eulsph as es
from warp_eulsph.output import PointProbe


def distance_in_memory(x, spacing, order):
    """Mean distance in memory of particles that are near each other, as a share of all."""
    near = np.linalg.norm(x[order][:, None] - x[order][None], axis=-1) < 2.6 * spacing
    first, second = np.nonzero(near)
    return np.abs(first - second).mean() / len(x)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_spatial_order_brings_neighbours_together(dim):
    x, _ = cloud(dim, 9, jitter=0.2)
    mixed = np.random.default_rng(0).permutation(len(x))
    order = es.spatial_order(x[mixed], 1 / 9)
    assert np.array_equal(np.sort(order), np.arange(len(x)))
    assert distance_in_memory(x, 1 / 9, mixed) > 0.25
    assert distance_in_memory(x, 1 / 9, mixed[order]) < 1.1 * distance_in_memory(x, 1 / 9, np.arange(len(x)))


def test_spatial_order_keeps_rows_of_a_lattice_together():
    x, _ = cloud(3, 6, jitter=0.0)
    rows = x[es.spatial_order(x, 1 / 6)].reshape(9, 24, 3)
    np.testing.assert_allclose(np.ptp(rows, axis=1), np.tile([1 / 6, 1 / 6, 5 / 6], (9, 1)))


def test_bad_input_is_named():
    with pytest.raises(ValueError, match=r"x must be finite and have shape \(n, dim\), got \(3,\)"):
        es.spatial_order(np.zeros(3), 1.0)
    with pytest.raises(ValueError, match="spacing must be positive and finite, got 0"):
        es.spatial_order(np.zeros((3, 2)), 0.0)


def test_arrays_of_places_are_dropped_with_those_who_use_them():
    simulation = two_blocks()
    before = len(simulation.order._kept)
    for _ in range(3):
        PointProbe(name="point", X=(0.5, 0.5)).bind(simulation)
    shuffle(simulation)
    assert len(simulation.order._kept) == before
