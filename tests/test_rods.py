"""Measured Taylor rods: the data as they came, and the outline that is compared with them."""

import numpy as np
import pytest
from points import Point, mises, stretched

from warp_eulsph.materials import JohnsonCook
from warp_eulsph.validation import rods


def test_the_data_are_those_measured():
    found = rods.measured()
    assert list(found) == ["1", "2", "5"] and found["2"].temperature == 718.0
    rod = found["5"]
    assert (rod.length, rod.radius, rod.speed) == pytest.approx((34.5e-3, 3.9e-3, 225.0))
    assert rod.final_length == pytest.approx(22.2527e-3) and rod.radii[-1] == pytest.approx(3.931e-3)


def test_the_outline_of_a_rod_that_has_not_moved_is_its_cylinder():
    rod = rods.measured()["5"]
    z, r, length = rods.outline(rods.build(rod, rods.LAW, 3), rod)
    assert (np.diff(z) > 0.0).all() and length == pytest.approx(rod.length, rel=1e-3)  # rounded to whole layers
    np.testing.assert_allclose(r, rod.radius, rtol=1e-12)


def test_heat_at_the_start_softens_by_the_reference_temperature():
    """y at α = 0 of copper that starts hot: A (1 − T*^m) with T* counted from where A was measured."""
    hot = JohnsonCook(A=300e6, B=1e6, n=0.5, m=1.09, temperature=718.0, reference_temperature=298.0, taylor_quinney=0.0)
    point = Point(hot).step(stretched(0.01), 1.0)
    share = 1.0 - ((718.0 - 298.0) / (1356.0 - 298.0)) ** 1.09
    y = (300e6 + 1e6 * float(point.plastic_strain) ** 0.5) * share
    assert mises(point.sigma) == pytest.approx(y, rel=1e-9) and float(point.temperature) == 718.0
    with pytest.raises(ValueError, match="above reference_temperature"):
        JohnsonCook(A=1e6, B=1e6, n=0.5, temperature=300.0, reference_temperature=2000.0)
