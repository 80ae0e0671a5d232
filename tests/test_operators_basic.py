"""Identities of the operators on jittered clouds with edges and corners, and neighbour lists against a k-d tree."""

import numpy as np
import pytest
import warp as wp
from clouds import cloud, configuration_of
from scipy.spatial import cKDTree

from warp_eulsph import CubicSpline, Space, execution
from warp_eulsph.operators.neighbours import NeighbourLists
from warp_eulsph.operators.slices import places_taken
from warp_eulsph.operators.smoothing import make_linear_exact

CASES = [
    pytest.param(dim, real, 1e-12 if real is wp.float64 else 2e-4, id=f"{dim}-{real.__name__}")
    for dim in (1, 2, 3)
    for real in (wp.float64, wp.float32)
]
# float32: differences of positions of order 1 at distances of 0.1 keep 1e-6, and L amplifies that at corners.


def jittered(dim, real):
    """A configuration of different volumes and smoothing lengths on a jittered cloud, and its positions and volumes."""
    side = {1: 20, 2: 8, 3: 6}[dim]
    x, volume = cloud(dim, side)
    rng = np.random.default_rng(5)
    volume = volume * rng.uniform(0.8, 1.2, len(x))
    configuration = configuration_of(x, volume, 1.5 / side * rng.uniform(0.9, 1.1, len(x)), real=real)
    assert not configuration.poor.numpy().any()
    return configuration, configuration.fields.x.numpy().astype(float), configuration.fields.V.numpy().astype(float)


def rows_of(values, configuration):
    kind = configuration.space.row(values.shape[1])
    return wp.array(values.astype(configuration.space.numpy), dtype=kind)


def gradient(configuration, f):
    """∇f by M4: (n, c) -> (n, c, dim)."""
    space, (n, components) = configuration.space, f.shape
    out = wp.zeros(n, dtype=space.row_gradient(components))
    configuration.gradient(rows_of(f, configuration), out)
    return out.numpy().astype(float)


def divergence(configuration, Q):
    """T by M5: (n, dim, dim) -> (n, dim)."""
    space, n = configuration.space, len(Q)
    L = configuration.fields.L.numpy().astype(float)
    Pi = wp.array((Q @ L).astype(space.numpy), dtype=space.mat)
    out = wp.zeros(n, dtype=space.vec)
    configuration.divergence(Pi, out)
    return -out.numpy().astype(float)


def smooth(configuration, theta, f):
    """S(f) by M7: (n, c) -> (n, c)."""
    space, (n, components) = configuration.space, f.shape
    slopes = wp.array(gradient(configuration, f).astype(space.numpy), dtype=space.row_gradient(components))
    values = rows_of(f, configuration)
    out = wp.zeros_like(values)
    arguments = [configuration.particles, configuration.fields, configuration.near, theta, values, slopes, out]
    wp.launch(make_linear_exact(space, components), n, [0, *arguments])
    return out.numpy().astype(float)


def pairs_of(near):
    """The directed pairs (a, b), in the order of the rows."""
    start, stop, index = near.start.numpy(), near.stop.numpy(), near.index.numpy()
    return [(a, int(b)) for a in range(len(stop)) for b in index[start[a] : stop[a] : near.stride]]


# the operators


@pytest.mark.parametrize(("dim", "real", "tolerance"), CASES)
def test_correction_matches_a_brute_force_sum(dim, real, tolerance):
    """M3 with the gradient of the cubic spline written out: W' = σ/h^(d+1) (−3q + 9/4 q², −3/4 (2 − q)²)."""
    configuration, x, V = jittered(dim, real)
    h = configuration.particles.h.numpy().astype(float)
    sigma = [2 / 3, 10 / (7 * np.pi), 1 / np.pi][dim - 1]
    K = np.zeros((len(x), dim, dim))
    for a in range(len(x)):
        for b in range(len(x)):
            r, h_ab = np.linalg.norm(x[a] - x[b]), 0.5 * (h[a] + h[b])
            q = r / h_ab
            if 0 < q < 2:
                slope = -3 * q + 2.25 * q**2 if q < 1 else -0.75 * (2 - q) ** 2
                grad_W = sigma / h_ab ** (dim + 1) * slope * (x[a] - x[b]) / r
                K[a] -= V[b] * np.outer(grad_W, x[a] - x[b])
    np.testing.assert_allclose(configuration.K.numpy(), K, atol=tolerance)
    np.testing.assert_allclose(
        configuration.fields.L.numpy() @ K, np.broadcast_to(np.eye(dim), K.shape), atol=tolerance
    )


@pytest.mark.parametrize(("dim", "real", "tolerance"), CASES)
def test_gradient_is_exact_for_linear_fields(dim, real, tolerance):
    configuration, x, _ = jittered(dim, real)
    slope = np.random.default_rng(6).normal(size=(2, dim))
    np.testing.assert_allclose(
        gradient(configuration, 3.0 + x @ slope.T), np.broadcast_to(slope, (len(x), 2, dim)), atol=tolerance
    )
    bent = gradient(configuration, (x @ slope.T) ** 2)
    assert np.abs(bent - 2 * (x @ slope.T)[:, :, None] * slope).max() > 1e-3  # not exact for quadratic ones


@pytest.mark.parametrize(("dim", "real", "tolerance"), CASES)
def test_divergence_is_the_adjoint_of_the_gradient(dim, real, tolerance):
    """Σ v·T = Σ V Q:∇v (M5), for any v and Q."""
    configuration, x, V = jittered(dim, real)
    rng = np.random.default_rng(7)
    v, Q = rng.normal(size=x.shape), rng.normal(size=(len(x), dim, dim))
    powers = V * np.einsum("aij,aij->a", Q, gradient(configuration, v))
    work = (v * divergence(configuration, Q)).sum()
    assert abs(work - powers.sum()) <= tolerance * np.abs(powers).sum()


@pytest.mark.parametrize(("dim", "real", "tolerance"), CASES)
def test_forces_and_torques_sum_to_zero(dim, real, tolerance):
    configuration, x, _ = jittered(dim, real)
    Q = np.random.default_rng(8).normal(size=(len(x), dim, dim))
    T = divergence(configuration, Q + Q.swapaxes(1, 2))
    assert np.abs(T.sum(axis=0)).max() <= 1e-2 * tolerance * np.abs(T).sum()
    moments = np.einsum("ai,aj->ij", x, T)
    assert np.abs(moments - moments.T).max() <= tolerance * np.abs(T).sum()
    if dim > 1:
        skew = divergence(configuration, Q)
        moments = np.einsum("ai,aj->ij", x, skew)
        assert np.abs(moments - moments.T).max() > 1e-3 * np.abs(skew).sum()  # an unsymmetric stress turns the body


@pytest.mark.parametrize(("dim", "real", "tolerance"), CASES)
def test_smoothing_keeps_linear_fields_and_sums(dim, real, tolerance):
    configuration, x, _ = jittered(dim, real)
    rng = np.random.default_rng(9)
    linear = 3.0 + x @ rng.normal(size=(2, dim)).T
    np.testing.assert_allclose(smooth(configuration, 0.5, linear), linear, atol=tolerance)
    rough, mass = rng.normal(size=(len(x), 2)), configuration.particles.mass.numpy()[:, None]
    for theta in (0.25, 0.5):
        smoothed = smooth(configuration, theta, rough)
        assert np.abs((mass * (smoothed - rough)).sum(axis=0)).max() <= tolerance * (mass * np.abs(rough)).sum()
        assert np.abs(smoothed - rough).max() > 0.1 * theta
    assert np.array_equal(smooth(configuration, 0.0, rough), rough.astype(configuration.space.numpy))


# neighbours


def lists_of(x, h, body=None, box=None, real=wp.float64, weight=CubicSpline()):
    """Neighbour lists of a cloud, built."""
    (n, dim), device = x.shape, wp.get_device()
    space = Space(dim, real, box is not None)
    lengths = wp.array(np.broadcast_to(h, n).astype(space.numpy), dtype=real)
    bodies = wp.array(np.zeros(n) if body is None else body, dtype=wp.int32)
    lists = NeighbourLists(space, weight, lengths, bodies, (0.0,) * dim if box is None else box, device)
    lists.build(wp.array(x.astype(space.numpy), dtype=space.vec))
    return lists


def tree_pairs(x, radius, box=None):
    """All ordered pairs closer than ``radius``, sorted."""
    wrapped = x if box is None else x % np.where(np.array(box) > 0, box, np.inf)
    tree = cKDTree(wrapped, boxsize=None if box is None else box)
    pairs = tree.query_pairs(radius)
    return sorted(pairs | {(b, a) for a, b in pairs})


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("real", [wp.float64, wp.float32])
def test_neighbours_equal_a_tree(dim, real):
    x = (cloud(dim, {1: 40, 2: 14, 3: 7}[dim], jitter=0.45)[0] - 0.3).astype(Space(dim, real).numpy).astype(float)
    h = 1.4 / {1: 40, 2: 14, 3: 7}[dim]
    lists = lists_of(x, h, real=real)
    found = pairs_of(lists.rows)
    assert found == tree_pairs(x, 2.0 * h)  # equality of lists: rows in order, each sorted, none twice
    assert lists.pairs == len(found)


def test_rows_in_slices_lie_interleaved():
    """Neighbour j of the 32 rows of a slice side by side, as the threads of a GPU read them; the lists are the same."""
    execution.set_simd(False)
    x = cloud(2, 13, jitter=0.4)[0]  # 169 rows: five slices, and nine rows in the sixth
    lists = lists_of(x, 0.1)
    start, stop, lengths = lists.rows.start.numpy(), lists.rows.stop.numpy(), lists.lengths
    assert lists.rows.stride == 32
    assert pairs_of(lists.rows) == tree_pairs(x, 0.2)
    assert lists.pairs == lengths.sum() < lists.room == lists.capacity == places_taken(lengths) == start[-1]
    for k in range(0, len(x), 32):
        rows = slice(k, min(k + 32, len(x)))
        assert np.array_equal(start[rows] - start[k], np.arange(rows.stop - k))
        assert start[min(k + 32, len(x))] == start[k] + 32 * lengths[rows].max()
    places = np.concatenate([np.arange(*span, 32) for span in zip(start[:-1], stop, strict=True)])
    assert len(set(places)) == lists.pairs  # no two pairs at one place


def test_rows_are_the_same_whether_they_were_kept_or_not():
    """Kept when they were counted, or searched for again where one is too long for that, in lists that grow or not."""
    execution.set_simd(False)
    x = cloud(2, 13, jitter=0.4)[0]
    crowd, rng = 3.0 * x, np.random.default_rng(12)
    crowd[:60] = rng.uniform(0.0, 0.01, (60, 2))
    lists, kept, grown = lists_of(x, 0.1, real=wp.float32), [], []
    for places in (x, x, crowd, 0.6 * x, 0.6 * x):
        there = lists.capacity
        positions = wp.array(places, dtype=lists.space.vec)
        lists.count_neighbours(positions)
        lists.sum_counts()
        lists.make_room()
        lists.fill(positions)
        assert pairs_of(lists.rows) == tree_pairs(positions.numpy().astype(float), 0.2)
        kept.append(bool(lists.grid.room >= lists.lengths.max()))
        grown.append(lists.capacity > there)
    assert kept == [False, True, False, False, True]
    assert grown == [True, False, False, True, False]


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("open_axis", [False, True])
def test_neighbours_in_a_periodic_box(dim, open_axis):
    side = {1: 40, 2: 14, 3: 7}[dim]
    x = cloud(dim, side, jitter=0.45)[0] * 1.3 + 5.0 * np.eye(dim)[0]  # outside of the box, wrapped into it
    box = np.full(dim, 1.3)
    if open_axis:
        box[-1] = 0.0
        x[:, -1] -= 5.0 * (dim == 1)
    h = 1.4 * 1.3 / side if dim < 3 else 1.05 * 1.3 / side
    assert pairs_of(lists_of(x, h, box=tuple(box)).rows) == tree_pairs(x, 2.0 * h, box)


@pytest.mark.parametrize("dim", [2, 3])
def test_neighbours_of_bodies_and_different_lengths(dim):
    """Only particles of one body, closer than support (h_a + h_b)/2; the bodies overlap in space."""
    side = {2: 14, 3: 7}[dim]
    x = cloud(dim, side, jitter=0.45)[0]
    rng = np.random.default_rng(11)
    h, body = rng.uniform(0.5, 3.0, len(x)) / side, rng.integers(0, 3, len(x))
    distance = np.linalg.norm(x[:, None] - x, axis=-1)
    close = (distance < h[:, None] + h) & (body[:, None] == body) & ~np.eye(len(x), dtype=bool)
    assert pairs_of(lists_of(x, h, body).rows) == [tuple(pair) for pair in np.argwhere(close).tolist()]


def test_lists_grow_when_the_cloud_is_compressed():
    x = cloud(2, 12)[0]
    lists = lists_of(x, 1.3 / 12)
    capacity = lists.capacity
    for scale in (0.5, 1.0):
        lists.build(wp.array(x * scale, dtype=wp.vec2d))
        assert pairs_of(lists.rows) == tree_pairs(x * scale, 2.6 / 12)
    assert lists.capacity > 2 * capacity


def test_a_box_smaller_than_the_support_is_refused():
    with pytest.raises(ValueError, match=r"box length along axis 1 must be at least twice the support radius.*enlarge"):
        lists_of(cloud(2, 4)[0], 0.3, box=(2.0, 0.5))


# poor neighbourhoods

POOR = {
    "alone in 1-D": ([[0.0]], [1]),
    "alone in 2-D": ([[0.0, 0.0]], [2]),
    "two in 2-D": ([[0.0, 0.0], [0.8, 0.6]], [1, 1]),
    "two in 3-D": ([[0.0, 0.0, 0.0], [0.6, 0.0, 0.8]], [2, 2]),
    "collinear in 2-D": ([[0.6 * k, 0.8 * k] for k in range(5)], [1] * 5),
    "coplanar in 3-D": ([[i, 0.6 * j, 0.8 * j] for i in range(4) for j in range(4)], [1] * 16),
    "a line beside a patch": (
        [[i, j] for i in range(3) for j in range(3)] + [[20.0, 0.0], [21.0, 0.0]],
        [0] * 9 + [1, 1],
    ),
}


@pytest.mark.parametrize(("x", "lacking"), POOR.values(), ids=POOR.keys())
def test_poor_neighbourhoods_fall_back(x, lacking):
    """The gradient keeps the directions that the neighbours span and is zero in the others; the particle is counted."""
    x = np.array(x)
    n, dim = x.shape
    configuration = configuration_of(x, np.ones(n), 1.3)
    assert configuration.poor.numpy().tolist() == lacking
    slope = np.arange(1.0, dim + 1.0)
    found = gradient(configuration, (x @ slope)[:, None])[:, 0]
    distance = np.linalg.norm(x[:, None] - x, axis=-1)
    for a in range(n):
        near = x[(distance[a] < 2.6)] - x[a]
        span = np.linalg.pinv(near) @ near  # projection on the directions to the neighbours
        np.testing.assert_allclose(found[a], span @ slope, atol=1e-12)
    assert np.isfinite(divergence(configuration, np.ones((n, dim, dim)))).all()
