"""Metal punched: a copper block in a smooth container, half of its top pushed down to 60 % of the height.

Plane strain and perfectly plastic, punch and walls without friction: metal flows round the punch's edge and rises
beside it, the piercing of a billet with half of its width. In a rigid, perfectly plastic solid slip lines give the
steady load of that reduction exactly, p = 2 k (1 + π/2), k = y/√3 (Hill, The Mathematical Theory of Plasticity, 1950,
chapter VII), as long as there is half a width of metal below the punch.

Neighbours of the start hold on to each other round the edge, and the load grows without end (1.3 times the exact one at
a depth of 0.2, 3 times at 0.6, 16²): this is work for ``arrangement=Current()``. There the load is right to a depth of
0.25; deeper, it falls: particles crowd together (nearest at a twentieth of the spacing), faces open at the edge, and
what has risen beside the punch leans over it, which nothing here keeps it from.
"""

from collections.abc import Sequence

import numpy as np
import warp as wp

from ...boundaries import Fixed, Velocity
from ...geometry import box
from ...materials import J2, LinearHardening
from ...scheme.arrangement import Arrangement, Current
from ...simulation import Body, Simulation
from ..case import Case
from ..report import Figure

YIELD = 0.4e9  # Pa
COPPER = J2(density=8930.0, young=117e9, poisson=0.35, hardening=LinearHardening(yield_stress=YIELD))
SPEED, RISE = 20.0, 2e-3  # m/s, and the time in which it is reached [s]; ρ v² is a hundredth of y
STEADY = 0.5 * 2.0 * YIELD / np.sqrt(3.0) * (1.0 + 0.5 * np.pi)  # N/m, on half of the width of 1 m
DEPTHS = np.arange(0.005, 0.6001, 0.005)


@wp.func
def down(x: wp.vec2d, t: wp.float64) -> wp.vec2d:
    """The punch's velocity: ``SPEED``, reached evenly in ``RISE``."""
    return wp.vec2d(wp.float64(0.0), -wp.float64(20.0) * wp.min(t / wp.float64(2.0e-3), wp.float64(1.0)))


def build(n: int, arrangement: Arrangement) -> tuple[Simulation, Velocity]:
    """The block as n × n particles, and the condition of the punch."""
    dx = 1.0 / n
    x, volume = box((0.0, 0.0), (1.0, 1.0), dx)
    punch = Velocity(lambda X: (X[:, 1] > 1.0 - dx) & (X[:, 0] < 0.5), down, axes=(1,))
    rollers = [
        Fixed(lambda X: (X[:, 0] < dx) | (X[:, 0] > 1.0 - dx), axes=(0,)),
        Fixed(lambda X: X[:, 1] < dx, axes=(1,)),
    ]
    block = Body(x=x, volume=volume, material=COPPER, name="block")
    return Simulation(block, boundaries=[*rollers, punch], arrangement=arrangement), punch


def loads(simulation: Simulation, punch: Velocity) -> np.ndarray:
    """Load over the steady one at ``DEPTHS``."""
    found = []
    for depth in DEPTHS:
        simulation.run(depth / SPEED + 0.5 * RISE)
        found.append(-simulation.reaction(punch)[1] / STEADY)
    return np.array(found)


def run(quick: bool) -> Sequence[Figure]:
    """The steady load within 10 % from 0.1 to 0.25, on the mean of 31 looks; alive to 0.6 with its books closed."""
    figures = []
    for n in (16,) if quick else (16, 32):
        simulation, punch = build(n, Current())
        load = loads(simulation, punch)
        energy = simulation.energy()
        work = energy["constraint"]
        steady = float(load[(DEPTHS > 0.0999) & (DEPTHS < 0.2501)].mean())
        figures += [
            Figure(f"{n}_load_over_slip_lines_to_0.25", steady, 0.9, 1.1, 1.0),
            Figure(f"{n}_load_over_slip_lines_at_0.4", float(load[(DEPTHS > 0.35) & (DEPTHS < 0.4001)].mean())),
            Figure(f"{n}_load_over_slip_lines_at_0.6", float(load[DEPTHS > 0.55].mean())),
            Figure(f"{n}_kinetic_share", energy["kinetic"] / work, 0.0, 0.01, 0.0),
            Figure(f"{n}_dissipation_share", -energy["dissipation"] / work, 0.0, 0.2, 0.0),
            Figure(f"{n}_ledger_residual", abs(energy["residual"]) / work, 0.0, 1e-10, 0.0),
            Figure(f"{n}_nearest_neighbours", float(simulation.configuration.nearest().min()) * n, reference=1.0),
        ]
    return figures


CASE = Case(
    name="metal_punch",
    title="Copper block punched to 60 % of its height: load, and alive to the end",
    source="exact steady load of the rigid, perfectly plastic solid (Hill 1950)",
    run=run,
)
