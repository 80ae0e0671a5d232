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

from ..boundaries import Fixed
from ..geometry import box
from ..scheme.health import UnstableError
from ..scheme.lax_wendroff import LaxWendroff
from ..scheme.reference import Always, Never, ReferencePolicy
from ..scheme.smoothing import LinearExact
from ..scheme.time_step import TimeStep
from ..scheme.verlet import Verlet
from ..simulation import Body, Simulation
from .solids import RUBBER

STEPS = {
    "Lax-Wendroff": (LaxWendroff(), (0.2, 0.4, 0.6, 0.8)),
    "Lax-Wendroff, theta 1/4": (LaxWendroff(smoothing=LinearExact(0.25)), (0.4, 0.6)),
    "Verlet": (Verlet(), (0.4, 0.8, 1.0, 1.2)),
}
Problem = tuple[Simulation, float]


def plate(n: int, reference: ReferencePolicy, **options: Any) -> Problem:
    """Rubber plate of n² particles spinning at 105 rad/s, for 50 ms."""
    x, volume = box((-0.5, -0.5), (0.5, 0.5), 1.0 / n)
    body = Body(x=x, volume=volume, material=RUBBER, velocity=105.0 * np.c_[-x[:, 1], x[:, 0]])
    return Simulation(body, reference=reference, **options), 0.05


def column(n: int, reference: ReferencePolicy, **options: Any) -> Problem:
    """Twisting column, n across, up to its largest rotation."""
    spacing = 1.0 / n
    x, volume = box((-0.5, 0.0, -0.5), (0.5, 6.0, 0.5), spacing)
    spin = 105.0 * np.sin(np.pi * x[:, 1] / 12.0)
    velocity = np.stack([spin * x[:, 2], np.zeros(len(x)), -spin * x[:, 0]], axis=1)
    body = Body(x=x, volume=volume, material=RUBBER, velocity=velocity)
    return Simulation(body, boundaries=[Fixed(lambda X: X[:, 1] < spacing)], reference=reference, **options), 0.09


def measure(problem: Callable[..., Problem], n: int, reference: ReferencePolicy, scheme: Any, cfl: float) -> str:
    """Positions against the same run at CFL 0.1, energy and spin kept, steps, processor time."""
    fine, end = problem(n, reference, scheme=Verlet(), time_step=TimeStep(cfl=0.1))
    fine.run(end)
    simulation, _ = problem(n, reference, scheme=scheme, time_step=TimeStep(cfl=cfl))
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
    problems = {
        "spinning plate": (plate, 12 if args.quick else 24),
        "twisting column": (column, 4 if args.quick else 6),
    }
    print("| problem | reference | step | CFL | time error of x | energy kept | spin lost | steps | seconds |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name, (problem, n) in problems.items():
        for reference in (Never(), Always()):
            for step, (scheme, numbers) in STEPS.items():
                for cfl in numbers:
                    row = measure(problem, n, reference, scheme, cfl)
                    print(f"| {name} {n} | {type(reference).__name__} | {step} | {cfl} | {row} |", flush=True)


if __name__ == "__main__":
    main()
