"""The finite elements of revolution beside the rods: a uniform stress is that of the law, which returns to its yield
stress, and coarse elements give the shape of Taylor's bar."""

import numpy as np
import pytest

from warp_eulsph.validation import rod_elements
from warp_eulsph.validation.cases.necking import STEEL, load
from warp_eulsph.validation.cases.taylor_bar import COPPER

MU, KAPPA = COPPER.constants()["mu"], COPPER.constants()["kappa"]


def test_uniform_stress_pulls_at_the_boundary_only():
    """Of a cylinder drawn out by 0.2 %: Hencky's stress, times the area it acts on."""
    z = np.linspace(0.0, 2.0, 5) ** 1.3
    mesh = rod_elements.Mesh(3, np.ones(5), z, COPPER.density)
    across, along = 0.9995, 1.002
    force = rod_elements.forces(mesh, rod_elements.Matter(COPPER, mesh.R.shape), mesh.X * (across, along))
    e, volumetric = np.log([across, along]), np.log(across**2 * along)
    tau = 2.0 * MU * (e - volumetric / 3.0) + KAPPA * volumetric
    P, height = tau / (across, along), z[-1]
    assert mesh.mass.sum() == pytest.approx(COPPER.density * np.pi * height, rel=1e-12)
    scale = np.abs(P).max()
    np.testing.assert_allclose(force[:-1, 1:-1], 0.0, rtol=0, atol=1e-11 * scale)
    assert force[:, -1, 1].sum() == pytest.approx(P[1] * np.pi, rel=1e-10)
    assert force[-1, :, 0].sum() == pytest.approx(P[0] * 2.0 * np.pi * height, rel=1e-10)


@pytest.mark.parametrize("law", [COPPER, STEEL])
def test_the_stress_returns_to_the_yield_stress(law):
    matter = rod_elements.Matter(law, (1, 4))
    F = np.eye(3) + 0.1 * np.random.default_rng(0).standard_normal((1, 4, 3, 3))
    F[..., :2, 2] = F[..., 2, :2] = 0.0
    J, inverse = np.linalg.det(F), np.linalg.inv(F)
    s = matter.deviator(F, J, inverse)
    y = matter.yield_stress(matter.alpha)[0]
    assert matter.alpha.min() > 0.01
    np.testing.assert_allclose(np.sqrt(1.5 * np.square(s).sum(axis=(-1, -2))), y, rtol=1e-9)
    np.testing.assert_allclose(np.linalg.det(matter.metric), 1.0, rtol=1e-12)
    np.testing.assert_allclose(matter.deviator(F, J, inverse), s, rtol=0, atol=1e-9 * y.max())


def test_coarse_elements_bear_the_load_of_a_long_bar():
    """At 3 % of elongation, before a neck: between the loads of the narrowest section and of the full one, nearly."""
    ((radii, force),) = rod_elements.pulled(2, (0.03,))
    full = float(load(3, np.log(1.03)))
    assert 0.96 * full < force < 1.01 * full
    assert 0.95 < radii[0] <= radii[-1] < 0.98


def test_coarse_elements_have_the_length_and_foot():
    """Two per radius at 20 µs: what finer ones have then."""
    ((length, foot, *_, strain),) = rod_elements.taylor(2, (20e-6,))
    assert length == pytest.approx(28.06e-3, rel=0.005) and foot == pytest.approx(6.10e-3, rel=0.05)
    assert 1.0 < strain < 2.5
