"""Every SPH weight, in every dimension and precision: normalisation, derivative, end values."""

import functools
import math

import numpy as np
import pytest
import warp as wp

from warp_eulsph import Space, Weight
from warp_eulsph.weights.base import pair_weight, value

WEIGHTS = [subclass() for subclass in Weight.__subclasses__()]
SPHERE = {1: 2.0, 2: 2.0 * math.pi, 3: 4.0 * math.pi}  # area of the unit sphere
H = 0.7


@functools.cache
def make_sample(weight, space):
    real = space.real
    value_of, g_of = value(weight, space), pair_weight(weight, space)

    @wp.kernel(module="unique", enable_backward=False)
    def sample(r: wp.array(dtype=real), h: real, W: wp.array(dtype=real), g: wp.array(dtype=real)):
        i = wp.tid()
        W[i] = value_of(r[i], h)
        g[i] = g_of(r[i], h)

    return sample


def sample(weight, space, r):
    """W(r) and g(r) of the library, as float64."""
    points = wp.array(np.asarray(r), dtype=space.real)
    W, g = wp.zeros_like(points), wp.zeros_like(points)
    wp.launch(make_sample(weight, space), len(points), [points, H, W, g])
    return W.numpy().astype(float), g.numpy().astype(float)


@pytest.mark.parametrize("real", [wp.float32, wp.float64], ids=["f32", "f64"])
@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("weight", WEIGHTS, ids=repr)
def test_weight(weight, dim, real):
    space = Space(dim, real)
    reach = weight.support * H
    precision = 1e-5 if real is wp.float32 else 1e-11

    # Gauss points in pieces of q = 1/2: every profile is one polynomial in each, so that the integral is exact
    nodes, gauss = np.polynomial.legendre.leggauss(8)
    pieces = np.arange(0.0, weight.support, 0.5)
    r = ((pieces[:, None] + 0.25 * (nodes + 1.0)) * H).ravel()
    W, g = sample(weight, space, r)
    shell = SPHERE[dim] * r ** (dim - 1) * np.tile(gauss, len(pieces)) * 0.25 * H
    assert (W * shell).sum() == pytest.approx(1.0, abs=precision)
    # K of the full space is the identity: ∫ g ξ⊗ξ = I
    assert (g * r**2 * shell).sum() / dim == pytest.approx(1.0, abs=precision)
    assert (W > 0.0).all()
    assert (g > 0.0).all()

    ends, slopes = sample(weight, space, [0.0, reach * 1.0000001, 2.0 * reach])
    assert np.isfinite(ends).all()
    assert np.isfinite(slopes).all()
    assert ends[0] > 0.0
    assert ends[1] == ends[2] == slopes[1] == slopes[2] == 0.0
    # continuous at the support: below it by 1e-6 the weight is of order (1e-6)³ or less
    assert abs(sample(weight, space, [reach * (1.0 - 1e-6)])[0][0]) < 1e-10 * ends[0] / H


@pytest.mark.parametrize("weight", WEIGHTS, ids=repr)
def test_pair_weight_is_minus_slope_over_radius(weight):
    space = Space(2)
    step = 1e-5 * H
    r = np.linspace(0.013, 0.987, 61) * weight.support * H
    ahead, behind = sample(weight, space, r + step)[0], sample(weight, space, r - step)[0]
    # central differences: truncation 1e-10, rounding 1e-16/1e-5
    slope = -(ahead - behind) / (2.0 * step) / r
    _, g = sample(weight, space, r)
    assert np.abs(slope - g).max() < 1e-6 * g.max()
    # and its limit at r = 0, where the quotient is 0/0: g is Lipschitz there
    near, at_zero = sample(weight, space, [1e-7, 0.0])[1]
    assert near == pytest.approx(at_zero, rel=1e-6)


def test_weights_of_one_kind_are_equal():
    assert len(WEIGHTS) >= 6
    assert all(type(weight)() == weight and hash(type(weight)()) == hash(weight) for weight in WEIGHTS)
    assert len(set(WEIGHTS)) == len(WEIGHTS)
