"""What the benchmarks gave at a release, kept in the repository with the machine that gave it.

    python -m warp_eulsph.bench.release            writes bench/VERSION.json; a few minutes on a quiet machine

One case of each mode, dimension and precision, on one thread. Figures of different machines cannot be compared as they
are; each says by ``roof_fraction`` how near it came to what its machine can do, and by ``cpu_fraction`` how quiet that
machine was.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from .. import execution
from ..output.environment import environment
from .cases import CASES, DTYPES, MODES, BenchCase
from .command import line, run

#: In a clone of the repository.
FOLDER = Path(__file__).parents[2] / "bench"


def cases() -> list[BenchCase]:
    """The plain case of each mode, dimension and precision."""
    names = {f"{mode}-{dim}d-{dtype}" for mode in MODES for dim in (1, 2, 3) for dtype in DTYPES}
    return [case for case in CASES if case.name in names]


def release(chosen: Sequence[BenchCase]) -> dict[str, Any]:
    """Version, date, machine and results, as JSON takes them."""
    results = []
    for case in chosen:
        results.append(run(case))
        print(line(results[-1]), flush=True)
    place = environment(chosen[0].build())
    machine = {**place["device"], **place["machine"], "cores": execution.cores()}
    return {
        "version": metadata.version("warp_eulsph"),
        "date": str(np.datetime64("today")),
        "machine": machine,
        "versions": place["versions"],
        "results": [asdict(result) for result in results],
    }


def main(argv: Sequence[str] | None = None) -> Path:
    """Write the figures of this version; where they are."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", type=Path, default=FOLDER, metavar="FOLDER", help="where to; bench/ by default")
    folder = parser.parse_args(argv).o
    wp.config.log_level = wp.LOG_WARNING
    figures = release(cases())
    folder.mkdir(exist_ok=True)
    path = folder / f"{figures['version']}.json"
    path.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    return path


if __name__ == "__main__":
    main()
