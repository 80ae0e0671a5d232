"""Lattices fill their boxes exactly."""

import numpy as np
import pytest

from warp_eulsph.geometry import box, nodes


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_box_is_filled_exactly(dim):
    lower, upper = np.array([-1.0, 0.5, 2.0])[:dim], np.array([1.0, 1.55, 2.3])[:dim]
    x, volume = box(lower, upper, 0.1)
    cells = [20, 10, 3][:dim]  # 1.05 m at 0.1 m: 10 cells of 0.105 m
    assert x.shape == (np.prod(cells), dim)
    assert len(x) * volume == pytest.approx(np.prod(upper - lower), rel=1e-14)
    # The lattice is symmetric: its centroid is the box's, and the outermost centres lie half a cell inside.
    np.testing.assert_allclose(x.mean(axis=0), (lower + upper) / 2, rtol=0, atol=1e-13)
    half = (upper - lower) / cells / 2
    np.testing.assert_allclose(x.min(axis=0), lower + half, rtol=0, atol=1e-13)
    np.testing.assert_allclose(x.max(axis=0), upper - half, rtol=0, atol=1e-13)


def test_last_axis_is_fastest():
    x, _ = box((0, 0), (2, 3), 1.0)
    np.testing.assert_array_equal(x[:3], [[0.5, 0.5], [0.5, 1.5], [0.5, 2.5]])


def test_jitter_is_bounded_and_repeatable():
    plain, volume = box((0, 0), (1, 2), 0.1)
    moved, same_volume = box((0, 0), (1, 2), 0.1, jitter=0.2, seed=3)
    again, _ = box((0, 0), (1, 2), 0.1, jitter=0.2, seed=3)
    other, _ = box((0, 0), (1, 2), 0.1, jitter=0.2, seed=4)
    assert volume == same_volume
    shift = np.abs(moved - plain).max()
    assert 0.018 < shift <= 0.02  # 400 draws come close to the bound of 0.2 spacings
    np.testing.assert_array_equal(moved, again)
    assert np.abs(moved - other).max() > 1e-3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((0.0,), (0.04,), 0.1), "at least one cell, got length 0.04 m along axis 0"),
        (((0, 0), (1, -1), 0.1), "along axis 1"),
        (((0, 0), (1,), 0.1), "must both have 1, 2 or 3 components"),
        (((0,), (1,), 0.0), "spacing must be positive"),
        (((0,), (np.inf,), 0.1), "at least one cell"),
    ],
)
def test_errors_name_the_cause(arguments, message):
    with pytest.raises(ValueError, match=message):
        box(*arguments)


def test_jitter_that_could_swap_particles_is_refused():
    with pytest.raises(ValueError, match="jitter must be in"):
        box((0,), (1,), 0.1, jitter=0.5)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_nodes_satisfy_the_divergence_theorem(dim):
    lower, upper = [-1.0, 0.0, 2.0][:dim], [1.0, 3.0, 2.5][:dim]
    x, volume, surface = nodes(lower, upper, 0.17)
    assert x.min(axis=0).tolist() == lower
    np.testing.assert_allclose(x.max(axis=0), upper, rtol=1e-15)
    total = np.prod(np.subtract(upper, lower))
    assert volume.sum() == pytest.approx(total, rel=1e-14)
    np.testing.assert_allclose(surface.sum(axis=0), 0.0, atol=1e-14)
    np.testing.assert_allclose(x.T @ surface, total * np.eye(dim), atol=1e-13)
    inside = ((x > np.array(lower) + 1e-9) & (x < np.array(upper) - 1e-9)).all(axis=1)
    assert not surface[inside].any()
    with pytest.raises(ValueError, match="every axis must hold at least one cell"):
        nodes(upper, lower, 0.1)
