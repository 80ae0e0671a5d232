"""Sums over particles: of any number, the same bits on any number of threads."""

import functools

import numpy as np
import pytest
import warp as wp

from warp_eulsph import execution
from warp_eulsph.reduce import LEAST, MOST_BLOCKS, Sum, SumOfParticles, SumOfRuns


@pytest.mark.parametrize("n", [0, 1, LEAST, LEAST + 1, LEAST**2 + 5, 3 * LEAST * MOST_BLOCKS + 7])
def test_sums_are_right_and_repeatable(n):
    values = np.random.default_rng(n).normal(size=(n, 2))
    array, out = wp.array(values, dtype=wp.vec2d), wp.zeros(1, dtype=wp.vec2d)
    total, found = Sum(wp.vec2d, n, wp.get_device()), []
    for count in (1, 3):
        execution.set_threads(count)
        total(array, out)
        found.append(out.numpy()[0].copy())
    assert np.array_equal(*found)
    np.testing.assert_allclose(found[0], values.sum(axis=0), rtol=0.0, atol=1e-15 * max(np.abs(values).sum(), 1.0))


@pytest.mark.parametrize("sizes", [[3, 1, LEAST], [LEAST + 8, 5], [7, LEAST**2 + 5, 2, 3 * LEAST * MOST_BLOCKS + 7]])
def test_sums_of_runs_have_the_bits_of_each_alone(sizes):
    values = np.random.default_rng(0).normal(size=sum(sizes))
    array, out = wp.array(values, dtype=wp.float64), wp.zeros(len(sizes), dtype=wp.float64)
    SumOfRuns(wp.float64, sizes, wp.get_device())(array, out)
    for found, end, n in zip(out.numpy(), np.cumsum(sizes), sizes, strict=True):
        own, alone = wp.array(values[end - n : end], dtype=wp.float64), wp.zeros(1, dtype=wp.float64)
        Sum(wp.float64, n, wp.get_device())(own, alone)
        assert found == alone.numpy()[0]


@functools.cache
def _make_squares():
    @wp.kernel(module="unique", enable_backward=False)
    def squares(
        first: int,
        bounds: wp.array(dtype=wp.int32),
        x: wp.array(dtype=wp.float64),
        seen: wp.array(dtype=int),
        out: wp.array(dtype=wp.float64),
    ):
        block = first + wp.tid()
        total = wp.float64(0.0)
        for a in range(bounds[block], bounds[block + 1]):
            total += x[a] * x[a]
            seen[a] = seen[a] + 1
        out[block] = total

    return squares


@pytest.mark.parametrize("n", [1, LEAST, LEAST + 1, 40 * LEAST + 13])
def test_every_particle_is_in_one_block(n, monkeypatch):
    monkeypatch.setattr(execution, "LEAST_RANGE", 16)
    x, seen = wp.array(np.arange(n) + 1.0, dtype=wp.float64), wp.zeros(n, dtype=int)
    total, out = SumOfParticles(wp.float64, [n], wp.get_device()), wp.zeros(1, dtype=wp.float64)
    for count in (1, 3):
        execution.set_threads(count)
        total(_make_squares(), [x, seen], out)
        assert out.numpy()[0] == n * (n + 1) * (2 * n + 1) // 6  # whole numbers: exact in any order
    assert (seen.numpy() == 2).all()
