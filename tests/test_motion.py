"""Prescribed motion follows its function."""

import numpy as np
import pytest
import warp as wp
from bodies import COMPRESSIBLE

import warp_eulsph as es
from warp_eulsph.geometry import box


def block():
    x, volume = box((0.0, 0.0), (0.6, 0.6), 0.1)
    return es.Body(x=x, volume=volume, material=COMPRESSIBLE)


@wp.func
def swing(X: wp.vec2d, t: wp.float64) -> wp.vec2d:
    return wp.vec2d(wp.float64(0.1) * wp.sin(wp.float64(300.0) * t) * X[1], wp.float64(0.0))


@pytest.mark.parametrize("displacement", [swing, lambda X, t: np.c_[0.1 * np.sin(300.0 * t) * X[:, 1], 0.0 * X[:, 0]]])
def test_motion_puts_particles_in_their_places(displacement):
    """Positions follow the function to round-off, velocities to second order."""
    errors = []
    for dt in (4e-5, 2e-5):
        simulation = es.Simulation(
            block(), boundaries=[es.Motion(displacement, lambda X: X[:, 1] > 0.5)], time_step=es.TimeStep(fixed=dt)
        )
        X = simulation.x
        simulation.run(2e-3)
        moved = X[:, 1] > 0.5
        exact = X + np.c_[0.1 * np.sin(300.0 * 2e-3) * X[:, 1], 0.0 * X[:, 0]]
        np.testing.assert_allclose(simulation.x[moved], exact[moved], rtol=0, atol=1e-14)
        errors.append(np.abs(simulation.v[moved, 0] - 30.0 * np.cos(300.0 * 2e-3) * X[moved, 1]).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.01)


def test_motion_must_be_a_function():
    with pytest.raises(ValueError, match=r"displacement must be a function .* got float; Fixed\(\) holds"):
        es.Simulation(block(), boundaries=[es.Motion(0.1)])
