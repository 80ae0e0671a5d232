"""What the cases of solids share: the rubber, the forms of the reference, a followed point."""

import numpy as np

from ..materials import NeoHookean
from ..scheme.policy import Always, Every, Never, ReferencePolicy
from ..simulation import Simulation

#: Nearly incompressible rubber of the literature's large-strain examples; plane strain in 2-D.
RUBBER = NeoHookean(density=1100.0, young=17e6, poisson=0.45)

#: The forms by the name that command lines use.
FORMS: dict[str, ReferencePolicy] = {"total": Never(), "updated": Every(5), "eulerian": Always()}


class MaterialPoint:
    """A point of a body between or beyond its particles, carried by the F of those nearest to it.

    Args:
        simulation: at its start.
        X: initial position of the point [m], (dim,).
    """

    def __init__(self, simulation: Simulation, X: np.ndarray):
        start = simulation.bodies[0].x
        distance = np.linalg.norm(start - X, axis=1)
        self.simulation = simulation
        self.nearest = np.flatnonzero(distance < 1.01 * distance.min())
        self.away = X - start[self.nearest]

    @property
    def x(self) -> np.ndarray:
        """Its present position [m], (dim,): mean over the nearest particles."""
        x, F = self.simulation.x[self.nearest], self.simulation.F[self.nearest]
        return (x + np.einsum("nij,nj->ni", F, self.away)).mean(axis=0)
