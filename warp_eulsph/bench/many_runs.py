"""Many small runs: bars of 40 particles one after another, and as the bodies of one simulation.

    python -m warp_eulsph.bench.many_runs            python -m warp_eulsph.bench.many_runs --bars 200 --independent

Each bar has a modulus of its own, as in a study of parameters. One thread; all ways are timed in turns.
"""

import argparse
import functools
import statistics
import time
from collections.abc import Callable, Sequence

import numpy as np
import warp as wp

from .. import execution
from ..body import Body
from ..geometry import box
from ..materials import NeoHookean
from ..scheme.policy import Never
from ..simulation import Simulation

PARTICLES, STEPS, ROUNDS = 40, 1500, 5
# Of a round: bars that are run one after another, and steps of all of them together.
ALONE, TOGETHER = 4, 60


def bar(k: int) -> Body:
    """Bar number ``k`` of 1 m, 2 m from the next, which swings lengthwise."""
    x, volume = box((2.0 * k,), (2.0 * k + 1.0,), 1.0 / PARTICLES)
    material = NeoHookean(density=1100.0, young=17e6 * (1.0 + 1e-4 * k), poisson=0.45)
    return Body(x=x, volume=volume, material=material, velocity=np.sin(np.pi * (x - 2.0 * k)), name=f"bar {k}")


def _seconds(action: Callable[[], object]) -> float:
    start = time.process_time()
    action()
    return time.process_time() - start


def measure(bars: int, independent: Sequence[bool]) -> list[float]:
    """Processor seconds of all runs of ``STEPS`` steps, one after another and as one simulation, ``independent`` or
    not, to build included."""

    def alone() -> None:
        for k in range(ALONE):
            Simulation(bar(k), reference=Never()).step(STEPS)

    def build(apart: bool, count: int = bars) -> Simulation:
        return Simulation([bar(k) for k in range(count)], reference=Never(), independent=apart)

    def take(world: Simulation) -> None:
        world.step(TOGETHER)

    Simulation(bar(0), reference=Never()).step(20)  # compiles
    for apart in independent:
        build(apart, 2).step(20)
    built = [_seconds(functools.partial(build, apart)) for apart in independent]
    worlds = [build(apart) for apart in independent]
    for world in worlds:
        world.step(3)
    found = []
    for _ in range(ROUNDS):
        taken = [_seconds(functools.partial(take, world)) / TOGETHER * STEPS for world in worlds]
        found.append([_seconds(alone) / ALONE * bars, *map(sum, zip(built, taken, strict=True))])
    return [statistics.median(each) for each in zip(*found, strict=True)]


def main(argv: list[str] | None = None) -> None:
    """Print both and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bars", type=int, default=1000, help="how many (1000)")
    parser.add_argument("--independent", action="store_true", help="as runs with clocks and ledgers of their own too")
    given = parser.parse_args(argv)
    bars = given.bars
    wp.config.log_level = wp.LOG_WARNING
    execution.set_threads(1)
    one, together, *apart = measure(bars, (False, True) if given.independent else (False,))
    print(
        f"{bars} bars of {PARTICLES} particles, {STEPS} steps each: {one:.1f} processor seconds one after another, "
        f"{together:.1f} as one simulation, {one / together:.1f} times less"
    )
    for seconds in apart:
        print(f"as independent runs of one simulation: {seconds:.1f}, {one / seconds:.1f} times less")


if __name__ == "__main__":
    main()
