"""What is cut from a shape."""

import numpy as np
import pytest
from case_files import small

from warp_eulsph.cases import CaseError, parse_case


def test_cut_leaves_out_particles_and_keeps_the_volumes_of_the_others():
    case = small()
    case["body"]["a"]["cut"] = "hypot(x - 0.5, y) < 0.3"
    x = parse_case(small()).build().x
    simulation = parse_case(case).build()
    kept = np.hypot(x[:, 0] - 0.5, x[:, 1]) >= 0.3
    assert 0 < (~kept).sum() < 4
    np.testing.assert_array_equal(simulation.x, x[kept])
    np.testing.assert_allclose(simulation.particles.V0.numpy(), 1 / 16)
    described = parse_case(case).describe()
    assert described["body"]["a"]["cut"] == "hypot(x - 0.5, y) < 0.3"
    assert len(parse_case(described).build().x) == kept.sum()


def test_shapes_with_area_vectors_are_not_cut():
    case = small()
    case["body"]["a"]["shape"] = {"kind": "nodes", "lower": [0, 0], "upper": [1, 1], "spacing": 0.1}
    case["body"]["a"]["cut"] = "x > 0.75"
    with pytest.raises(ValueError, match=r"body.a.cut: a shape with area vectors, nodes, would have none on the cut"):
        parse_case(case).build()


def test_mistakes_are_named():
    for cut, message in (("x < 2", "body.a.cut: leaves nothing of 16 particles"), ("x", "body.a.cut: must be a comp")):
        case = small()
        case["body"]["a"]["cut"] = cut
        with pytest.raises((CaseError, ValueError), match=message):
            parse_case(case).build()
    case = small()
    case["body"]["a"]["cut"] = "z < 1"
    with pytest.raises(CaseError, match=r"body.a.cut: \['z'\] are not coordinates in 2-D"):
        parse_case(case)
