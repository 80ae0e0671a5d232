"""Neighbour lists in periodic boxes down to the smallest one allowed: each neighbour once."""

import numpy as np
import pytest
from clouds import cloud, configuration_of

from warp_eulsph import CubicSpline


@pytest.mark.parametrize(
    ("dim", "side", "dilation"), [(1, 8, 2.0), (1, 30, 1.3), (2, 6, 1.5), (2, 8, 2.0), (3, 6, 1.3)]
)
def test_every_image_is_counted_once(dim, side, dilation):
    x, volume = cloud(dim, side, jitter=0.3)
    x[0] -= 1.0  # one period outside the box
    h = dilation / side
    lists = configuration_of(x, volume, h, box=(1.0,) * dim).lists
    away = x[:, None] - x[None]
    r = np.linalg.norm(away - np.round(away), axis=-1) + 9.0 * np.eye(len(x))
    expected = [np.flatnonzero(row < CubicSpline.support * h) for row in r]
    assert np.array_equal(lists.lengths, [len(row) for row in expected])
    assert np.array_equal(lists.of_pairs(lists.rows.index), np.concatenate(expected))
