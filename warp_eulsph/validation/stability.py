"""Maps of linear stability: which weights, dilations, options and steps hold.

    python -m warp_eulsph.validation.stability [--quick] [--output DIR]

writes ``stability.csv``, one row per figure, and ``stability_map.png``. The radii are those of the library's own step
(``stability_step.py``), the rates those of its operators (``stability_rates.py``). What the figures say is in
docs/stability.md.
"""

import argparse
import csv
import logging
import math
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import warp as wp

from ..scheme.balance import Balance
from ..scheme.dissipation import Upwind
from ..scheme.lax_wendroff import LaxWendroff
from ..scheme.pair_areas import PairAreas
from ..scheme.policy import Always
from ..scheme.smoothing import LinearExact, NeighbourAverage
from ..scheme.verlet import Verlet
from ..weights import CubicSpline, QuinticSpline, Weight, WendlandC2, WendlandC4
from .stability_rates import rates
from .stability_step import RESOLVED, Point, growth, largest_cfl, spectral_radius

__all__ = ["RESOLVED", "Point", "Study", "growth", "largest_cfl", "scan", "spectral_radius"]

_log = logging.getLogger(__name__)

#: All of M11, to round-off. Iterations go on from there with nothing but round-off, which then grows: no more of them.
CLOSED = PairAreas(kappa=math.inf, iterations=30)
OPTIONS: dict[str, Verlet | LaxWendroff] = {
    "default": Verlet(),
    "epsilon 2": Verlet(dissipation=Upwind(2.0)),
    "epsilon 0.5": Verlet(dissipation=Upwind(0.5)),
    "epsilon 0.25": Verlet(dissipation=Upwind(0.25)),
    "epsilon 0.1": Verlet(dissipation=Upwind(0.1)),
    "no dissipation": Verlet(dissipation=None),
    "midpoint": LaxWendroff(),
    "midpoint, epsilon 0.5": LaxWendroff(dissipation=Upwind(0.5)),
    "midpoint, epsilon 0.25": LaxWendroff(dissipation=Upwind(0.25)),
    "midpoint, no dissipation": LaxWendroff(dissipation=None),
    "midpoint, theta 0.25": LaxWendroff(smoothing=LinearExact(0.25)),
    "midpoint, theta 0.5": LaxWendroff(smoothing=LinearExact(0.5)),
    "midpoint, neighbour average": LaxWendroff(smoothing=NeighbourAverage()),
    "midpoint, neighbour average, no dissipation": LaxWendroff(smoothing=NeighbourAverage(), dissipation=None),
}
#: Of these, where the Jacobian is large.
FEW = ("default", "midpoint", "epsilon 0.5", "epsilon 0.25", "no dissipation")
#: Name -> scheme of a strained lattice in a moving reference, and whether it has a Jacobian.
CORRECTIONS: dict[str, tuple[Verlet | LaxWendroff, bool]] = {
    "M5 alone": (Verlet(correction=None), True),
    "default": (Verlet(), True),
    "M13, 30 sweeps": (Verlet(correction=Balance(sweeps=30)), True),
    "M12": (Verlet(correction=PairAreas()), False),
    "M11": (Verlet(correction=CLOSED), True),
}
WEIGHTS: dict[str, tuple[Weight, Sequence[float]]] = {
    "CubicSpline": (CubicSpline(), (1.1, 1.2, 1.3, 1.5)),
    "QuinticSpline": (QuinticSpline(), (1.1, 1.3)),
    "WendlandC2": (WendlandC2(), (1.3, 1.5, 1.7)),
    "WendlandC4": (WendlandC4(), (1.5, 1.7)),
}
#: Particles across a bounded cube: enough for its middle to see no face in 1-D and 2-D.
BOUNDED = {1: 24, 2: 7, 3: 4}
PERIODIC = {1: 16, 2: 8, 3: 6}


@dataclass(frozen=True)
class Study:
    """One figure to be found.

    Args:
        group: which part of the map it belongs to.
        name: of the option that varies.
        point: where it is measured.
        measure: name of what is measured, a key of ``MEASURES``.
    """

    group: str
    name: str
    point: Point
    measure: str


def _growth_rate(point: Point) -> float:
    """ln |λ| per time dx/c: what a user of another Δt would see."""
    return math.log(spectral_radius(point)) / point.cfl


MEASURES = {
    "largest cfl": largest_cfl,
    "growth per step": lambda point: spectral_radius(point) - 1.0,
    "growth rate dx/c": _growth_rate,
    "power iteration, growth rate dx/c": lambda point: growth(point, 600) / point.cfl,
    "frequency dx/c": lambda point: rates(point).frequency,
    "damping dx/c": lambda point: rates(point).damping,
}


@dataclass(frozen=True)
class Result:
    """A figure found; ``seconds`` it took."""

    study: Study
    value: float
    seconds: float = field(compare=False, default=0.0)

    def row(self) -> dict[str, Any]:
        """Flat, for a table."""
        point = self.study.point
        return {
            "group": self.study.group,
            "name": self.study.name,
            "dim": point.dim,
            "body": "periodic" if point.periodic else "bounded",
            "across": point.across,
            "jitter": point.jitter,
            "strain": point.strain,
            "reference": type(point.reference).__name__,
            "weight": type(point.weight).__name__,
            "dilation": point.dilation,
            "cfl": point.cfl,
            "measure": self.study.measure,
            "value": f"{self.value:.6g}",
        }


def studies(quick: bool) -> Iterator[Study]:
    """The map's figures; ``quick`` leaves out 3-D bodies with faces, jitter and most weights."""
    dims = (1, 2) if quick else (1, 2, 3)
    bodies = [Point(dim=dim, across=BOUNDED[dim], periodic=False) for dim in dims]
    boxes = [Point(dim=dim, across=PERIODIC[dim]) for dim in (1, 2, 3)]
    for point in [*bodies, *boxes]:
        for jitter in (0.0,) if quick else (0.0, 0.2):
            there = replace(point, jitter=jitter)
            yield Study("rates", "acoustic", there, "frequency dx/c")
            yield Study("rates", "dissipation", there, "damping dx/c")
    for point in [*bodies, *boxes]:
        for name, scheme in OPTIONS.items():
            if point.periodic or point.dim == 1 or name in FEW[: 1 if quick else None]:
                yield Study("options", name, replace(point, scheme=scheme), "largest cfl")
    if not quick:
        for name in ("default", "epsilon 0.25", "midpoint"):
            for point in bodies if name == "default" else bodies[:2]:
                yield Study("jitter", name, replace(point, scheme=OPTIONS[name], jitter=0.2), "largest cfl")
        for point in (*bodies[:2], replace(boxes[1], jitter=0.2, surface=0.0)):
            yield Study("Eulerian", "default", replace(point, reference=Always()), "largest cfl")
    for cfl in (0.4, 0.8, 1.0, 1.2, 1.4, 1.6):
        for point in [*bodies, *boxes]:
            yield Study("growth", "default", replace(point, cfl=cfl), "growth per step")
    for name, (weight, dilations) in WEIGHTS.items():
        for dilation in (1.2, 1.3, 1.5) if quick else dilations:
            if not quick or name == "CubicSpline":
                across = max(BOUNDED[2], math.ceil(2.0 * weight.support * dilation))
                point = Point(dim=2, across=min(across, 8), periodic=False, weight=weight, dilation=dilation)
                yield Study("weights", name, point, "largest cfl")
    yield from _strained(quick)


def _strained(quick: bool) -> Iterator[Study]:
    """Uniform strains in a moving reference, with every correction."""
    for dim in (1, 2) if quick else (1, 2, 3):
        for dilation in (1.2, 1.3, 1.5):
            for strain in (-0.1, -0.03, 0.03, 0.1):
                across = max(PERIODIC[dim], 2 * math.floor(2.0 * dilation) + 2)  # even, to hold the saw-tooth
                point = Point(dim=dim, across=across, dilation=dilation, strain=strain, reference=Always())
                for name, (scheme, differentiable) in CORRECTIONS.items():
                    if differentiable:
                        yield Study("strained", name, replace(point, scheme=scheme), "growth rate dx/c")
                    elif dim < 3 and not quick:
                        yield Study(
                            "strained", name, replace(point, scheme=scheme), "power iteration, growth rate dx/c"
                        )
    for gamma in (1.0, 2.0, 5.0):  # a square lattice sheared by a whole number is one again
        point = Point(dim=2, across=PERIODIC[2], strain=((0.0, gamma), (0.0, 0.0)), reference=Always())
        for name in ("M5 alone", "default", "M13, 30 sweeps", "M11"):
            yield Study("sheared", name, replace(point, scheme=CORRECTIONS[name][0]), "growth rate dx/c")


def scan(wanted: Iterable[Study]) -> list[Result]:
    """Find every figure, in order; progress goes to the log."""
    results = []
    for study in wanted:
        start = time.perf_counter()
        value = float(MEASURES[study.measure](study.point))
        results.append(Result(study, value, time.perf_counter() - start))
        row = results[-1].row()
        _log.info("%s (%.1f s)", ", ".join(str(entry) for entry in row.values()), results[-1].seconds)
    return results


def write(results: Sequence[Result], path: Path) -> None:
    """The figures as comma-separated values, one per row."""
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, fieldnames=list(results[0].row()))
        table.writeheader()
        table.writerows(result.row() for result in results)


def draw(results: Sequence[Result], path: Path) -> None:
    """Four panels: growth over CFL; largest CFL over ε, and over dilation; growth of strained bodies over dilation."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(10, 7.5))
    _draw_growth(axes[0, 0], _of(results, "growth"))
    _draw_dissipation(axes[0, 1], _of(results, "options"))
    _draw_weights(axes[1, 0], _of(results, "weights"))
    _draw_strained(axes[1, 1], _of(results, "strained"))
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _of(results: Sequence[Result], group: str) -> list[Result]:
    return [result for result in results if result.study.group == group]


def _body(point: Point) -> str:
    return f"{point.dim}-D {'periodic' if point.periodic else 'bounded'}"


def _line(point: Point) -> dict[str, Any]:
    return {"color": f"C{point.dim - 1}", "ls": "--" if point.periodic else "-", "marker": "o", "ms": 3}


def _draw_growth(axes: Any, results: Sequence[Result]) -> None:
    for point in dict.fromkeys(replace(result.study.point, cfl=1.0) for result in results):
        own = [result for result in results if replace(result.study.point, cfl=1.0) == point]
        cfl = [result.study.point.cfl for result in own]
        axes.semilogy(cfl, [max(result.value, 1e-8) for result in own], label=_body(point), **_line(point))
    axes.axhspan(1e-8, RESOLVED, color="0.9")
    axes.set(xlabel="CFL", ylabel="growth per step, |λ| − 1", title="default scheme at rest (grey: none)")
    axes.legend(fontsize=7)


def _draw_dissipation(axes: Any, results: Sequence[Result]) -> None:
    families: dict[tuple[type, Point], list[tuple[float, float]]] = {}
    for result in results:
        scheme = result.study.point.scheme
        if scheme.smoothing is None:
            epsilon = 0.0 if scheme.dissipation is None else scheme.dissipation.epsilon
            family = (type(scheme), replace(result.study.point, scheme=Verlet()))
            families.setdefault(family, []).append((epsilon, result.value))
    for (kind, point), found in families.items():
        midpoint = kind is LaxWendroff
        if not (midpoint and point.periodic):
            line = {**_line(point), "alpha": 0.4} if midpoint else _line(point)
            axes.plot(*zip(*sorted(found), strict=True), label=_body(point) + midpoint * ", midpoint", **line)
    axes.axhline(Verlet.cfl, color="0.6", lw=1)
    axes.set(xlabel="ε of the dissipation (M9)", ylabel="largest CFL", title="cubic spline, dilation 1.3; grey: 0.8")
    axes.legend(fontsize=6, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 0.05))


def _draw_weights(axes: Any, results: Sequence[Result]) -> None:
    for name in dict.fromkeys(result.study.name for result in results):
        own = [result for result in results if result.study.name == name]
        axes.plot([r.study.point.dilation for r in own], [r.value for r in own], marker="o", ms=3, label=name)
    axes.axhline(Verlet.cfl, color="0.6", lw=1)
    axes.set(xlabel="dilation", ylabel="largest CFL", title="2-D bounded, ε = 1; grey: 0.8")
    axes.legend(fontsize=7)


def _draw_strained(axes: Any, results: Sequence[Result]) -> None:
    styles = {"M5 alone": ("-", "o"), "default": ("--", "^"), "M12": ("-.", "v"), "M11": (":", "s")}
    for dim in (1, 2, 3):
        for name, (line, marker) in styles.items():
            own = [r for r in results if (r.study.name, r.study.point.dim, r.study.point.strain) == (name, dim, 0.1)]
            if own:
                dilation, rate = [r.study.point.dilation for r in own], [max(r.value, 1e-5) for r in own]
                axes.semilogy(
                    dilation, rate, ls=line, marker=marker, ms=3, color=f"C{dim - 1}", label=f"{dim}-D {name}"
                )
    axes.set(xlabel="dilation", ylabel="growth rate · dx/c", title="Eulerian, 10 % strain in every direction")
    axes.legend(fontsize=6, ncols=3, loc="lower left", bbox_to_anchor=(0.0, 0.05))
    axes.set_ylim(bottom=1e-6)


def main(argv: Sequence[str] | None = None) -> None:
    """Scan, write, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few bodies with faces, few weights; a minute or two")
    parser.add_argument("--output", type=Path, default=Path("runs/stability"))
    args = parser.parse_args(argv)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    wp.config.log_level = wp.LOG_WARNING
    args.output.mkdir(parents=True, exist_ok=True)
    results = scan(studies(args.quick))
    write(results, args.output / "stability.csv")
    draw(results, args.output / "stability_map.png")
    _log.info("%d figures: %s", len(results), args.output)


if __name__ == "__main__":
    main()
