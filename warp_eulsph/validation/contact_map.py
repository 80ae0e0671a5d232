"""At which speeds and resolutions contact holds: runs, verdicts, table and picture of docs/contact.md.

    python -m warp_eulsph.validation.contact_map [--quick] [--output DIR]

Problems × forms × resolutions × speeds, 2-D. What is measured: the contact's account in the books over the energy of
the start, which is zero if forces are those of their energy; the least distance of two bodies, in spacings; particles
that lie within the other body. A run *holds* (account within 1 %), *leaks* (within 5 %) or *fails* (more, somebody
within the other body, or an end before its time, with the reason). Writes ``contact.md``, ``contact.csv`` and
``contact_map.png`` after every problem.
"""

import argparse
import logging
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from .. import Body, Contact, Current, Material, NeoHookean, Simulation, UnstableError
from ..geometry import annulus, disc
from ..materials import J2, LinearHardening
from . import verdict_maps

_log = logging.getLogger(__name__)

SPEEDS = (0.02, 0.05, 0.1, 0.15, 0.3, 0.5)
HOLDS, LEAKS = 0.01, 0.05  # shares of the energy of the start
LOOKS, MOST_STEPS = 40, 20_000
DENSITY, YOUNG, POISSON = 1000.0, 1e7, 0.3
WAVE_SPEED = math.sqrt(YOUNG * (1.0 - POISSON) / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON)) / DENSITY)  # m/s
ELASTIC = NeoHookean(density=DENSITY, young=YOUNG, poisson=POISSON)
#: Yields at a hundredth of its modulus.
YIELDING = J2(
    density=DENSITY, young=YOUNG, poisson=POISSON, hardening=LinearHardening(yield_stress=1e-2 * YOUNG, modulus=1e5)
)

#: Name -> material, and options of the simulation.
FORMS: dict[str, tuple[Material, dict[str, Any]]] = {
    "elastic": (ELASTIC, {}),
    "yielding": (YIELDING, {}),
    "elastic, current": (ELASTIC, {"arrangement": Current()}),
    "yielding, current": (YIELDING, {"arrangement": Current()}),
}


def _block(columns: int, rows: int, h: float) -> np.ndarray:
    """Centres of square cells around the origin."""
    cells = np.stack(np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5, indexing="ij"), -1).reshape(-1, 2)
    return (cells - [0.5 * columns, 0.5 * rows]) * h


def corner_on_face(n: int, material: Material, v: float) -> list[Body]:
    """A square that falls on a block at rest, by a corner."""
    h, turn = 1.0 / n, math.radians(45.0)
    Q = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    base, x = _block(3 * n, n, h), _block(n, n, h) @ Q.T
    x[:, 1] += base[:, 1].max() + h - x[:, 1].min()
    return [
        Body(x=base, volume=h * h, material=material, name="base"),
        Body(x=x, volume=h * h, material=material, velocity=(0.0, -v), name="square"),
    ]


def face_on_face(n: int, material: Material, v: float) -> list[Body]:
    """A square on another at rest, a third of a side aside."""
    h = 1.0 / n
    x = _block(n, n, h)
    return [
        Body(x=x, volume=h * h, material=material, velocity=(v, 0.0), name="left"),
        Body(x=x + np.array([1.0, 0.31]), volume=h * h, material=material, name="right"),
    ]


def rings(n: int, material: Material, v: float) -> list[Body]:
    """Two rings of 0.7 to 1 m, a little off centre, at this speed each."""
    x, volume = annulus(centre=(0.0, 0.0), inner=0.7, outer=1.0, rings=n)
    aside = np.array([1.03, 0.1])
    return [
        Body(x=x - aside, volume=volume, material=material, velocity=(v, 0.0), name="left"),
        Body(x=x + aside, volume=volume, material=material, velocity=(-v, 0.0), name="right"),
    ]


def plate_between_discs(n: int, material: Material, v: float) -> list[Body]:
    """A plate of two particles between two discs, n particles per radius, at this speed each."""
    h = 0.5 / n
    x, volume = disc(centre=(0.0, 0.0), radius=0.5, spacing=h)
    up = np.array([0.0, 2.0 * h - x[:, 1].min()])
    down = np.array([0.0, -2.0 * h - x[:, 1].max()])
    return [
        Body(x=_block(4 * n, 2, h), volume=h * h, material=material, name="plate"),
        Body(x=x + up, volume=volume, material=material, velocity=(0.0, -v), name="above"),
        Body(x=x + down, volume=volume, material=material, velocity=(0.0, v), name="below"),
    ]


@dataclass(frozen=True)
class Problem:
    """Bodies that hit each other.

    Args:
        name: of the problem.
        levels: resolutions, coarse first; what they count.
        counted: what a level counts.
        time: until when it runs, over 1 m/c.
        gap: how far bodies fly before they meet [m], with the speed of closing over that given.
        build: (level, material, speed [m/s]) -> bodies.
    """

    name: str
    levels: Sequence[int]
    counted: str
    time: float
    gap: tuple[float, float]
    build: Callable[[int, Material, float], list[Body]]


PROBLEMS = (
    Problem("corner on a face", (8, 16), "particles along a side", 5.0, (0.0, 1.0), corner_on_face),
    Problem("face on a face", (8, 16), "particles along a side", 4.0, (0.0, 1.0), face_on_face),
    Problem("rings", (4, 6), "circles", 25.0, (0.07, 2.0), rings),
    Problem("plate between discs", (6, 12), "particles along a radius", 6.0, (0.0, 1.0), plate_between_discs),
)


@dataclass(frozen=True)
class Verdict:
    """A cell of the map.

    Attributes:
        verdict: "holds", "leaks" or "fails". account: of the contact over the energy of the start, when it was largest.
        nearest: least distance of particles of two bodies [spacings]. within: most particles within another body.
        kept: kinetic and stored energy at the end, over that of the start. reason: why it failed.
    """

    problem: str
    form: str
    level: int
    speed: float
    verdict: str
    account: float
    nearest: float
    within: int
    kept: float
    steps: int
    reason: str


def meeting(simulation: Simulation) -> tuple[float, int]:
    """Least distance of particles of two bodies, in spacings, and how many lie within another body.

    Within is who has another body all around: those nearer than two spacings, three or more, have a mean direction
    below 0.3, that of an arc of three quarters (sin(α/2)/(α/2) at 270°).
    """
    x, nearest, within = simulation.x, math.inf, 0
    spacing = np.concatenate([np.broadcast_to(body.spacing, len(body.x)) for body in simulation.bodies])
    spans = [slice(own.start, own.stop) for own in simulation.ranges.values()]
    for one in spans:
        for other in spans:
            if one != other:
                away = (x[other] - x[one, None]) / spacing[one, None, None]
                apart = np.linalg.norm(away, axis=2)
                nearest = min(nearest, float(apart.min()))
                near = apart < 2.0
                count = near.sum(axis=1)
                towards = np.where(near[..., None], away / apart[..., None], 0.0).sum(axis=1)
                within += int(((count > 2) & (np.linalg.norm(towards, axis=1) < 0.3 * count)).sum())
    return nearest, within


def judge(problem: Problem, form: str, level: int, speed: float) -> Verdict:
    """One run, looked at ``LOOKS`` times."""
    material, options = FORMS[form]
    v = speed * WAVE_SPEED
    simulation = Simulation(problem.build(level, material, v), interactions=[Contact()], **options)
    until = problem.time / WAVE_SPEED + problem.gap[0] / (problem.gap[1] * v)
    start = simulation.energy()["total"]
    account, nearest, within, kept, reason = 0.0, math.inf, 0, 1.0, ""
    try:
        for time in np.linspace(0.0, until, LOOKS + 1)[1:]:
            simulation.run(float(time))
            energy = simulation.energy()
            found = meeting(simulation)
            account = max(account, energy["interaction"] / start, key=abs)
            nearest, within, kept = min(nearest, found[0]), max(within, found[1]), energy["total"] / start
            if simulation.steps > MOST_STEPS:
                reason = f"steps of {simulation.dt:.2g} s"
            if reason or abs(account) > 1.0:
                break
    except UnstableError as raised:
        reason = str(raised).split(" has ")[-1].split(";")[0].split(", v =")[0].split(", must")[0]
    reason = reason and f"{reason} at {simulation.t / until:.2f} of its time"
    if abs(account) > LEAKS:
        reason = reason or f"account of {100.0 * account:.2g} %"
    elif within:
        reason = reason or f"{within} within another body"
    verdict = "fails" if reason else "holds" if abs(account) < HOLDS else "leaks"
    return Verdict(problem.name, form, level, speed, verdict, account, nearest, within, kept, simulation.steps, reason)


def run(
    problems: Sequence[Problem], forms: Sequence[str], speeds: Sequence[float], levels: int, output: Path
) -> list[Verdict]:
    """Fill the map, by the first ``levels`` resolutions; the files are written anew after each problem."""
    verdicts: list[Verdict] = []
    output.mkdir(parents=True, exist_ok=True)
    for problem in problems:
        for form in forms:
            for level in problem.levels[:levels]:
                row = [judge(problem, form, level, speed) for speed in speeds]
                verdicts += row
                shown = ", ".join(f"{v.speed:g}: {v.verdict} {_percent(v.account)} {v.nearest:.2f}" for v in row)
                _log.info("%s, %s, %d: %s", problem.name, form, level, shown)
        (output / "contact.md").write_text(table(verdicts), encoding="utf-8")
        verdict_maps.write_csv(Verdict, verdicts, output / "contact.csv")
        draw(verdicts, output / "contact_map.png")
    return verdicts


def _percent(share: float) -> str:
    return f"{100.0 * share:+.2g} %"


def _groups(verdicts: Sequence[Verdict]) -> Iterator[tuple[str, dict[tuple[str, int], list[Verdict]]]]:
    """Each problem with its rows, verdicts by speed, by form and level."""
    for name in dict.fromkeys(v.problem for v in verdicts):
        rows: dict[tuple[str, int], list[Verdict]] = {}
        for v in verdicts:
            if v.problem == name:
                rows.setdefault((v.form, v.level), []).append(v)
        yield name, rows


def table(verdicts: Sequence[Verdict]) -> str:
    """Markdown: per problem one table, account and least distance in each cell, and why runs failed."""
    lines: list[str] = []
    counted = {problem.name: problem.counted for problem in PROBLEMS}
    for name, rows in _groups(verdicts):
        speeds = [v.speed for v in next(iter(rows.values()))]
        lines += [f"**{name}** (account of the contact, least distance in spacings, energy kept)", ""]
        lines += [f"| form, {counted[name]} | " + " | ".join(f"{speed:g}" for speed in speeds) + " | why it failed |"]
        lines += ["|---" * (len(speeds) + 2) + "|"]
        for (form, level), row in rows.items():
            cells = [f"{_percent(v.account)}, {v.nearest:.2f}, {v.kept:.2f}" for v in row]
            reasons = "; ".join(f"{v.speed:g}: {v.reason}" for v in row if v.reason)
            lines.append(f"| {form}, {level} | " + " | ".join(cells) + f" | {reasons} |")
        lines.append("")
    return "\n".join(lines)


COLOURS = {"holds": "#4c9f70", "leaks": "#e9d985", "fails": "#c8553d"}


def draw(verdicts: Sequence[Verdict], path: Path) -> None:
    """The map: one panel per problem, forms and resolutions downwards, speed to the right."""
    panels = [
        verdict_maps.Panel(
            title=name,
            along="speed over that of pressure waves",
            rows=[f"{form}, {level}" for form, level in rows],
            columns=[v.speed for v in next(iter(rows.values()))],
            cells=[[(v.verdict, _percent(v.account)) for v in row] for row in rows.values()],
        )
        for name, rows in _groups(verdicts)
    ]
    most = max(len(panel.rows) for panel in panels)
    verdict_maps.draw(panels, COLOURS, path, panel_size=(6.5, 0.3 * (most + 3)), label_size=8)


def main(argv: Sequence[str] | None = None) -> list[Verdict]:
    """Run the map; every verdict."""
    known = [problem.name for problem in PROBLEMS]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="the coarsest resolution only")
    parser.add_argument("--only", nargs="+", choices=known, default=known, help="problems to run")
    parser.add_argument("--forms", nargs="+", choices=list(FORMS), default=list(FORMS), help="forms to run")
    parser.add_argument("--speeds", nargs="+", type=float, default=SPEEDS, help="over that of pressure waves")
    parser.add_argument("--output", type=Path, default=Path("runs/contact"))
    args = parser.parse_args(argv)
    wp.config.log_level = wp.LOG_WARNING
    logging.basicConfig(level=logging.ERROR, format="%(message)s")  # the table says what tore
    _log.setLevel(logging.INFO)
    chosen = [problem for problem in PROBLEMS if problem.name in args.only]
    levels = 1 if args.quick else max(len(problem.levels) for problem in PROBLEMS)
    return run(chosen, args.forms, args.speeds, levels, args.output)


if __name__ == "__main__":
    main()
