"""What snapshots cost a run: wall time of its steps with one snapshot per 50 steps, and without.

    python -m warp_eulsph.bench.snapshot_cost [--side N] [--steps N] [--rounds N]

Runs with and without take turns. The stall is what a step with a snapshot takes longer than the median step: the copy
that the stepping thread waits for. The cost is of all steps: the background writer takes its share of the cores too.
What a snapshot takes of a processor in all stands beside what the disk alone takes for the same bytes.
"""

import argparse
import statistics
import tempfile
import time
from dataclasses import dataclass, field
from typing import Any

import warp as wp

from ..output import Recording, SnapshotWriter, record
from ..output.atomic import replace_file
from ..schedule import AtTimes, EverySteps
from ..simulation import Simulation
from .cases import BenchCase

EVERY = 50  # steps between snapshots


@dataclass
class _Watch:
    """Notes when each step ended, and stops the run after ``most`` steps."""

    most: int
    ends: list[float] = field(default_factory=list)

    def __call__(self, simulation: Simulation) -> None:
        self.ends.append(time.perf_counter())

    def reason(self) -> str | None:
        return "enough steps" if len(self.ends) >= self.most - 1 else None

    @property
    def steps(self) -> list[float]:
        """Wall time of each step but the first [s]."""
        return [later - earlier for earlier, later in zip(self.ends, self.ends[1:], strict=False)]


def time_steps(case: BenchCase, steps: int, snapshots: bool) -> list[float]:
    """Wall time [s] of steps 2 to ``steps`` of a recorded run; step k is entry k − 2."""
    simulation = case.build()
    watch: Any = _Watch(steps)  # has what record asks of a Stop
    simulation.step(2)  # compiles
    kept = Recording(snapshots=EverySteps(EVERY) if snapshots else AtTimes(), log=EverySteps(10**9))
    with tempfile.TemporaryDirectory() as folder:
        record(simulation, folder, simulation.t + 1e3 * simulation.dt * steps, kept, stop=watch, watch=watch)
    return watch.steps


def processor_seconds(case: BenchCase, rounds: int) -> tuple[float, float]:
    """Processor seconds of a snapshot, the lists of all snapshots with it, and of its bytes forced to disk; medians."""
    simulation = case.build()
    simulation.step(2)
    whole, alone = [], []
    with tempfile.TemporaryDirectory() as folder:
        writer = SnapshotWriter(folder)
        for _ in range(rounds):
            simulation.step()
            start = time.process_time()
            path = writer.write(simulation)
            whole.append(time.process_time() - start)
            content = path.read_bytes()
            start = time.process_time()
            replace_file(path.with_name("plain"), content)
            alone.append(time.process_time() - start)
    return statistics.median(whole), statistics.median(alone)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Print and return the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=58, help="particles along each side of a cube; 58 are 195 112")
    parser.add_argument("--steps", type=int, default=160, help="of each run")
    parser.add_argument("--rounds", type=int, default=2, help="of one run with and one without")
    args = parser.parse_args(argv)
    wp.config.log_level = wp.LOG_WARNING
    case = BenchCase("snapshots", 3, "float32", "total", args.side)
    plain: list[float] = []
    kept: list[float] = []
    stalls: list[float] = []
    for _ in range(args.rounds):
        plain += time_steps(case, args.steps, snapshots=False)
        times = time_steps(case, args.steps, snapshots=True)
        kept += times
        median = statistics.median(times)
        # two steps were taken before the run, and the first of the run has no beginning
        stalls += [time - median for k, time in enumerate(times, start=4) if k % EVERY == 0]
    step = statistics.median(plain)
    whole, alone = processor_seconds(case, 2 + 5 * args.rounds)
    figures = {
        "step_ms": 1e3 * step,
        "stall_ms": 1e3 * statistics.median(stalls),
        "stall_percent": 100.0 * statistics.median(stalls) / (EVERY * step),
        "processor_ms": 1e3 * whole,
        "disk_ms": 1e3 * alone,
        "cost_percent": 100.0 * (statistics.mean(kept) / statistics.mean(plain) - 1.0),
    }
    print(f"{args.side**3} particles, float32, total Lagrangian, one snapshot per {EVERY} steps")
    print(f"median step without snapshots    {figures['step_ms']:.1f} ms")
    print(f"a snapshot holds its step up by  {figures['stall_ms']:.1f} ms")
    print(f"which is, of {EVERY} steps           {figures['stall_percent']:.2f} %")
    print(f"all steps, with and without      {figures['cost_percent']:+.1f} %")
    print(f"processor time of a snapshot     {figures['processor_ms']:.1f} ms")
    print(f"of its bytes to disk alone       {figures['disk_ms']:.1f} ms")
    return figures


if __name__ == "__main__":
    main()
