"""Which form of the reference holds at which distortion: runs, verdicts, table and picture of docs/distortion.md.

    python -m warp_eulsph.validation.distortion_map [--quick] [--output DIR]

Problems × references × resolutions; each run passes through increasing distortion and is judged at every mark:
*accurate* (error below 5 %), *stable* (it goes on), or *failed*, with the reason: a particle inverted or not finite,
energy gained out of nothing, an error above 50 %. *Stalled* runs stayed stable until their steps had become too small
to go on. Writes ``distortion.md``, ``distortion.csv`` and ``distortion_map.png`` after every problem.
"""

import argparse
import logging
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import warp as wp

from .. import (
    Always,
    Current,
    Every,
    PairAreas,
    ReferencePolicy,
    Shifting,
    Simulation,
    SurfaceVectors,
    UnstableError,
    Verlet,
    WhenDistorted,
)
from . import verdict_maps
from .distortion_problems import PROBLEMS, Problem

_log = logging.getLogger(__name__)

ACCURATE = 0.05
WRONG = 0.5  # a state that lost half of what it should be; a run that forgets its stress errs by 100 % at most
GAIN = 0.1  # energy out of nothing, over the present energy: what failing runs exceed within a few steps
MOST_STEPS = 30_000
LEAST_STEP = 1e-4  # of the first: a hundredth is a shear of ten, total Lagrangian

#: Name -> reference, and options of the simulation; those that begin with "current" read the arrangement anew.
REFERENCES: dict[str, tuple[ReferencePolicy, dict[str, Any]]] = {
    "default": (Always(), {}),
    "default, no tie": (Always(), {"scheme": Verlet(tie=None)}),
    "current": (Always(), {"arrangement": Current()}),
    "current, every 10": (Every(10), {"arrangement": Current()}),
    "current, criterion": (WhenDistorted(1.2), {"arrangement": Current()}),
    "current, shifted": (
        Always(),
        {"arrangement": Current(), "scheme": Verlet(shifting=Shifting())},
    ),
    "current, M11": (
        Always(),
        {"arrangement": Current(), "scheme": Verlet(correction=PairAreas(kappa=math.inf))},
    ),
    "current, M10": (Always(), {"arrangement": Current(), "scheme": Verlet(correction=SurfaceVectors())}),
}
QUICK = ("default", "current")


@dataclass(frozen=True)
class Verdict:
    """One cell of the map."""

    problem: str
    reference: str
    level: int
    distortion: float
    verdict: str
    error: float | None
    reason: str
    steps: int


def judge(problem: Problem, name: str, level: int) -> Iterator[Verdict]:
    """Run one problem with one reference; a verdict at each mark."""
    reference, options = REFERENCES[name]
    run = problem.start(level, reference, **options)
    simulation, start = run.simulation, run.simulation.energy()["total"]
    simulation.step()
    least = LEAST_STEP * simulation.dt
    ended: tuple[str, str] | None = None
    for distortion, mark in problem.marks.items():
        error = None
        try:
            while ended is None and simulation.t < mark:
                left = mark - simulation.t
                if _advance(simulation, mark if left < 1.5 * problem.frame else simulation.t + problem.frame, least):
                    error = run.error()
                else:
                    ended = ("stalled", f"{simulation.steps} steps taken, the last of {simulation.dt:.2g} s")
        except UnstableError as raised:
            what = str(raised).split(" has ")[-1].split(";")[0].split(", v =")[0].split(", must")[0]
            ended = ("failed", f"{what} at {1e3 * raised.time:.4g} ms")
        verdict, reason = ended or _grade(simulation, start, error)
        yield Verdict(
            problem.name, name, level, distortion, verdict, None if ended else error, reason, simulation.steps
        )
        if verdict == "failed":
            ended = verdict, reason  # what follows is not worth its time


def _advance(simulation: Simulation, until: float, least: float) -> bool:
    """Step to the time ``until`` [s]; False once ``MOST_STEPS`` are taken, or steps are shorter than ``least`` [s]."""
    while until - simulation.t > 2.0 * simulation.clock.free_dt:  # the last step may have been cut to hit a time
        simulation.step()
        if simulation.steps > MOST_STEPS or simulation.dt < least:
            return False
    simulation.run(until)
    return True


def _grade(simulation: Simulation, start: float, error: float | None) -> tuple[str, str]:
    energy = simulation.energy()
    gained = energy["total"] - start - energy["external"] - energy["constraint"]
    if gained > GAIN * energy["total"]:
        return "failed", f"energy gained: {100.0 * gained / energy['total']:.3g} % of what there is"
    if error is not None and error > WRONG:
        return "failed", f"error above {100.0 * WRONG:g} %"
    return ("accurate" if error is not None and error < ACCURATE else "stable"), ""


def run(problems: Sequence[Problem], names: Sequence[str], quick: bool, output: Path) -> list[Verdict]:
    """Fill the map; the files are written anew after each problem."""
    verdicts: list[Verdict] = []
    output.mkdir(parents=True, exist_ok=True)
    for problem in problems:
        for level in problem.levels[:1] if quick else problem.levels:
            for name in names:
                row = list(judge(problem, name, level))
                verdicts += row
                shown = ", ".join(f"{v.distortion:g}: {v.verdict} {_percent(v.error)} {v.reason}" for v in row)
                _log.info("%s %d %s: %s", problem.name, level, name, shown)
        (output / "distortion.md").write_text(table(verdicts), encoding="utf-8")
        verdict_maps.write_csv(Verdict, verdicts, output / "distortion.csv")
        draw(verdicts, output / "distortion_map.png")
    return verdicts


def _percent(error: float | None) -> str:
    return "" if error is None else f"{100.0 * error:.2g} %"


def _groups(verdicts: Sequence[Verdict]) -> Iterator[tuple[Problem, int, list[str], list[float], dict[Any, Verdict]]]:
    """Each problem and level with its references, distortions and cells by (reference, distortion)."""
    problems = {problem.name: problem for problem in PROBLEMS}
    for name, level in dict.fromkeys((v.problem, v.level) for v in verdicts):
        cells = {(v.reference, v.distortion): v for v in verdicts if (v.problem, v.level) == (name, level)}
        references = list(dict.fromkeys(reference for reference, _ in cells))
        marks = list(dict.fromkeys(mark for _, mark in cells))
        yield problems[name], level, references, marks, cells


def table(verdicts: Sequence[Verdict]) -> str:
    """Markdown: per problem and level one table, the error in each cell, and why runs ended."""
    lines = []
    for problem, level, names, marks, cells in _groups(verdicts):
        lines += [f"**{problem.name}, {level}** (error {problem.error})", ""]
        lines += [f"| {problem.distortion} | " + " | ".join(f"{mark:g}" for mark in marks) + " | why it ended |"]
        lines += ["|---" * (len(marks) + 2) + "|"]
        for name in names:
            row = [cells[name, mark] for mark in marks]
            shown = [f"{v.verdict} {_percent(v.error)}".strip() for v in row]
            reason = next((v.reason for v in row if v.reason), "")
            lines.append(f"| {name} | " + " | ".join(shown) + f" | {reason} |")
        lines.append("")
    return "\n".join(lines)


COLOURS = {"accurate": "#4c9f70", "stable": "#e9d985", "stalled": "#b8b8b8", "failed": "#c8553d"}


def draw(verdicts: Sequence[Verdict], path: Path) -> None:
    """The map: one panel per problem and level, references downwards, distortion to the right."""
    panels = [
        verdict_maps.Panel(
            title=f"{problem.name}, {level}",
            along=problem.distortion,
            rows=names,
            columns=marks,
            cells=[
                [(cells[name, mark].verdict, _percent(cells[name, mark].error)) for mark in marks] for name in names
            ],
        )
        for problem, level, names, marks, cells in _groups(verdicts)
    ]
    verdict_maps.draw(panels, COLOURS, path, panel_size=(5.5, 2.6), label_size="medium")


def main(argv: Sequence[str] | None = None) -> list[Verdict]:
    """Run the map; every verdict."""
    known = [problem.name for problem in PROBLEMS]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="coarse resolution and two forms only")
    parser.add_argument("--only", nargs="+", choices=known, default=known, help="problems to run")
    parser.add_argument("--output", type=Path, default=Path("runs/distortion"))
    args = parser.parse_args(argv)
    wp.config.log_level = wp.LOG_WARNING
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    chosen = [problem for problem in PROBLEMS if problem.name in args.only]
    return run(chosen, QUICK if args.quick else tuple(REFERENCES), args.quick, args.output)


if __name__ == "__main__":
    main()
