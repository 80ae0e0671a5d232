"""Shapes as particles: exact volumes, symmetry, evenness, and errors that name the cause."""

import numpy as np
import pytest

from warp_eulsph.geometry import (
    BodyCentred,
    Lattice,
    Relaxation,
    Staggered,
    annulus,
    box,
    cylinder,
    disc,
    ring,
    sphere,
    tube,
)

FILLINGS = [Lattice(), BodyCentred(), Staggered()]
# shape -> (arguments, exact volume, centre)
SHAPES = {
    disc: (((1.0, 2.0), 1.0), np.pi, (1.0, 2.0)),
    ring: (((0.0, -1.0), 0.5, 1.0), 0.75 * np.pi, (0.0, -1.0)),
    sphere: (((1.0, 2.0, 3.0), 1.0), 4.0 / 3.0 * np.pi, (1.0, 2.0, 3.0)),
    cylinder: (((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), 0.8), 1.28 * np.pi, (0.0, 0.0, 0.0)),
    tube: (((0.0, 0.0, 0.0), (1.0, 2.0, 2.0), 0.5, 1.0), 2.25 * np.pi, (0.5, 1.0, 1.0)),
}


def nearest(x):
    """Distance from each particle to its nearest neighbour, (n,)."""
    from scipy.spatial import cKDTree

    return cKDTree(x).query(x, 2)[0][:, 1]


def depth(shape, arguments, x):
    """How deep points lie in a shape, written down a second time; negative outside."""
    if shape in (cylinder, tube):
        start, end = np.array(arguments[0]), np.array(arguments[1])
        length, axis = np.linalg.norm(end - start), (end - start) / np.linalg.norm(end - start)
        along = (x - start) @ axis
        r = np.linalg.norm(x - start - along[:, None] * axis, axis=1)
        ends, radii = np.minimum(along, length - along), arguments[2:]
    else:
        r, ends, radii = np.linalg.norm(x - arguments[0], axis=1), np.inf, arguments[1:]
    inner = r - radii[0] if len(radii) == 2 else np.inf
    return np.minimum(np.minimum(radii[-1] - r, inner), ends)


@pytest.mark.parametrize("filling", FILLINGS, ids=lambda f: type(f).__name__)
@pytest.mark.parametrize("shape", SHAPES, ids=lambda f: f.__name__)
@pytest.mark.parametrize("relaxation", [None, Relaxation(sweeps=40)], ids=["cut", "relaxed"])
def test_shapes_hold_their_volume(shape, filling, relaxation):
    arguments, exact, centre = SHAPES[shape]
    spacing = 0.12
    x, volume = shape(*arguments, spacing, filling=filling, relaxation=relaxation)
    assert x.shape == (len(volume), len(centre))
    assert volume.sum() == pytest.approx(exact, rel=1e-13)
    assert np.ptp(volume) == 0.0
    # The number of particles is that of the spacing, but for what a cut takes or leaves at surfaces 4 spacings apart.
    assert len(x) == pytest.approx(exact / spacing ** x.shape[1], rel=0.12)
    assert depth(shape, arguments, x).min() > (0.0 if relaxation is None else 0.2 * spacing)
    # Lattices are symmetric about their centre, close packing in 3-D about an axis only.
    tolerance = 0.1 * spacing if isinstance(filling, Staggered) and x.shape[1] == 3 else 1e-12
    np.testing.assert_allclose(x.mean(axis=0), centre, rtol=0, atol=tolerance)
    assert nearest(x).min() > 0.8 * spacing


@pytest.mark.parametrize("filling", FILLINGS, ids=lambda f: type(f).__name__)
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_boxes_of_every_filling_are_full_and_symmetric(filling, dim):
    lower, upper = np.array([-1.0, 0.5, 2.0])[:dim], np.array([1.0, 1.55, 2.6])[:dim]
    x, volume = box(lower, upper, 0.1, filling=filling)
    assert len(x) * volume == pytest.approx(np.prod(upper - lower), rel=1e-13)
    assert volume == pytest.approx(0.1**dim, rel=0.2)  # whole cells in a short box
    np.testing.assert_allclose(x.mean(axis=0), (lower + upper) / 2, rtol=0, atol=1e-13)
    distances = nearest(x)
    # Next neighbours of close packing are farther apart at the same volume: 2^(1/6), of bcc 3^(1/2) 2^(-2/3).
    closest = {
        (BodyCentred, 3): 3.0**0.5 / 2.0 ** (2.0 / 3.0),
        (Staggered, 2): (2.0 / 3.0**0.5) ** 0.5,
        (Staggered, 3): 2.0 ** (1.0 / 6.0),
    }.get((type(filling), dim), 1.0)
    assert distances.mean() == pytest.approx(closest * volume ** (1.0 / dim), rel=0.08)


@pytest.mark.parametrize("filling", [Lattice(), BodyCentred()], ids=lambda f: type(f).__name__)
def test_disc_is_its_own_image(filling):
    """Turned by half a turn the particles fall on each other; on the square lattice mirrored too."""
    from scipy.spatial import cKDTree

    x, _ = disc((0.0, 0.0), 1.0, 0.13, filling=filling)
    images = [-x, x * [-1.0, 1.0], x[:, ::-1]] if isinstance(filling, Lattice) else [-x]
    for image in images:
        assert cKDTree(x).query(image)[0].max() < 1e-13


def test_relaxed_disc_fits_its_rim_and_is_even():
    """A cut lattice leaves steps at the rim; relaxed particles lie half a spacing beneath it, all round."""
    spacing = 0.1
    cut, _ = disc((0.0, 0.0), 1.0, spacing)
    relaxed, _ = disc((0.0, 0.0), 1.0, spacing, relaxation=Relaxation())
    rims = []
    for x in (cut, relaxed):
        sectors = ((np.arctan2(x[:, 1], x[:, 0]) + np.pi) / (2.0 * np.pi) * 40).astype(int).clip(0, 39)
        rims.append(np.array([1.0 - np.linalg.norm(x[sectors == k], axis=1).max() for k in range(40)]))
    assert np.ptp(rims[0]) > 0.7 * spacing
    assert np.ptp(rims[1]) < 0.3 * spacing and rims[1].mean() == pytest.approx(0.5 * spacing, rel=0.15)
    assert nearest(relaxed).min() > 0.85 * spacing
    again, _ = disc((0.0, 0.0), 1.0, spacing, relaxation=Relaxation())
    np.testing.assert_array_equal(relaxed, again)


def test_annulus_is_whole_graded_and_staggered():
    x, volume = annulus((1.0, 2.0), 0.75, 1.25, 9)
    radii, places = np.unique(np.round(np.linalg.norm(x - [1.0, 2.0], axis=1), 9), return_inverse=True)
    assert len(radii) == 9 and volume.sum() == pytest.approx(np.pi, rel=1e-13)
    np.testing.assert_allclose(radii[1:] / radii[:-1], (1.25 / 0.75) ** (1 / 9), rtol=1e-8)
    # As wide as they are high: cells of a size that follows the radius.
    np.testing.assert_allclose(np.sqrt(volume), 0.0568 * radii[places], rtol=0.01)
    assert nearest(x).min() > 0.95 * np.sqrt(volume.min())
    # Half a cell farther round on every other circle
    angles = [np.sort(np.arctan2(*(x[places == k] - [1.0, 2.0]).T[::-1]) % (2.0 * np.pi))[0] for k in range(9)]
    np.testing.assert_allclose(angles[1::2], np.pi / (len(x) / 9), rtol=1e-9)
    for arguments, message in (
        (((0.0, 0.0), 1.0, 0.5, 9), "annulus: inner must be below outer"),
        (((0.0, 0.0), 0.5, np.inf, 9), "annulus: outer must be positive and finite"),
        (((0.0, 0.0), 0.5, 1.0, 1), "annulus: rings must be at least 2, got 1"),
    ):
        with pytest.raises(ValueError, match=message):
            annulus(*arguments)


def test_cylinder_has_flat_ends_along_any_axis():
    x, _ = cylinder((0.0, 0.0, 0.0), (1.05, 0.0, 0.0), 0.5, 0.1)
    assert x[:, 0].min() == pytest.approx(1.05 / 20) and x[:, 0].max() == pytest.approx(1.05 - 1.05 / 20)
    assert len(np.unique(np.round(x[:, 0], 9))) == 10


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: disc((0.0, 0.0), 1.0, 1.1), "too coarse, the thinnest part is 2 m"),
        (lambda: disc((0.0, 0.0), -1.0, 0.1), "disc: radius must be positive and finite, got -1.0"),
        (lambda: disc((0.0, 0.0, 0.0), 1.0, 0.1), "disc: points must be 2 finite numbers"),
        (lambda: ring((0.0, 0.0), 1.0, 0.5, 0.1), "ring: inner must be below outer, got 1.0 and 0.5"),
        (lambda: ring((0.0, 0.0), 0.9, 1.0, 0.1), "ring: a spacing of 0.1 m is too coarse, the thinnest part is 0.1"),
        (lambda: sphere((0.0, 0.0, 0.0), 1.0, np.nan), "sphere: spacing must be positive and finite, got nan"),
        (lambda: cylinder((0.0,) * 3, (0.0,) * 3, 1.0, 0.1), "cylinder: distance from start to end must be positive"),
        (lambda: tube((0.0,) * 3, (0.0, 0.0, 0.1), 0.5, 1.0, 0.1), "tube: a spacing of 0.1 m is too coarse"),
        (lambda: box((0.0,) * 3, (1.0,) * 3, 1e-4), "at most 2147483647 particles, got 1e"),
        (lambda: Relaxation(sweeps=0), r"sweeps must be in \[1, 10000\]"),
        (lambda: Relaxation(gain=0.5), r"gain must be in \(0, 0.2\]"),
    ],
)
def test_errors_name_the_cause(call, message):
    with pytest.raises(ValueError, match=message):
        call()
