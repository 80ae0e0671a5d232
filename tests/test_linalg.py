"""Point functions of small matrices against numpy, in every dimension and precision."""

import functools

import numpy as np
import pytest
import warp as wp

from warp_eulsph import Space
from warp_eulsph.linalg import (
    largest_shortening,
    reciprocal_cube_root,
    reciprocal_power,
    stretch_bounds,
    stretch_of_volume,
    symmetric_bounds,
)
from warp_eulsph.scheme.updates import moved_surface

SPACES = [Space(dim, real) for dim in (1, 2, 3) for real in (wp.float32, wp.float64)]


def eps(space):
    return np.finfo(space.numpy).eps


def matrices(space, n=2000):
    """Matrices with det > 0, from hardly to strongly strained, (n, dim, dim)."""
    rng = np.random.default_rng(space.dim)
    strain = 10.0 ** rng.uniform(-6, -0.3, (n, 1, 1)) * rng.uniform(-1, 1, (n, space.dim, space.dim))
    A = np.eye(space.dim) + strain
    return A[np.linalg.det(A) > 0.05].astype(space.numpy)


@functools.cache
def _make_bounds(space):
    mat, pair, real = space.mat, space.row(2), space.real
    of_stretches, of_symmetric, shortening_of = (
        stretch_bounds(space),
        symmetric_bounds(space),
        largest_shortening(space),
    )

    @wp.kernel(module="unique", enable_backward=False)
    def bounds(
        A: wp.array(dtype=mat), out: wp.array(dtype=pair), same: wp.array(dtype=pair), shortening: wp.array(dtype=real)
    ):
        a = wp.tid()
        out[a] = of_stretches(A[a])
        same[a] = of_symmetric(A[a] @ wp.transpose(A[a]))
        shortening[a] = shortening_of(A[a])

    return bounds


@pytest.mark.parametrize("space", SPACES, ids=repr)
def test_bounds_of_stretches_hold_and_are_those_of_the_product(space):
    A = matrices(space)
    n, pair = len(A), space.row(2)
    out, same = (wp.zeros(n, dtype=pair) for _ in range(2))
    shortening = wp.zeros(n, dtype=space.real)
    wp.launch(_make_bounds(space), n, [wp.array(A, dtype=space.mat), out, same, shortening])
    squares = np.linalg.svd(A.astype(float), compute_uv=False) ** 2
    low, high = out.numpy().astype(float).T
    # The spread s is (2/3) √D, D = |A|⁴ − 3 |cof A|² in 3-D, of which round-off may be all there is: some 50 ε in D
    # make some 11 ε/s in s
    tolerance = 16.0 * eps(space) * high**2 / np.maximum(0.5 * (high - low), np.sqrt(eps(space)) * high)
    assert (low <= squares.min(axis=1) + tolerance).all()
    assert (high >= squares.max(axis=1) - tolerance).all()
    assert (np.abs(out.numpy() - same.numpy()).max(axis=1) <= 2.0 * tolerance).all()
    bound, shortest, longest = shortening.numpy().astype(float), 1.0 / squares.min(axis=1), 1.0 / squares.max(axis=1)
    tolerance = 16.0 * eps(space) * shortest**2 / np.maximum(0.5 * (shortest - longest), np.sqrt(eps(space)) * shortest)
    assert (bound >= shortest - tolerance * shortest / longest).all()  # J, by which is divided, has lost as much
    if space.dim < 3:  # exact there
        assert (bound <= shortest + tolerance * shortest / longest).all()


@functools.cache
def _make_roots(space):
    real = space.real
    root, stretch = reciprocal_cube_root(real), stretch_of_volume(space)

    @wp.kernel(module="unique", enable_backward=False)
    def roots(x: wp.array(dtype=real), out: wp.array(dtype=real), stretches: wp.array(dtype=real)):
        a = wp.tid()
        out[a] = root(x[a])
        stretches[a] = stretch(x[a])

    return roots


@pytest.mark.parametrize("space", SPACES, ids=repr)
def test_roots_are_right_to_the_last_place(space):
    x = np.concatenate([10.0 ** np.linspace(-30, 30, 100_001), [1.0, 8.0, 27.0]]).astype(space.numpy)
    given = np.concatenate([x, [0.0, -1.0, np.nan]]).astype(space.numpy)
    out, stretches = (wp.zeros(len(given), dtype=space.real) for _ in range(2))
    arguments = [wp.array(given, dtype=space.real), out, stretches]
    wp.launch(_make_roots(space), len(given), arguments)
    wide = np.longdouble(x)
    assert np.abs(out.numpy()[:-3] * np.cbrt(wide) - 1.0).max() <= eps(space)
    assert np.isnan(out.numpy()[-3:]).all()
    assert np.abs(stretches.numpy()[:-3] / wide ** (np.longdouble(1) / space.dim) - 1.0).max() <= 4 * eps(space)
    assert (stretches.numpy()[-3:-1] == 0.0).all() and np.isnan(stretches.numpy()[-1])


@functools.cache
def _make_powers(real):
    power = reciprocal_power(real)

    @wp.kernel(module="unique", enable_backward=False)
    def powers(x: wp.array(dtype=real), p: real, out: wp.array(dtype=real)):
        out[wp.tid()] = power(x[wp.tid()], p)

    return powers


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("p", [1.0, 6.0, 7.0, 16.0, 17.0, 0.4, 6.5])
def test_powers_are_right(p, dtype):
    """Each product rounds once, and what 1/x has lost comes p times: some p + 4 units in the last place."""
    numpy = np.float32 if dtype is wp.float32 else np.float64
    x = np.random.default_rng(0).uniform(0.3, 3.0, 10_000).astype(numpy)
    out = wp.zeros(len(x), dtype=dtype)
    wp.launch(_make_powers(dtype), len(x), [wp.array(x, dtype=dtype), p, out])
    assert np.abs(out.numpy() * np.longdouble(x) ** numpy(p) - 1.0).max() <= (p + 4.0) * np.finfo(numpy).eps


@functools.cache
def _make_moved(space):
    real, vec, mat, moved = space.real, space.vec, space.mat, moved_surface(space)

    @wp.kernel(module="unique", enable_backward=False)
    def move(s: wp.array(dtype=vec), F: wp.array(dtype=mat), F_new: wp.array(dtype=mat)):
        a = wp.tid()
        s[a] = moved(s[a], F[a], F_new[a], real(1.0))

    return move


@pytest.mark.parametrize("space", SPACES, ids=repr)
def test_area_vectors_move_by_nansons_rule(space):
    F = matrices(space)
    F_new = F[::-1].copy()
    s = np.random.default_rng(0).normal(size=F.shape[:2]).astype(space.numpy)
    device = [wp.array(s, dtype=space.vec)]
    device += [wp.array(f, dtype=space.mat) for f in (F, F_new)]
    wp.launch(_make_moved(space), len(F), device)
    G = F_new.astype(float) @ np.linalg.inv(F.astype(float))
    exact = np.einsum("a,aji,aj->ai", np.linalg.det(G), np.linalg.inv(G), s)  # cof G = det(G) G⁻ᵀ
    assert np.abs(device[0].numpy() - exact).max() <= 400 * eps(space) * np.abs(exact).max()
