"""Eulerian corrected SPH with two-step Lax-Wendroff time stepping on NVIDIA Warp.

Build bodies, state conditions, run::

    import warp_eulsph as es

    bar = es.Body(x=..., volume=..., material=es.NeoHookean(density=1100.0, young=17e6, poisson=0.45))
    simulation = es.Simulation(bar, boundaries=[es.Fixed(lambda X: X[:, 0] < 0.01)], reference=es.Always())
    simulation.run(until=0.5)
"""

from .boundaries import (
    Antisymmetry,
    BodyForce,
    Boundary,
    Clamped,
    Damping,
    Fixed,
    Gravity,
    MirrorGhosts,
    Motion,
    NoSlip,
    Pressure,
    Region,
    Roller,
    Traction,
    Velocity,
    Wall,
    mirror,
)
from .interactions import Contact, Interaction, RigidBody
from .kernel_cache import look_after_kernels
from .materials import (
    Bar,
    LinearElastic,
    Material,
    MooneyRivlin,
    NearlyIncompressible,
    NeoHookean,
    NeoHookeanLog,
    SaintVenantKirchhoff,
    TaitLiquid,
)
from .notices import sum_up_compiling
from .operators.values import Linear, Shepard
from .options import explain_mistakes
from .order import spatial_order
from .scheme.arrangement import Arrangement, Convected, Current
from .scheme.balance import Balance
from .scheme.base import Scheme
from .scheme.dissipation import Upwind
from .scheme.health import UnstableError
from .scheme.lax import Lax
from .scheme.lax_wendroff import LaxWendroff
from .scheme.limiter import FluxCorrectedTransport
from .scheme.pair_areas import PairAreas
from .scheme.plain_volume import PlainVolume
from .scheme.policy import Always, Every, Never, ReferencePolicy, WhenDistorted
from .scheme.sensor import DimensionlessSensor, PaperSensor, Sensor
from .scheme.sharpening import Sharpening
from .scheme.shifting import Shifting
from .scheme.smoothing import LinearExact, NeighbourAverage, Smoothing
from .scheme.stabiliser import Correction
from .scheme.surface_vectors import SurfaceVectors
from .scheme.tie import Tie
from .scheme.tilt import Tilt
from .scheme.time_step import TimeStep
from .scheme.uncorrected import Uncorrected
from .scheme.verlet import Verlet
from .settling import settle
from .simulation import Body, Simulation
from .space import Space
from .weights import CubicSpline, QuarticSpline, QuinticSpline, Weight, WendlandC2, WendlandC4, WendlandC6
from .whole import BrokenError

__all__ = [
    "Always",
    "Antisymmetry",
    "Arrangement",
    "Balance",
    "Bar",
    "Body",
    "BodyForce",
    "Boundary",
    "BrokenError",
    "Clamped",
    "Contact",
    "Convected",
    "Correction",
    "CubicSpline",
    "Current",
    "Damping",
    "DimensionlessSensor",
    "Every",
    "Fixed",
    "FluxCorrectedTransport",
    "Gravity",
    "Interaction",
    "Lax",
    "LaxWendroff",
    "Linear",
    "LinearElastic",
    "LinearExact",
    "Material",
    "MirrorGhosts",
    "MooneyRivlin",
    "Motion",
    "NearlyIncompressible",
    "NeighbourAverage",
    "NeoHookean",
    "NeoHookeanLog",
    "Never",
    "NoSlip",
    "PairAreas",
    "PaperSensor",
    "PlainVolume",
    "Pressure",
    "QuarticSpline",
    "QuinticSpline",
    "ReferencePolicy",
    "Region",
    "RigidBody",
    "Roller",
    "SaintVenantKirchhoff",
    "Scheme",
    "Sensor",
    "Sharpening",
    "Shepard",
    "Shifting",
    "Simulation",
    "Smoothing",
    "Space",
    "SurfaceVectors",
    "TaitLiquid",
    "Tie",
    "Tilt",
    "TimeStep",
    "Traction",
    "Uncorrected",
    "UnstableError",
    "Upwind",
    "Velocity",
    "Verlet",
    "Wall",
    "Weight",
    "WendlandC2",
    "WendlandC4",
    "WendlandC6",
    "WhenDistorted",
    "mirror",
    "settle",
    "spatial_order",
]

explain_mistakes(__all__, globals())
look_after_kernels()
sum_up_compiling()
