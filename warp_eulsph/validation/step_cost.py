"""Error against processor time: the paper's step and Verlet's, each at several Courant numbers.

    python -m warp_eulsph.validation.step_cost            python -m warp_eulsph.validation.step_cost --quick

A spinning plate and a twisting column, total Lagrangian and Eulerian. The error is that of time alone: positions
against the same particles at CFL 0.1. A step that fails is shown as failed.
"""

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from ..scheme.health import UnstableError
from ..scheme.lax_wendroff import LaxWendroff
from ..scheme.policy import Always, Never, ReferencePolicy
from ..scheme.smoothing import LinearExact
from ..scheme.time_step import TimeStep
from ..scheme.verlet import Verlet
from ..simulation import Simulation
from .cases import spinning_plate, twisting_column

#: The operators of Lax-Wendroff, so that time alone makes the difference.
PLAIN = Verlet(tie=None, tilt=None, sharpening=None)
STEPS = {
    "Lax-Wendroff": (LaxWendroff(), (0.2, 0.4, 0.6, 0.8)),
    "Lax-Wendroff, theta 1/4": (LaxWendroff(smoothing=LinearExact(0.25)), (0.4, 0.6)),
    "Verlet": (PLAIN, (0.4, 0.8, 1.0, 1.2)),
}
#: Builders, particles across when quick and in full, and end times [s].
PROBLEMS = {
    "spinning plate": (spinning_plate.build, 12, 24, 0.05),
    "twisting column": (twisting_column.build, 4, 6, 0.09),
}


def measure(
    build: Callable[..., Simulation], n: int, end: float, reference: ReferencePolicy, step: Any, cfl: float
) -> str:
    """Positions against the same run at CFL 0.1, energy and spin kept, steps, processor time."""
    fine = build(n, reference, scheme=PLAIN, time_step=TimeStep(cfl=0.1))
    fine.run(end)
    simulation = build(n, reference, scheme=step, time_step=TimeStep(cfl=cfl))
    simulation.step()  # compiles
    energy, spin = simulation.energy()["total"], simulation.angular_momentum()
    start = time.process_time()
    try:
        simulation.run(end)
    except UnstableError:
        return "failed | | | |"
    seconds = time.process_time() - start
    moved = np.linalg.norm(fine.x - fine.bodies[0].x)
    error = np.linalg.norm(simulation.x - fine.x) / moved
    left = simulation.energy()["total"] / energy
    turned = np.abs(simulation.angular_momentum() - spin).max() / np.abs(spin).max()
    lost = "held" if simulation.boundaries else f"{turned:.1e}"
    return f"{error:.1e} | {left:.4f} | {lost} | {simulation.steps} | {seconds:.1f}"


def main(argv: list[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="coarse: a minute")
    args = parser.parse_args(argv)
    wp.config.log_level = wp.LOG_WARNING
    print("| problem | reference | step | CFL | time error of x | energy kept | spin lost | steps | seconds |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name, (build, coarse, full, end) in PROBLEMS.items():
        n = coarse if args.quick else full
        for reference in (Never(), Always()):
            for step, (scheme, numbers) in STEPS.items():
                for cfl in numbers:
                    row = measure(build, n, end, reference, scheme, cfl)
                    print(f"| {name} {n} | {type(reference).__name__} | {step} | {cfl} | {row} |", flush=True)


if __name__ == "__main__":
    main()
