"""Sums over particles: of any number, the same bits on any number of threads."""

import numpy as np
import pytest
import warp as wp

from warp_eulsph import execution
from warp_eulsph.reduce import LEAST, MOST_BLOCKS, Sum


@pytest.mark.parametrize("n", [0, 1, LEAST, LEAST + 1, LEAST**2 + 5, 3 * LEAST * MOST_BLOCKS + 7])
def test_sums_are_right_and_repeatable(n):
    values = np.random.default_rng(n).normal(size=(n, 2))
    array, out = wp.array(values, dtype=wp.vec2d, device="cpu"), wp.zeros(1, dtype=wp.vec2d, device="cpu")
    total, threads, found = Sum(wp.vec2d, n, "cpu"), execution.threads(), []
    for count in (1, 3):
        execution.set_threads(count)
        total(array, out)
        found.append(out.numpy()[0].copy())
    execution.set_threads(threads)
    assert np.array_equal(*found)
    np.testing.assert_allclose(found[0], values.sum(axis=0), rtol=0.0, atol=1e-15 * max(np.abs(values).sum(), 1.0))
