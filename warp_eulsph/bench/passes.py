"""What each kernel of a step takes, per particle and, of those that sum over neighbours, per pair.

``python -m warp_eulsph.bench.passes [case]`` prints it for a case of ``cases.py``, on one thread, the most first.
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

WARM_UP, ROUNDS, SECONDS_PER_ROUND = 3, 5, 1.0
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


def kernel_times(simulation: Simulation, rounds: int = ROUNDS) -> dict[wp.Kernel, float]:
    """Processor time of each kernel per particle and step [ns], medians over rounds of steps; most first."""
    simulation.by_graphs = False  # graphs do not tell of kernels
    simulation.step(WARM_UP)
    start = time.process_time()
    simulation.step()
    steps = max(1, round(SECONDS_PER_ROUND / max(time.process_time() - start, 1e-9) / rounds))
    found = defaultdict(list)
    for _ in range(rounds):
        with timed_kernels() as seconds:
            simulation.step(steps)
        for kernel, spent in seconds.items():
            found[kernel].append(1e9 * spent / (steps * len(simulation.particles.mass)))
    medians = {kernel: statistics.median(times) for kernel, times in found.items()}
    return dict(sorted(medians.items(), key=lambda item: -item[1]))


def table(case: BenchCase, rounds: int = ROUNDS) -> str:
    """The kernels of a case's step, a line each."""
    execution.set_threads(1)
    simulation = case.build()
    times, neighbours = kernel_times(simulation, rounds), simulation.configuration.lists.pairs / len(simulation.x)
    lines = [f"{case.name}: {sum(times.values()):.0f} ns per particle-step in kernels, {neighbours:.1f} neighbours"]
    for kernel, spent in times.items():
        if spent >= LEAST:
            name = f"{kernel.func.__module__.split('.')[-1]}.{kernel.func.__name__}"
            sums = any(argument.label == "near" for argument in kernel.adj.args)
            lines.append(f"{name:40} {spent:6.0f}" + (f" {spent / neighbours:7.2f} per pair" if sums else ""))
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> int:
    """Print the table of a case, the three-dimensional total Lagrangian ones if none is named; the exit status."""
    wp.config.log_level = wp.LOG_WARNING
    names = arguments or ("total-3d-float64", "total-3d-float32")
    chosen = [case for case in CASES if case.name in names]
    if not chosen:
        print(f"no case is named {names[0]!r}; there are: {', '.join(case.name for case in CASES)}", file=sys.stderr)
        return 2
    for case in chosen:
        print(table(case), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
