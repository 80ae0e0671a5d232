"""What the memory of a simulation goes to: each array's bytes per particle, what reads it, and while what it is needed.

``python -m warp_eulsph.bench.memory [case]`` prints it for a case of ``cases.py``, the most first.
"""

import re
import sys
from collections.abc import Sequence

import warp as wp

from ..memory import memory_by_names
from ..simulation import Simulation
from .cases import CASES, BenchCase

# Blocks that take less [bytes per particle] are one line, "the rest"
LEAST = 2.0
#: Ends of the names of arrays -> what reads them, and from when to when in a step they must be there.
USES = {
    "rows.index": "every sum over neighbours; always",
    "rows.w": "tie and M9, M5 and its sharpening; always",
    "rows.own": "M4 and its sharpening, M5 and its sharpening; always",
    "rows.start": "every sum over neighbours; always",
    "pairs.rows": "tie and M9; within their pass",
    "_rows": "sharpening of M4 and of M5; within their passes",
    "stress_rows": "M5; from its sharpening on",
    "U.F": "M1, tie, books; always",
    "U.x": "tie, conditions, output; always",
    "U.v": "M4, M9, books; always",
    "U.surface": "output, pressures; always",
    "half.F": "M1, tie; from the half step to the forces; as ∇v the next step; from its end to that",
    "half.x": "tie, contact; from the half step to the forces",
    "half.v": "the full step, books; from the half step to the books",
    "grad_v": "M1, M9, both drifts, books; from the start of a step to the books",
    "K": "M4, M5, Courant number; always",
    "fields.Q": "M5, books; from the stress to the books",
    "fields.tie": "books; from the tie to the books",
    "fields.x": "every sum over neighbours; always",
    "fields.V": "M5, tie, M9, books; always",
    "fields.h": "search, interpolation; always",
    "fields.moment": "M5; always",
    "fields.resolution": "time step; always",
    "fields.row": "smoothing (M7); always",
    "fields.diagonal": "mismatch in output; always",
    "fields.speed": "output, sensors; from the time step on",
    "fields.impedance": "M9; from the time step to the forces",
    "fields.shear_impedance": "M9; from the time step to the forces",
    "forces.internal": "kick, books; from the forces to the books",
    "forces.dissipation": "kick, books; from the forces to the books",
    "forces.tie": "kick, books; from the forces to the books",
    "forces.free_v": "books; from the kick to the books",
    "forces.reaction": "output; from the books on",
    "ledger.v_old": "books; from the books of a step to those of the next",
    "ledger._W_old": "books; from the books of a step to those of the next",
    "ledger._W": "books; within their pass",
    "particles.outward": "contact, faces; always",
    "particles.mass": "kick, time step, books; always",
    "particles.V0": "time step, books; always",
    "particles.h": "refresh, order in memory; always",
    "particles.spacing": "output, contact, order in memory; always",
    "particles.share": "books; always",
    "particles.body": "search, constants of laws; always",
    "order.ids": "conditions, output; always",
    "_places": "order in memory; at the start",
    "poor": "check of the start; then",
}


def use_of(name: str) -> str | None:
    """What is known of an array by its name; None if nothing is."""
    ends = [end for end in USES if name == end or name.endswith("." + end)]
    return USES[max(ends, key=len)] if ends else None


def table(simulation: Simulation) -> list[tuple[float, str, str]]:
    """(bytes per particle, names, uses) of each block of memory, most first; what takes little is the last line."""
    n = len(simulation.x)
    lines, rest = [], 0.0
    for names, size in memory_by_names(simulation):
        if size < LEAST * n:
            rest += size / n
            continue
        short = [re.sub(r"^\.(stepper\.)?(media\[0\]\.)?", "", name) for name in names]
        uses = [use for use in map(use_of, short) if use is not None]
        lines.append((size / n, ", ".join(short), "; or ".join(dict.fromkeys(uses))))
    return [*lines, (rest, "the rest", "")]


def main(arguments: Sequence[str]) -> int:
    """Print the table of a case, the three-dimensional total Lagrangian one in float32 if none is named; the status."""
    wp.config.log_level = wp.LOG_WARNING
    name = arguments[0] if arguments else "total-3d-float32"
    chosen: list[BenchCase] = [case for case in CASES if case.name == name]
    if not chosen:
        print(f"no case is named {name!r}; there are: {', '.join(case.name for case in CASES)}", file=sys.stderr)
        return 2
    simulation = chosen[0].build()
    simulation.step()
    n, lines = len(simulation.x), table(simulation)
    print(f"{name}: {n} particles, {simulation.configuration.lists.pairs / n:.1f} neighbours")
    print(f"{sum(size for size, _, _ in lines):7.0f} bytes per particle")
    for size, names, uses in lines:
        print(f"{size:7.1f} {names:46} {uses}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
