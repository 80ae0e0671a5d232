"""What a body that flows loses as its neighbours part in memory, and what sorting its particles anew would bring back.

    python -m warp_eulsph.bench.mixing [--side N] [--steps N]

A cube of liquid follows three crossed vortices that its velocities are set to, refreshed every step. Rates are of the
lattice at the start, of the mixed cube at the end, and of that cube with its particles sorted (``es.spatial_order``).
"""

import argparse
import statistics
import time

import numpy as np
import warp as wp

from .. import execution
from ..body import Body
from ..boundaries import Velocity
from ..geometry import box
from ..materials import TaitLiquid
from ..order import spatial_order
from ..scheme.time_step import TimeStep
from ..simulation import Simulation

SHIFT = 0.1  # of the fastest particle in a step, in spacings
ROUNDS, STEPS_PER_ROUND = 5, 4
LIQUID = TaitLiquid(density=1000.0, sound_speed=10.0)


@wp.func
def stirred(x: wp.vec3d, t: wp.float64) -> wp.vec3d:
    """Velocity of three crossed vortices in the unit cube, without divergence, tangential at its faces."""
    turn = wp.vec3d()
    for i in range(3):
        j = (i + 1) % 3
        a, b = wp.float64(wp.PI) * x[i], wp.float64(wp.PI) * x[j]
        turn[i] = turn[i] + wp.sin(a) * wp.cos(b)
        turn[j] = turn[j] - wp.cos(a) * wp.sin(b)
    return turn


def stirred_cube(x: np.ndarray, side: int) -> Simulation:
    """The liquid at positions ``x`` (n, 3), of which ``side`` fill an edge."""
    body = Body(x=x, volume=float(side) ** -3, spacing=1.0 / side, material=LIQUID)
    fixed = TimeStep(fixed=SHIFT / (2.0 * side))  # no velocity is above 2 m/s
    return Simulation(body, boundaries=[Velocity(None, stirred)], time_step=fixed)


def compare(side: int, steps: int) -> dict[str, float]:
    """Rates of the lattice, of the cube after ``steps`` steps, and of that cube sorted."""
    simulation = stirred_cube(box((0.0,) * 3, (1.0,) * 3, 1.0 / side)[0], side)
    simulation.step(3)
    rates = {"lattice": rate(simulation)}
    simulation.step(steps)
    rates["mixed"] = rate(simulation)
    order = spatial_order(simulation.x, 1.0 / side)
    again = stirred_cube(simulation.bodies[0].x, side)
    # Not built there, for so mixed a cube has particles with fewer neighbours than a body may start with
    again.stepper.U.x.assign(simulation.x[order])
    again.stepper.U.F.assign(simulation.F[order])
    again.step(3)
    return rates | {"sorted": rate(again)}


def rate(simulation: Simulation) -> float:
    """Particle-steps per processor second, median over rounds."""
    seconds = []
    for _ in range(ROUNDS):
        start = time.process_time()
        simulation.step(STEPS_PER_ROUND)
        seconds.append(time.process_time() - start)
    return STEPS_PER_ROUND * len(simulation.particles.mass) / statistics.median(seconds)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Print and return the rates."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=46, help="particles along each edge")
    parser.add_argument("--steps", type=int, default=1000)
    args = parser.parse_args(argv)
    wp.config.log_level = wp.LOG_WARNING
    threads = execution.threads()
    execution.set_threads(1)
    try:
        rates = compare(args.side, args.steps)
    finally:
        execution.set_threads(threads)
    for name, value in rates.items():
        print(f"{name:8s} {value / 1e6:.3f} M particle-steps per processor second")
    return rates


if __name__ == "__main__":
    main()
