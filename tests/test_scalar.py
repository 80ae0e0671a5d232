"""Scalar conservation laws: exact shifts, orders of accuracy, held values, nonlinear flux, several dimensions."""

import math

import numpy as np
import pytest
import warp as wp
from clouds import cloud

from warp_eulsph.operators.values import Linear
from warp_eulsph.scheme.scalar import ConservationLaw, LinearAdvection, OneStepLax, TwoStepLaxWendroff
from warp_eulsph.scheme.smoothing import LinearExact, NeighbourAverage
from warp_eulsph.space import vector_type

vec1 = vector_type(1, wp.float64)


@wp.func
def burgers(U: wp.float64) -> vec1:
    return vec1(wp.float64(0.5) * U * U)


def gaussian(x):
    """On the unit circle, about 1/2."""
    return np.exp(-(((x - 0.5 + 0.5) % 1.0 - 0.5) ** 2) / (2.0 * 0.07**2))


def advected(scheme, n, cfl, dilation=1.0, turns=1.0, initial=gaussian):
    x = (np.arange(n) + 0.5)[:, None] / n
    law = ConservationLaw(
        x, 1.0 / n, initial(x[:, 0]), flux=LinearAdvection((1.0,)), scheme=scheme, dilation=dilation, periodic=(1.0,)
    )
    law.run(turns, cfl / n)
    return law.values, initial(x[:, 0] - turns)


@pytest.mark.parametrize(
    ("scheme", "cfl"), [(OneStepLax(), 1.0), (TwoStepLaxWendroff(), 2.0), (TwoStepLaxWendroff(), 0.5)]
)
def test_three_particles_at_the_limit_shift_exactly(scheme, cfl):
    step = lambda x: np.where((x % 1.0 > 0.3) & (x % 1.0 < 0.6), 1.0, 0.0)  # noqa: E731
    found, exact = advected(scheme, 20, cfl, initial=step)
    error = np.abs(found - exact).max()
    if cfl == 0.5:
        assert error > 0.1
    else:
        assert error < 1e-13


@pytest.mark.parametrize(
    ("scheme", "dilation", "low", "high"),
    [
        (OneStepLax(), 1.0, 0.75, 1.05),
        (TwoStepLaxWendroff(), 1.0, 1.95, 2.02),
        (TwoStepLaxWendroff(), 1.5, 1.95, 2.02),
        (TwoStepLaxWendroff(LinearExact()), 1.3, 1.95, 2.02),
    ],
    ids=["lax", "lax-wendroff 1.0", "lax-wendroff 1.5", "linear-exact"],
)
def test_order_on_smooth_data(scheme, dilation, low, high):
    errors = []
    for n in (80, 160, 320):
        found, exact = advected(scheme, n, 0.5, dilation, turns=0.25)
        errors.append(math.sqrt(((found - exact) ** 2).mean()))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert low < orders[-1] < high, orders


def test_held_inflow_and_time_hit_exactly():
    n = 40
    x = (np.arange(n) + 0.5)[:, None] / n
    law = ConservationLaw(
        x, 1.0 / n, np.where(x[:, 0] < 2.0 / n, 1.0, 0.0), flux=LinearAdvection((1.0,)), dilation=1.0,
        scheme=TwoStepLaxWendroff(NeighbourAverage(Linear())), held=lambda X: X[:, 0] < 2.0 / n,
    )  # fmt: skip
    law.run(0.333, 0.5 / n)
    assert law.t == pytest.approx(0.333, abs=1e-15)
    assert (law.values[:2] == 1.0).all()
    # the front has come in by 0.333: mass 0.333 beyond the held particles, up to the scheme's oscillations
    assert law.values[2:].sum() / n == pytest.approx(0.333, abs=0.5 / n)


def test_burgers_against_its_characteristics():
    """U = U0(x − U t) before the shock at t = 1/π."""
    errors = []
    for n in (100, 200):
        x = (np.arange(n) + 0.5)[:, None] / n
        u_0 = 1.0 + 0.5 * np.sin(2.0 * math.pi * x[:, 0])
        law = ConservationLaw(x, 1.0 / n, u_0, flux=burgers, dilation=1.0, periodic=(1.0,))
        law.run(0.15, 0.8 / n)
        exact = u_0.copy()
        for _ in range(200):
            exact = 1.0 + 0.5 * np.sin(2.0 * math.pi * (x[:, 0] - 0.15 * exact))
        errors.append(np.abs(law.values - exact).max())
    assert errors[0] < 0.01
    assert errors[0] / errors[1] > 3.3, errors


@pytest.mark.parametrize("dim", [2, 3])
def test_plane_wave_runs_as_in_one_dimension_and_jitter_keeps_linear_fields(dim):
    side = 8
    x, volume = cloud(dim, side, jitter=0.0)
    wave = np.sin(2.0 * math.pi * x[:, 0])
    along = LinearAdvection((1.0,) + (0.0,) * (dim - 1))
    law = ConservationLaw(x, volume, wave, flux=along, dilation=0.7, periodic=(1.0,) * dim)
    law.run(0.25, 0.125 * 0.5)
    values = law.values.reshape(side, -1)
    assert np.ptp(values, axis=1).max() < 1e-13
    assert np.abs(values).max() < 1.0  # below the stable step

    x, volume = cloud(dim, 5, jitter=0.2)
    slope = np.arange(1.0, dim + 1)
    velocity = tuple(np.arange(2.0, dim + 2))
    linear = ConservationLaw(
        x, volume, x @ slope, flux=LinearAdvection(velocity), scheme=TwoStepLaxWendroff(NeighbourAverage(Linear()))
    )
    linear.step(0.01)
    assert np.abs(linear.values - (x @ slope - 0.01 * slope @ velocity)).max() < 1e-12


def test_errors_name_the_input():
    x = np.linspace(0.0, 1.0, 5)[:, None]
    with pytest.raises(ValueError, match=r"advection velocity must have 1 components"):
        ConservationLaw(x, 0.25, x[:, 0], flux=LinearAdvection((1.0, 2.0)))
    with pytest.raises(ValueError, match=r"initial values must have shape \(5,\), got \(5, 1\)"):
        ConservationLaw(x, 0.25, x, flux=LinearAdvection((1.0,)))
    with pytest.raises(ValueError, match="positions must have shape"):
        ConservationLaw(x[:, 0], 0.25, x[:, 0], flux=LinearAdvection((1.0,)))
    with pytest.raises(ValueError, match="volumes must be positive"):
        ConservationLaw(x, 0.0, x[:, 0], flux=LinearAdvection((1.0,)))
    law = ConservationLaw(x, 0.25, x[:, 0], flux=LinearAdvection((1.0,)))
    with pytest.raises(ValueError, match="time step must be positive"):
        law.run(1.0, 0.0)
