"""The least time that a step can take on a machine: its memory traffic or its arithmetic, whichever takes longer.

Passes over the neighbours are counted one by one: what a list entry costs to read, the row of each particle once (rows
of neighbours come from the cache), what is written, and the floating-point operations per pair. Pointwise work is its
memory traffic. A roof is a bound, not a prediction: gathers cost instructions that it does not count.
"""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Pass:
    """One pass over the neighbours.

    Args:
        operations: floating-point operations per pair.
        reals: reals read and written per particle.
        writes_pairs: whether it writes a weight per pair besides reading the lists.
    """

    operations: int
    reals: int
    writes_pairs: bool = False


def passes(dim: int, mode: str, sweeps: int) -> list[tuple[Pass, float]]:
    """Passes of a Verlet step with M9 and M13, and how often a step makes each."""
    d = dim
    gradient = Pass(2 * d + d + 2 * d * d, 2 * d + 2 * d * d)
    forces = Pass((2 * d + 3 * d * d + 2 * d) + (d + 3 * d * d) + (8 * d + 12), 4 * d + 2 * d * d + 2 + 2 * d)
    steps = [(gradient, 2.0), (forces, 1.0)]
    often = {"total": 0.0, "every_k": 0.1, "eulerian": 1.0}[mode]
    refresh = [
        (Pass(5 * (3 * d + 1), 2 * (d + 1)), 1.0),  # search: some five candidates for a neighbour
        (Pass(3 * d + 12 + 3 * d * (d + 1) // 2, d + 3 + d * d + 2, writes_pairs=True), 1.0),  # M3
        (Pass(2 * d + 3 * d * d, d + d * d + d), 1.0),  # defect
        (Pass(2 * d, 3 * d + 1), sweeps - 1.0),  # sweeps of M13
        (Pass(3 * d + 2 * d * d, 2 * d + 2 * d * d), 1.0),  # L of balanced positions
    ]
    return steps + [(one, often * times) for one, times in refresh if often > 0.0]


#: Reals that the pointwise kernels of a step read and write: dt, stress, two drifts, kick, ledger, check.
POINTWISE = {1: 60, 2: 110, 3: 190}


def least_seconds(simulation: Any, mode: str, neighbours: float, bandwidth: float, arithmetic: float) -> float:
    """Least time [s] of a step for one particle at a bandwidth [byte/s] and a rate of operations [1/s]."""
    dim, item = simulation.space.dim, simulation.space.numpy(0).nbytes
    sweeps = getattr(simulation.stepper.options.correction, "sweeps", 0)
    seconds = POINTWISE[dim] * item / bandwidth
    for one, times in passes(dim, mode, sweeps):
        list_bytes = neighbours * (4 + item * (2 if one.writes_pairs else 1))
        traffic = (list_bytes + one.reals * item) / bandwidth
        seconds += times * max(traffic, neighbours * one.operations / arithmetic)
    return seconds
