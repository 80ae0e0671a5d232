"""``warp-eulsph bench``: time the cases against the limits of the machine, measured in the same run."""

import functools
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, field

import warp as wp

from .. import execution
from ..memory import array_bytes
from .cases import CASES, DTYPES, STEPS_PER_REFRESH, BenchCase
from .machine import arithmetic, bandwidth
from .phases import OTHER, PhaseClock
from .roof import least_seconds

WARM_UP, ROUNDS = 3, 5
SECONDS_PER_ROUND = 0.5
# Of a round: in 1-D the positions of 20 000 particles in float32 are known to a thousandth of a spacing only, and where
# the reference moves that feeds energy over thousands of steps (docs/method.md, §9).
MOST_STEPS = 100


@dataclass
class Result:
    """What was measured of one case; rates are medians over rounds of steps.

    ``roof_fraction`` is the least time of a step on this machine (see ``roof.py``) over the processor time of a thread;
    ``cpu_fraction`` how much of the threads' time the machine gave to the process: where others use it, rates per
    second say little and those per processor second more.
    """

    case: str
    dim: int
    dtype: str
    mode: str
    particles: int
    neighbours: float
    threads: int
    particle_steps_per_second: float
    particle_steps_per_cpu_second: float
    roof_fraction: float
    cpu_fraction: float
    bytes_per_particle: float
    bandwidth: float
    arithmetic: float
    phases: dict[str, float] = field(default_factory=dict)
    start_up: dict[str, float] | None = None


def bench(select: str = "", as_json: bool = False, start_up: bool = False) -> int:
    """Run the cases whose name contains ``select`` and print what was measured; the exit status."""
    chosen = [case for case in CASES if select in case.name]
    if not chosen:
        print(f"no case is named like {select!r}; there are: {', '.join(case.name for case in CASES)}", file=sys.stderr)
        return 2
    wp.config.log_level = wp.LOG_WARNING
    threads = execution.threads()
    results = []
    try:
        for case in chosen:
            results.append(run(case))
            if start_up:
                results[-1].start_up = start_up_seconds(case)
            if not as_json:
                print(line(results[-1]), flush=True)
    finally:
        execution.set_threads(threads)
    if as_json:
        print(json.dumps([asdict(result) for result in results], indent=1))
    return 0


def run(case: BenchCase) -> Result:
    """Build a case, warm up, and time its steps."""
    execution.set_threads(case.threads)
    simulation = case.build()
    n = len(simulation.x)
    simulation.step(WARM_UP)
    start = time.perf_counter()
    simulation.step()
    # Whole periods of refreshes in every round
    period = STEPS_PER_REFRESH if case.mode == "every_k" else 1
    steps = period * max(1, round(SECONDS_PER_ROUND / (period * (time.perf_counter() - start))))
    steps = min(steps, MOST_STEPS)
    wall, cpu = [], []
    for _ in range(ROUNDS):
        wall_start, cpu_start = time.perf_counter(), time.process_time()
        simulation.step(steps)
        wall.append((time.perf_counter() - wall_start) / steps)
        cpu.append((time.process_time() - cpu_start) / steps)
    simulation.by_graphs = False  # graphs do not tell of phases
    clock = PhaseClock(simulation.stepper)
    start = time.process_time()
    simulation.step(steps)
    total = time.process_time() - start
    phases = dict(clock.seconds) | {OTHER: total - sum(clock.seconds.values())}
    neighbours = simulation.stepper.configuration.lists.pairs / n
    limits = limits_of(case.dtype, case.threads)
    least = least_seconds(simulation, case.mode, neighbours, *limits)
    seconds, cpu_seconds = statistics.median(wall) / n, statistics.median(cpu) / n
    return Result(
        case=case.name,
        dim=case.dim,
        dtype=case.dtype,
        mode=case.mode,
        particles=n,
        neighbours=round(neighbours, 2),
        threads=case.threads,
        particle_steps_per_second=1.0 / seconds,
        particle_steps_per_cpu_second=1.0 / cpu_seconds,
        roof_fraction=least / (cpu_seconds / case.threads),
        cpu_fraction=cpu_seconds / (case.threads * seconds),
        bytes_per_particle=array_bytes(simulation) / n,
        bandwidth=limits[0],
        arithmetic=limits[1],
        phases={phase: 1e9 * spent / (steps * n) for phase, spent in sorted(phases.items(), key=lambda item: -item[1])},
    )


@functools.cache
def limits_of(dtype: str, threads: int) -> tuple[float, float]:
    """Bandwidth [byte/s] and operations [1/s] of the machine with that many threads."""
    execution.set_threads(threads)
    return bandwidth(DTYPES[dtype]), arithmetic(DTYPES[dtype])


def start_up_seconds(case: BenchCase) -> dict[str, float]:
    """Seconds of a fresh process that takes one small step of the case, of the processor and on the clock.

    ``cold`` compiles the kernels, ``warm`` takes them from the cache.
    """
    code = (
        "import dataclasses, sys; from warp_eulsph.bench.cases import CASES\n"
        "case = next(case for case in CASES if case.name == sys.argv[1])\n"
        "dataclasses.replace(case, side=8).build().step()"
    )
    seconds = {}
    with tempfile.TemporaryDirectory() as cache:
        for start in ("cold", "warm"):
            before = os.times()
            environment = {**os.environ, "WARP_CACHE_PATH": cache}
            subprocess.run([sys.executable, "-c", code, case.name], env=environment, check=True, capture_output=True)
            after = os.times()
            user, system = after.children_user - before.children_user, after.children_system - before.children_system
            seconds[f"{start}_cpu"], seconds[f"{start}_clock"] = user + system, after.elapsed - before.elapsed
    return seconds


def line(result: Result) -> str:
    """One result for people: rates, memory, and the phases that take most."""
    rate, core = result.particle_steps_per_second / 1e6, result.particle_steps_per_cpu_second / 1e6
    text = (
        f"{result.case}: {rate:.3f} M particle-steps/s ({core:.3f} M per processor second), "
        f"{result.particles} particles, {result.neighbours} neighbours, {result.threads} threads, "
        f"{100 * result.roof_fraction:.0f} % of the roof ({result.bandwidth / 1e9:.0f} GB/s, "
        f"{result.arithmetic / 1e9:.0f} Gflop/s), {result.bytes_per_particle:.0f} bytes per particle"
    )
    if result.start_up is not None:
        for start in ("cold", "warm"):
            cpu, clock = result.start_up[f"{start}_cpu"], result.start_up[f"{start}_clock"]
            text += f", {start} start {cpu:.1f} processor seconds, {clock:.1f} on the clock"
    phases = ", ".join(f"{phase} {spent:.0f}" for phase, spent in result.phases.items() if spent >= 1.0)
    return f"{text}\n    processor time per particle-step [ns]: {phases}"
