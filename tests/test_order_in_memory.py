"""Sorting particles in space: a permutation that undoes, with neighbours close in memory, and the same results."""

import numpy as np
import pytest

import warp_eulsph as es
from warp_eulsph.geometry import box


def distance_in_memory(simulation):
    """Mean |b − a| over the neighbours, as a share of the particles."""
    near, n = simulation.stepper.configuration.near, len(simulation.x)
    rows = np.repeat(np.arange(n), np.diff(near.start.numpy()))
    return np.abs(near.index.numpy()[: len(rows)] - rows).mean() / n


def test_shuffled_particles_come_in_order_and_move_alike():
    x, volume = box((0.0, 0.0), (1.0, 1.0), 1 / 24)
    mixed = np.random.default_rng(0).permutation(len(x))
    order = es.spatial_order(x[mixed], 1 / 24)
    assert np.array_equal(np.sort(order), np.arange(len(x)))
    material, found = es.NeoHookean(density=1e3, young=1e7, poisson=0.3), {}
    for name, choice in (("lattice", np.arange(len(x))), ("mixed", mixed), ("sorted", mixed[order])):
        chosen = x[choice]
        velocity = np.c_[np.sin(3.0 * chosen[:, 1]), chosen[:, 0]]
        found[name] = es.Simulation(es.Body(x=chosen, volume=volume, material=material, velocity=velocity))
        found[name].step(5)
    assert distance_in_memory(found["mixed"]) > 0.3
    assert distance_in_memory(found["sorted"]) < 3.0 * distance_in_memory(found["lattice"]) < 0.15
    back = found["sorted"].x[np.argsort(order)]
    np.testing.assert_allclose(back, found["mixed"].x, rtol=0.0, atol=1e-12)


def test_bad_input_is_named():
    with pytest.raises(ValueError, match=r"x must be finite and have shape \(n, dim\), got \(3,\)"):
        es.spatial_order(np.zeros(3), 1.0)
    with pytest.raises(ValueError, match="spacing must be positive and finite, got 0"):
        es.spatial_order(np.zeros((3, 2)), 0.0)
