"""Metal punched: a copper block in a smooth container, half of its top pushed down to 60 % of the height.

Plane strain and perfectly plastic, punch and walls without friction: metal flows round the punch's edge and rises
beside it, the piercing of a billet with half of its width. In a rigid, perfectly plastic solid slip lines give the
steady load of that reduction exactly, p = 2 k (1 + π/2), k = y/√3 (Hill, The Mathematical Theory of Plasticity, 1950,
chapter VII), as long as there is half a width of metal below the punch.

Neighbours of the start hold on to each other round the edge, and the load grows without end: this is work for
``arrangement=Current()``, with ``PlainVolume()``, by which metal takes the room that its volume says. Walls are planes
of symmetry, not layers that are held, which are drawn out below the punch until metal passes between their particles.
Metal flows away from the axis, where ghosts are two supports deep; all of it may come to the base and to the far wall.
"""

from collections.abc import Sequence

import numpy as np
import warp as wp

from ...boundaries import Velocity, mirror
from ...geometry import box
from ...materials import J2, LinearHardening
from ...scheme.arrangement import Current
from ...scheme.base import Scheme
from ...scheme.plain_volume import PlainVolume
from ...scheme.verlet import Verlet
from ...simulation import Body, Simulation
from ...weights import WendlandC2
from ..case import Case
from ..report import Figure

YIELD = 0.4e9  # Pa
COPPER = J2(density=8930.0, young=117e9, poisson=0.35, hardening=LinearHardening(yield_stress=YIELD))
SPEED, RISE = 20.0, 2e-3  # m/s, and the time in which it is reached [s]; ρ v² is a hundredth of y
STEADY = 0.5 * 2.0 * YIELD / np.sqrt(3.0) * (1.0 + 0.5 * np.pi)  # N/m, on half of the width of 1 m
DEPTHS = np.arange(0.005, 0.6001, 0.005)
WEIGHT, DILATION = WendlandC2(), 1.8


@wp.func
def down(x: wp.vec2d, t: wp.float64) -> wp.vec2d:
    """The punch's velocity: ``SPEED``, reached evenly in ``RISE``."""
    return wp.vec2d(wp.float64(0.0), -wp.float64(20.0) * wp.min(t / wp.float64(2.0e-3), wp.float64(1.0)))


def build(n: int, scheme: Scheme = Verlet(correction=PlainVolume())) -> tuple[Simulation, Velocity]:
    """The block as n × n particles and the ghosts at three of its sides, and the condition of the punch."""
    dx = 1.0 / n
    x, volume = box((0.0, 0.0), (1.0, 1.0), dx)
    block, walls = Body(x=x, volume=volume, material=COPPER, name="block"), []
    two_supports = 2.0 * WEIGHT.support * DILATION * dx
    planes = ((0.0, 0.0), (-1.0, 0.0), two_supports), ((1.0, 0.0), (1.0, 0.0), 1.0), ((0.0, 0.0), (0.0, -1.0), 1.0)
    for point, normal, depth in planes:
        block, wall = mirror(block, point=point, normal=normal, depth=depth)
        walls.append(wall)
    punch = Velocity(lambda X: (X[:, 1] > 1.0 - dx) & (X[:, 0] > 0.0) & (X[:, 0] < 0.5), down, axes=(1,))
    simulation = Simulation(
        block, boundaries=[punch, *walls], arrangement=Current(), scheme=scheme, weight=WEIGHT, dilation=DILATION
    )
    return simulation, punch


def loads(simulation: Simulation, punch: Velocity) -> np.ndarray:
    """Load over the steady one at ``DEPTHS``."""
    found = []
    for depth in DEPTHS:
        simulation.run(depth / SPEED + 0.5 * RISE)
        found.append(-simulation.reaction(punch)[1] / STEADY)
    return np.array(found)


def matter(simulation: Simulation, depth: float) -> float:
    """Volume of the particles below the level of the punch over the room that there is."""
    own = simulation.order.by_number(simulation.particles.share.numpy()) > 0.0
    below = own & (simulation.x[:, 1] < 1.0 - depth)
    return float((simulation.J * simulation.order.by_number(simulation.particles.V0.numpy()))[below].sum()) / (
        1.0 - depth
    )


def run(quick: bool) -> Sequence[Figure]:
    """The load on means of looks: within 10 % to a depth of 0.5, to which half a width of metal is below the punch."""
    figures = []
    for n in (16,) if quick else (16, 32):
        simulation, punch = build(n)
        load = loads(simulation, punch)
        energy = simulation.energy()
        work = energy["constraint"]
        for first, last, off in ((0.1, 0.25, 0.1), (0.25, 0.4, 0.1), (0.4, 0.5, 0.1), (0.55, 0.6, 0.25)):
            mean = float(load[(first - 1e-6 < DEPTHS) & (last + 1e-6 > DEPTHS)].mean())
            figures.append(Figure(f"{n}_load_over_slip_lines_{first}_to_{last}", mean, 1.0 - off, 1.0 + off, 1.0))
        nearest = simulation.order.by_number(simulation.configuration.nearest()) * n
        figures += [
            Figure(f"{n}_matter_over_room_below", matter(simulation, DEPTHS[-1]), 0.94, 1.06, 1.0),
            Figure(f"{n}_kinetic_share", energy["kinetic"] / work, 0.0, 0.02, 0.0),
            Figure(f"{n}_dissipation_share", -energy["dissipation"] / work, 0.0, 0.2, 0.0),
            Figure(f"{n}_ledger_residual", abs(energy["residual"]) / work, 0.0, 1e-10, 0.0),
            Figure(f"{n}_nearest_neighbours", float(nearest.min()), reference=1.0),
            Figure(f"{n}_nearest_neighbours_of_95_percent", float(np.percentile(nearest, 5)), reference=1.0),
        ]
    return figures


CASE = Case(
    name="metal_punch",
    title="Copper block punched to 60 % of its height: load, and alive to the end",
    source="exact steady load of the rigid, perfectly plastic solid (Hill 1950)",
    run=run,
)
