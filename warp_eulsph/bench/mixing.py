"""What a body that flows would lose as its neighbours part in memory, and what sorting its particles brings back.

    python -m warp_eulsph.bench.mixing [--side N] [--steps N]

A cube of liquid follows three crossed vortices that its velocities are set to, refreshed every step: once with its
particles sorted as they part, once with all left where they were. Rates are of the lattice at the start and of the
mixed cubes; then what a look at the order and a sort cost, in steps of the mixed cube.
"""

import argparse
import functools
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from .. import execution
from ..body import Body
from ..boundaries import Velocity
from ..geometry import box
from ..materials import TaitLiquid
from ..scheme.time_step import TimeStep
from ..scheme.verlet import Verlet
from ..simulation import Simulation
from ..weights import CubicSpline

SHIFT = 0.1  # of the fastest particle in a step, in spacings
ROUNDS, STEPS_PER_ROUND = 5, 4
OPTIONS: dict[str, Any] = {"scheme": Verlet(), "weight": CubicSpline(), "dilation": 1.3}
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


def stirred_cube(x: np.ndarray, side: int, sort: bool) -> Simulation:
    """The liquid at positions ``x`` (n, 3), of which ``side`` fill an edge."""
    body = Body(x=x, volume=float(side) ** -3, spacing=1.0 / side, material=LIQUID)
    fixed = TimeStep(fixed=SHIFT / (2.0 * side))  # no velocity is above 2 m/s
    return Simulation(body, boundaries=[Velocity(None, stirred)], time_step=fixed, sort=sort, **OPTIONS)


def compare(side: int, steps: int) -> dict[str, float]:
    """Rates [1/s] of the lattice and of the cubes after ``steps`` steps; costs of a look and a sort [steps]."""
    x = box((0.0,) * 3, (1.0,) * 3, 1.0 / side)[0]
    cubes = {"left": stirred_cube(x, side, sort=False), "sorted": stirred_cube(x, side, sort=True)}
    for cube in cubes.values():
        cube.step(3)
    lattice = rates(cubes)
    for cube in cubes.values():
        cube.step(steps)
    found = {"lattice": statistics.mean(lattice.values()), **rates(cubes)}
    sorting, step = cubes["sorted"].sorting, len(x) / found["sorted"]
    look = [seconds(sorting.parted) for _ in range(ROUNDS)]
    sort = [seconds(lambda: sorting.permute(sorting.sorted_places())) for _ in range(ROUNDS)]
    return found | {"look": statistics.median(look) / step, "sort": statistics.median(sort) / step}


def rates(cubes: dict[str, Simulation]) -> dict[str, float]:
    """Particle-steps per processor second, medians over rounds that take turns, for the machine has moods."""
    spent: dict[str, list[float]] = {name: [] for name in cubes}
    for _ in range(ROUNDS):
        for name, cube in cubes.items():
            spent[name].append(seconds(functools.partial(cube.step, STEPS_PER_ROUND)))
    return {name: STEPS_PER_ROUND * len(cubes[name].x) / statistics.median(spent[name]) for name in cubes}


def seconds(work: Callable[[], object]) -> float:
    """Processor seconds of a call."""
    start = time.process_time()
    work()
    return time.process_time() - start


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Print and return what was measured."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=46, help="particles along each edge")
    parser.add_argument("--steps", type=int, default=1000)
    args = parser.parse_args(argv)
    wp.config.log_level = wp.LOG_WARNING
    threads = execution.threads()
    execution.set_threads(1)
    try:
        found = compare(args.side, args.steps)
    finally:
        execution.set_threads(threads)
    for name in ("lattice", "left", "sorted"):
        print(f"{name:8s} {found[name] / 1e6:.3f} M particle-steps per processor second")
    for name in ("look", "sort"):
        print(f"a {name} takes {found[name]:.4f} steps")
    return found


if __name__ == "__main__":
    main()
