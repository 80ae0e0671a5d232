"""Eulerian corrected SPH with two-step Lax-Wendroff time stepping on NVIDIA Warp.

Build bodies, state conditions, run::

    import warp_eulsph as es

    bar = es.Body(x=..., volume=..., material=es.NeoHookean(density=1100.0, young=17e6, poisson=0.45))
    simulation = es.Simulation(bar, boundaries=[es.Fixed(lambda X: X[:, 0] < 0.01)], reference=es.Always())
    simulation.run(until=0.5)
"""

from .boundaries import Boundary, Fixed, Region, Velocity
from .materials import Material, NeoHookean
from .scheme.dissipation import Upwind
from .scheme.health import UnstableError
from .scheme.lax_wendroff import LaxWendroff
from .scheme.pair_areas import PairAreas
from .scheme.reference import Always, Every, Never, ReferencePolicy, WhenDistorted
from .scheme.smoothing import LinearExact, Smoothing
from .scheme.surface_vectors import SurfaceVectors
from .scheme.time_step import TimeStep
from .simulation import Body, Simulation
from .space import Space
from .weights import CubicSpline, Weight

__all__ = [
    "Always",
    "Body",
    "Boundary",
    "CubicSpline",
    "Every",
    "Fixed",
    "LaxWendroff",
    "LinearExact",
    "Material",
    "NeoHookean",
    "Never",
    "PairAreas",
    "ReferencePolicy",
    "Region",
    "Simulation",
    "Smoothing",
    "Space",
    "SurfaceVectors",
    "TimeStep",
    "UnstableError",
    "Upwind",
    "Velocity",
    "Weight",
    "WhenDistorted",
]
