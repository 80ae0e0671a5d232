"""What contact costs: two blocks of rubber pressed together by a whole face, a step with contact beside one without.

    python -m warp_eulsph.bench.contact_cost

One thread, float64; steps with and without are timed in turns, medians of processor time.
"""

import statistics
import time

import numpy as np
import warp as wp

from .. import execution
from ..body import Body
from ..geometry import box
from ..interactions import Contact
from ..materials import NeoHookean
from ..simulation import Simulation

ROUNDS = 7
# Dimension, particles along a side, steps of a round.
BLOCKS = ((2, 40, 40), (2, 80, 10), (3, 16, 6), (3, 24, 3), (3, 36, 1))


def blocks(dim: int, side: int, friction: float | None) -> Simulation:
    """Two that fly at each other; they pass through each other where ``friction`` is None."""
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / side)
    up, rubber = np.eye(dim)[-1], NeoHookean(density=1000.0, young=1e7, poisson=0.3)
    bodies = [
        Body(x=x + k * up, volume=volume, material=rubber, velocity=(0.3 - 0.6 * k) * up, name=("lower", "upper")[k])
        for k in (0, 1)
    ]
    return Simulation(bodies, interactions=[] if friction is None else [Contact(friction=friction)])


def measure(dim: int, side: int, steps: int) -> tuple[float, list[float]]:
    """Share of particles that are outermost, and processor seconds of a step without, with, and with friction."""
    runs = [blocks(dim, side, friction) for friction in (None, 0.0, 0.3)]
    found: list[list[float]] = [[] for _ in runs]
    for run in runs:
        run.step(20)
    for _ in range(ROUNDS):
        for run, seconds in zip(runs, found, strict=True):
            start = time.process_time()
            run.step(steps)
            seconds.append((time.process_time() - start) / steps)
    outermost = 1.0 - max(side - 2, 0) ** dim / side**dim
    return outermost, [statistics.median(seconds) for seconds in found]


def main() -> None:
    """Print a table."""
    wp.config.log_level = wp.LOG_WARNING
    execution.set_threads(1)
    print("particles   outermost   step [ms]   share of contact   and of friction")
    for dim, side, steps in BLOCKS:
        outermost, (without, sliding, rubbing) = measure(dim, side, steps)
        shares = [1.0 - without / step for step in (sliding, rubbing)]
        size = f"2 x {side}^{dim}"
        print(f"{size:9s}   {outermost:9.0%}   {1e3 * sliding:9.2f}   {shares[0]:16.1%}   {shares[1]:15.1%}")


if __name__ == "__main__":
    main()
