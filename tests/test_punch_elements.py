"""The finite elements beside the punch: their force is the stress of the law, and the punch resists as it should."""

import numpy as np
import pytest

from warp_eulsph.validation import punch_elements
from warp_eulsph.validation.cases.punch import REACTIONS

F = np.array([[1.1, 0.3], [-0.1, 0.8]])


def energy(F):
    """Ψ = μ/2 (J^(−2/3) (F:F + 1) − 3) + κ/2 (J − 1)², plane strain."""
    J = np.linalg.det(F)
    shape = J ** (-2.0 / 3.0) * (np.square(F).sum() + 1.0) - 3.0
    return 0.5 * punch_elements.MU * shape + 0.5 * punch_elements.KAPPA * (J - 1.0) ** 2


@pytest.mark.parametrize("mean_volume", [False, True])
def test_uniform_stress_pulls_at_the_boundary_only(mean_volume):
    X = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, 5)] * 2, indexing="ij"), axis=-1)
    force, volume = punch_elements.forces(X @ F.T, mean_volume)
    step = 1e-6
    P = np.zeros((2, 2))
    for i, j in np.ndindex(2, 2):
        d = np.zeros((2, 2))
        d[i, j] = step
        P[i, j] = (energy(F + d) - energy(F - d)) / (2.0 * step)
    scale = np.abs(P).max()
    np.testing.assert_allclose(volume, np.linalg.det(F), rtol=1e-12)
    np.testing.assert_allclose(force[1:-1, 1:-1], 0.0, rtol=0, atol=1e-12 * scale)
    np.testing.assert_allclose(force[-1].sum(axis=0), P[:, 0], rtol=0, atol=1e-7 * scale)
    np.testing.assert_allclose(force[:, -1].sum(axis=0), P[:, 1], rtol=0, atol=1e-7 * scale)


def test_coarse_elements_are_a_little_too_stiff(capsys):
    found = punch_elements.main(["-n", "10", "--until", "0.0053"])
    column = punch_elements.TIMES.index(0.005)
    low, high = REACTIONS[0.005]
    assert low < found[10, True][column] < found[10, False][column] < 1.1 * high
    assert "10 × 10, Q1-P0" in capsys.readouterr().out
