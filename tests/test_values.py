"""Corrected values, interpolation, the paper's average and the second derivative, against plain numpy sums."""

import numpy as np
import pytest
import warp as wp
from clouds import cloud, configuration_of, cubic, dense_N

from warp_eulsph import Space
from warp_eulsph.fields import allocate
from warp_eulsph.operators.second_derivative import make_second_derivative
from warp_eulsph.operators.values import Linear, Shepard
from warp_eulsph.scheme.smoothing import NeighbourAverage

SIDE = {1: 12, 2: 7, 3: 5}
DIMS = [1, 2, 3]
VALUES = [Shepard(), Linear()]


def jittered(dim, varied=True):
    """Configuration with unequal volumes and smoothing lengths, and its numpy counterparts."""
    x, volume = cloud(dim, SIDE[dim])
    rng = np.random.default_rng(5)
    h = 1.4 / SIDE[dim] * np.ones(len(x))
    if varied:
        volume = volume * rng.uniform(0.8, 1.2, len(x))
        h = h * rng.uniform(0.9, 1.1, len(x))
    return configuration_of(x, volume, h), x, volume, h


def rows(values, real=wp.float64):
    values = np.asarray(values, dtype=float)
    space = Space(1, real)
    return wp.array(values, dtype=space.row(values.shape[1]))


def run(function, f):
    out = wp.zeros_like(f)
    function(f, out)
    return out.numpy().copy()


@pytest.mark.parametrize("values", VALUES, ids=repr)
@pytest.mark.parametrize("dim", DIMS)
def test_interpolation_and_transpose(dim, values):
    configuration, x, volume, h = jittered(dim)
    interpolation = configuration.interpolation(values)
    N = dense_N(x, volume, h, values.linear)
    f = np.random.default_rng(2).normal(size=(len(x), 2))
    scale = np.abs(N).sum(axis=1).max()  # cancellation of linear values near corners
    assert np.abs(run(interpolation.apply, rows(f)) - N @ f).max() < 1e-12 * scale
    assert np.abs(run(interpolation.transpose, rows(f)) - N.T @ f).max() < 1e-12 * scale
    field = np.stack([np.full(len(x), 3.0), x @ np.arange(1.0, dim + 1) if values.linear else np.full(len(x), -1.0)], 1)
    assert np.abs(run(interpolation.apply, rows(field)) - field).max() < 1e-12


@pytest.mark.parametrize("values", VALUES, ids=repr)
@pytest.mark.parametrize("dim", DIMS)
def test_average_is_the_papers(dim, values):
    configuration, x, volume, h = jittered(dim)
    N = dense_N(x, volume, h, values.linear)
    own = np.diag(N)
    f = np.random.default_rng(3).normal(size=(len(x), 2))
    expected = (N @ f - own[:, None] * f) / (1.0 - own[:, None])  # as printed in §4.2
    kept = 1.0 - own < 0.02
    expected[kept] = f[kept]

    def average(f, out):
        NeighbourAverage(values).apply(configuration.space, configuration, f, f, out)

    assert np.abs(run(average, rows(f)) - expected).max() < 1e-11
    linear = np.stack([x @ np.arange(1.0, dim + 1), np.ones(len(x))], 1)
    error = np.abs(run(average, rows(linear)) - linear).max(axis=0)
    assert error[1] < 1e-12
    if values.linear:
        assert error[0] < 1e-12
    else:
        assert error[0] > 1e-2  # Shepard values average one-sidedly at the edges


def test_average_keeps_the_value_of_a_particle_with_one_sided_neighbours():
    configuration = configuration_of(np.array([[0.0], [1.0], [2.0], [9.0]]), np.ones(4), 1.0)
    f = np.array([[1.0], [5.0], [4.0], [7.0]]) * np.ones(2)
    out = run(configuration.interpolation(Linear()).average, rows(f))
    # ends: the neighbour's share of linear values is zero; middle: the mean of both sides; alone: itself
    assert np.abs(out[:, 0] - [1.0, 2.5, 4.0, 7.0]).max() < 1e-14
    shepard = run(configuration.interpolation(Shepard()).average, rows(f))
    assert np.abs(shepard[:, 0] - [5.0, 2.5, 5.0, 7.0]).max() < 1e-14


def second_derivative(configuration, f):
    space, n, components = configuration.space, len(f), f.shape[1]
    field = rows(f, space.real)
    gradient = wp.zeros(n, dtype=space.row_gradient(components))
    out = wp.zeros_like(field)
    structs = [configuration.fields, configuration.near]
    configuration.gradient(field, gradient)
    wp.launch(make_second_derivative(space, components), n, [0, *structs, field, gradient, out])
    return out.numpy().copy(), gradient.numpy().reshape(n, components, space.dim).copy()


@pytest.mark.parametrize("dim", DIMS)
def test_second_derivative(dim):
    configuration, x, volume, h = jittered(dim)
    f = np.random.default_rng(4).normal(size=(len(x), 2))
    found, gradient = second_derivative(configuration, f)
    xi = x[None] - x[:, None]
    r = np.linalg.norm(xi, axis=-1) + np.eye(len(x))
    H = 0.5 * (h[:, None] + h[None])
    e = 1e-6 * H
    g = -(cubic(r + e, H, dim) - cubic(r - e, H, dim)) / (2 * e) / r * (1.0 - np.eye(len(x)))
    jump = f[None] - f[:, None] - np.einsum("aci,abi->abc", gradient, xi)
    trace = np.einsum("ab,abi,abi->a", g * volume, xi, xi)
    expected = 2.0 * dim * np.einsum("ab,abc->ac", g * volume, jump) / trace[:, None]
    assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()  # g by central differences
    slope = np.arange(1.0, dim + 1)
    flat, _ = second_derivative(configuration, np.stack([x @ slope, np.ones(len(x))], 1))
    assert np.abs(flat).max() < 1e-12 * SIDE[dim] ** 2 * slope.sum()


@pytest.mark.parametrize("dim", DIMS)
def test_second_derivative_of_lattice_fields(dim):
    side = {1: 8, 2: 6, 3: 6}[dim]
    x, volume = cloud(dim, side, jitter=0.0)
    periodic = configuration_of(x, volume, 1.0 / side, box=(1.0,) * dim)
    ticks = np.rint(x * side - 0.5)
    for axes in range(1, dim + 1):
        saw_tooth = ((-1.0) ** ticks[:, :axes].sum(axis=1))[:, None] * [1.0, -2.0]
        found, gradient = second_derivative(periodic, saw_tooth)
        assert np.abs(gradient).max() < 1e-10  # the gradient does not see it
        if dim == 1:
            assert np.abs(found + 4.0 * side**2 * saw_tooth).max() < 1e-9  # (f₊ + f₋ − 2f)/dx²
        else:
            assert (found * saw_tooth < -(side**2)).all()
    # the Laplacian of a quadratic field, inside a bounded lattice
    bounded = configuration_of(x, volume, 1.0 / side)
    found, _ = second_derivative(bounded, np.stack([x**2 @ np.arange(1.0, dim + 1), np.ones(len(x))], 1))
    inside = ((ticks >= 2) & (ticks <= side - 3)).all(axis=1)
    assert inside.any()
    assert np.abs(found[inside, 0] - dim * (dim + 1)).max() < 1e-9


def test_single_precision():
    x, volume = cloud(2, 6)
    configuration = configuration_of(x, volume, 1.4 / 6, real=wp.float32)
    field = (x @ [1.0, 2.0])[:, None] * [1.0, 0.5]
    out = run(configuration.interpolation(Linear()).average, rows(field, wp.float32))
    assert np.abs(out - field).max() < 2e-6
    assert np.abs(second_derivative(configuration, field)[0]).max() < 1e-6 * 36 * 3 * 4


def test_interpolation_follows_the_reference():
    configuration, x, volume, h = jittered(2)
    interpolation = configuration.interpolation(Linear())
    assert configuration.interpolation(Linear()) is interpolation
    moved = x @ np.array([[1.05, 0.1], [0.0, 0.95]])
    state = allocate(configuration.space, "State", len(x), wp.get_device())
    state.x.assign(moved)
    state.F.assign(np.broadcast_to(np.eye(2), (len(x), 2, 2)))
    configuration.refresh(state)
    f = np.random.default_rng(6).normal(size=(len(x), 2))
    assert np.abs(run(interpolation.apply, rows(f)) - dense_N(moved, volume, h, True) @ f).max() < 1e-12


def test_values_must_be_an_object():
    with pytest.raises(ValueError, match=r"values must be Shepard\(\) or Linear\(\)"):
        NeighbourAverage(values="linear")
