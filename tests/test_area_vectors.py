"""Area vectors where the reference is fixed: moved for those who read them."""

import numpy as np
from test_boundaries import block, lattice

import warp_eulsph as es
from warp_eulsph.boundaries import Bound


class BoundArea(Bound):
    """A condition of one's own that reads the area vectors when it loads."""

    recordable = True
    seen = None

    def load(self, state, clock, fraction, external):
        self.seen = state.surface.numpy().copy()


class Area(es.Boundary):
    def bind(self, assembly):
        return BoundArea()


def test_area_vectors_of_a_fixed_reference_move_for_conditions_that_read_them():
    """They are cof(F) s_0 then, to second order in Δt; nobody else needs them, and they stay."""
    kicked = block(6, 6, velocity=lattice(6, 6) @ [[0.0, 30.0], [-10.0, 5.0]])
    found = {}
    for conditions in ([Area()], [es.Fixed(lambda X: X[:, 0] < 0.1)], []):
        simulation = es.Simulation(kicked, boundaries=conditions, reference=es.Never())
        start = simulation.stepper.U.surface.numpy().copy()
        simulation.step(30)
        moves = bool(conditions) and isinstance(conditions[0], Area)
        assert simulation.stepper.moves_surfaces is moves
        found[moves] = simulation.stepper.U.surface.numpy() - start
        if moves:
            F = simulation.F
            exact = np.einsum("a,aji,aj->ai", np.linalg.det(F), np.linalg.inv(F), start)
            np.testing.assert_allclose(
                simulation.stepper.U.surface.numpy(), exact, rtol=0, atol=1e-4 * np.abs(start).max()
            )
            assert not np.array_equal(simulation.conditions[0].seen, start)
    assert np.abs(found[True]).max() > 0.01 * np.abs(start).max()
    assert not found[False].any()
