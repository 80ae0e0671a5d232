"""What each kernel of a step takes, per particle and, of those that sum over neighbours, per pair.

``python -m warp_eulsph.bench.passes [case …]`` prints it for cases of ``cases.py``, on one thread, the most first.
They take their rounds in turns, so that one can be held against another.
"""

import statistics
import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import warp as wp

from .. import execution
from ..simulation import Simulation
from .cases import CASES, BenchCase

WARM_UP, ROUNDS, SECONDS = 3, 9, 2.0  # steps, and rounds that take this together
# Kernels that take less [ns per particle] are not listed
LEAST = 1.0


@contextmanager
def timed_kernels() -> Iterator[defaultdict[wp.Kernel, float]]:
    """Processor seconds of each kernel that is launched within the context."""
    seconds: defaultdict[wp.Kernel, float] = defaultdict(float)
    kept = {name: getattr(execution.Launcher, name) for name in ("__call__", "once")}

    def timed(launch: Any) -> Any:
        def launch_timed(self: execution.Launcher, kernel: wp.Kernel, *arguments: Any, **named: Any) -> None:
            start = time.process_time()
            launch(self, kernel, *arguments, **named)
            seconds[kernel] += time.process_time() - start

        return launch_timed

    for name, launch in kept.items():
        setattr(execution.Launcher, name, timed(launch))
    try:
        yield seconds
    finally:
        for name, launch in kept.items():
            setattr(execution.Launcher, name, launch)


def rounds_of(simulations: Sequence[Simulation], rounds: int = ROUNDS) -> list[list[dict[wp.Kernel, float]]]:
    """Processor time of each kernel per particle and step [ns], of each simulation in each of its rounds of steps.

    They take their rounds in turns.
    """
    steps: list[int] = []
    found: list[list[dict[wp.Kernel, float]]] = [[] for _ in simulations]
    for simulation in simulations:
        simulation.by_graphs = False  # graphs do not tell of kernels
        simulation.step(WARM_UP)
        start = time.process_time()
        simulation.step()
        steps.append(max(1, round(SECONDS / max(time.process_time() - start, 1e-9) / rounds)))
    for _ in range(rounds):
        for simulation, count, times in zip(simulations, steps, found, strict=True):
            with timed_kernels() as seconds:
                simulation.step(count)
            each = 1e9 / (count * len(simulation.particles.mass))
            times.append({kernel: each * spent for kernel, spent in seconds.items()})
    return found


def tables(cases: Sequence[BenchCase], rounds: int = ROUNDS) -> list[str]:
    """The kernels of each case's step, a line each, medians of rounds, most first.

    Of all cases but the first, how much dearer a step is than that one's in the same round.
    """
    execution.set_threads(1)
    simulations = [case.build() for case in cases]
    found = rounds_of(simulations, rounds)
    totals = [[sum(times.values()) for times in of_case] for of_case in found]
    out = []
    for case, simulation, of_case, total in zip(cases, simulations, found, totals, strict=True):
        beside = ""
        if total is not totals[0]:
            dearer = statistics.median(mine / first for mine, first in zip(total, totals[0], strict=True))
            beside = f", {100.0 * (dearer - 1.0):+.1f} %"
        neighbours = simulation.configuration.lists.pairs / len(simulation.x)
        head = f"{statistics.median(total):.0f} ns per particle-step in kernels{beside}, {neighbours:.1f} neighbours"
        out.append("\n".join([f"{case.name}: {head}", *_lines(of_case, neighbours)]))
    return out


def _lines(rounds: Sequence[dict[wp.Kernel, float]], neighbours: float) -> Iterator[str]:
    medians = {kernel: statistics.median(times.get(kernel, 0.0) for times in rounds) for kernel in rounds[0]}
    for kernel, spent in sorted(medians.items(), key=lambda item: -item[1]):
        if spent >= LEAST:
            name = f"{kernel.func.__module__.split('.')[-1]}.{kernel.func.__name__}"
            sums = any(argument.label == "near" for argument in kernel.adj.args)
            yield f"{name:40} {spent:6.0f}" + (f" {spent / neighbours:7.2f} per pair" if sums else "")


def main(arguments: Sequence[str]) -> int:
    """Print the tables of cases, the three-dimensional total Lagrangian ones if none is named; the exit status."""
    wp.config.log_level = wp.LOG_WARNING
    names = arguments or ("total-3d-float64", "total-3d-float32")
    known = {case.name: case for case in CASES}
    wrong = [name for name in names if name not in known]
    if wrong:
        print(f"no case is named {wrong[0]!r}; there are: {', '.join(known)}", file=sys.stderr)
        return 2
    print("\n".join(tables([known[name] for name in names])), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
