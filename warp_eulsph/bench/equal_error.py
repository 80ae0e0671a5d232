"""Error against processor time: bar, swinging plate and twisting column, per scheme, reference and precision.

    python -m warp_eulsph.bench.equal_error            python -m warp_eulsph.bench.equal_error --quick
    python -m warp_eulsph.bench.equal_error --beside   # an error of 5 % beside what it took in the first release

Each line is one run at the scheme's own Courant number; compare the seconds of lines with like errors. One thread.
"""

import argparse
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from .. import execution
from ..scheme.health import UnstableError
from ..scheme.lax_wendroff import LaxWendroff
from ..scheme.policy import Always, Every, Never
from ..scheme.verlet import Verlet
from ..simulation import Simulation
from ..validation.cases import bar, twisting_column
from ..validation.standing_wave import StandingWave
from ..validation.standing_wave import build as standing_wave

FRAMES = 50


@dataclass(frozen=True)
class Problem:
    """One problem: its set-up with n particles across, the error of a run, and resolutions.

    Args:
        build: (n) -> a simulation, from which bodies and boundaries are taken.
        error: runs a simulation to the end; the relative error.
        options: of every simulation.
        quick: resolutions when quick; full: otherwise.
        single: whether float32 resolves it.
    """

    build: Callable[[int], Simulation]
    error: Callable[[Simulation], float]
    options: dict[str, Any]
    quick: tuple[int, ...]
    full: tuple[int, ...]
    single: bool = True


def _bar_error(simulation: Simulation) -> float:
    """Displacement of the last particle over five periods against d'Alembert's, rms over the amplitude."""
    X, squares = simulation.bodies[0].x[-1, 0], []
    for t in simulation.frames(np.linspace(0.0, bar.END_TIME, FRAMES + 1)[1:].tolist()):
        squares.append((simulation.x[-1, 0] - X - bar.exact(X, t)[0]) ** 2)
    return float(np.sqrt(np.mean(squares)) / bar.AMPLITUDE)


def _plate_error(simulation: Simulation) -> float:
    """Velocities after 0.4 periods against the exact standing wave, L2."""
    own = simulation.particles.share.numpy() > 0.0
    exact = StandingWave(simulation.bodies[0].x[own])
    simulation.run(exact.end)
    wanted = exact.velocity(exact.end)
    return float(np.linalg.norm(simulation.v[own] - wanted) / np.linalg.norm(wanted))


def _column_error(simulation: Simulation) -> float:
    """Largest rotation of the top against the spectral-element solution."""
    largest = twisting_column.measure(simulation)["rotation"].max()
    return float(abs(largest / twisting_column.reference_history()["rotation"].max() - 1.0))


def _plate(n: int) -> Simulation:
    return standing_wave(2, n, Never())[0]


PROBLEMS = {
    "bar": Problem(lambda n: bar.build(n, Never()), _bar_error, {"dilation": 1.0}, (40,), (40, 80, 160)),
    # Its displacements are a millionth of its size: float32 does not see them
    "swinging plate": Problem(_plate, _plate_error, {}, (12,), (12, 20, 28), single=False),
    "twisting column": Problem(lambda n: twisting_column.build(n, Never()), _column_error, {}, (4,), (4, 6, 8)),
}


class Run(NamedTuple):
    """What a run took: particles across, error, steps, processor seconds."""

    across: int
    error: float
    steps: int
    seconds: float


#: Coarsest runs within 5 % that were found, total Lagrangian in float64, of commit 115fbdf (the first release) and of
#: the commit that recorded them: both checked out on one machine (AMD EPYC, Zen 4, two cores under other load), their
#: processes run in turns, medians of five; ``measure`` of each.
FIRST_RELEASE = {"twisting column": Run(12, 0.0449, 622, 4.93), "bar": Run(108, 0.0494, 2550, 0.0501)}
RECORDED = {"twisting column": Run(3, 0.0334, 220, 0.065), "bar": Run(14, 0.0499, 400, 0.0146)}
SCHEMES = {"Verlet": Verlet(), "Lax-Wendroff": LaxWendroff()}
REFERENCES = {"total": Never(), "every 10": Every(10), "Eulerian": Always()}


def measure(problem: Problem, n: int, **options: Any) -> tuple[float | None, int, float]:
    """Error (None if the run fails), steps, and processor seconds without compiling."""
    base = problem.build(n)

    def simulation() -> Simulation:
        return Simulation(base.bodies, boundaries=base.boundaries, **problem.options, **options)

    simulation().step(2)  # compiles
    run = simulation()
    start = time.process_time()
    try:
        error = problem.error(run)
    except UnstableError:
        return None, run.steps, time.process_time() - start
    return error, run.steps, time.process_time() - start


def beside() -> None:
    """Print what an error of 5 % took in the first release, and takes now: as recorded, and on this machine."""
    print("| problem | of | across | error | steps | seconds |")
    print("|---|---|---|---|---|---|")
    for name, then in FIRST_RELEASE.items():
        now = RECORDED[name]
        error, steps, seconds = measure(PROBLEMS[name], now.across, reference=Never(), scheme=Verlet())
        here = Run(now.across, math.nan if error is None else error, steps, seconds)
        rows = {"115fbdf": then, "recorded beside it": now, "this machine": here}
        for of, run in rows.items():
            print(f"| {name} | {of} | {run.across} | {run.error:.4f} | {run.steps} | {run.seconds:.3f} |", flush=True)


def main(argv: list[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one coarse resolution each: a minute")
    parser.add_argument("--beside", action="store_true", help="an error of 5 %% now and in the first release: seconds")
    args = parser.parse_args(argv)
    wp.config.log_level = wp.LOG_WARNING
    execution.set_threads(1)
    if args.beside:
        beside()
        return
    print("| problem | across | scheme | reference | precision | error | steps | seconds |")
    print("|---|---|---|---|---|---|---|---|")
    for name, problem in PROBLEMS.items():
        for scheme_name, scheme in SCHEMES.items():
            for reference_name, reference in REFERENCES.items():
                for dtype in (wp.float64, wp.float32)[: 1 + problem.single]:
                    for n in problem.quick if args.quick else problem.full:
                        error, steps, seconds = measure(problem, n, reference=reference, scheme=scheme, dtype=dtype)
                        shown = "failed" if error is None else f"{error:.4f}"
                        what = f"| {name} | {n} | {scheme_name} | {reference_name} | {dtype.__name__}"
                        print(f"{what} | {shown} | {steps} | {seconds:.2f} |", flush=True)


if __name__ == "__main__":
    main()
