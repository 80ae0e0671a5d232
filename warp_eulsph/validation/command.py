"""The subcommand ``validate``: runs cases, prints their figures, says whether they hold."""

import contextlib
import difflib
import json
import logging
import math
import os
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from . import case as registry
from .case import Case
from .report import Figure, table

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Outcome:
    """What became of a case.

    Args:
        case: the case.
        figures: its figures; none if it raised.
        seconds: processor time [s].
        error: message of what it raised, or None.
    """

    case: Case
    figures: Sequence[Figure]
    seconds: float
    error: str | None = None

    @property
    def passed(self) -> bool:
        """Whether it ended, with every figure in its band."""
        return self.error is None and all(figure.accepted for figure in self.figures)

    def as_json(self) -> dict[str, Any]:
        """Plain numbers and strings; null stands for an open end of a band, no reference, or a figure not finite."""
        content: dict[str, Any] = {
            "case": self.case.name,
            "passed": self.passed,
            "metrics": {figure.name: _number(figure.value) for figure in self.figures},
            "bands": {figure.name: [_number(figure.low), _number(figure.high)] for figure in self.figures},
            "reference": {figure.name: _number(figure.reference) for figure in self.figures},
            "source": self.case.source,
            "seconds": round(self.seconds, 3),
        }
        if self.error is not None:
            content["error"] = self.error
        return content

    def as_text(self) -> str:
        """The case's table."""
        body = table(self.figures) if self.error is None else self.error
        return f"{self.case.name}: {self.case.title}\nreference: {self.case.source}\n{body}\n"


def validate(names: Sequence[str], *, quick: bool = False, as_json: bool = False, listing: bool = False) -> int:
    """Run the named cases, all if none is named, and print; the exit status (0 good, 1 outside, 2 unknown name)."""
    known = registry.names()
    unknown = [name for name in names if name not in known]
    if unknown:
        print(_unknown(unknown[0], known), file=sys.stderr)
        return 2
    chosen = [registry.load(name) for name in dict.fromkeys(names)] or list(registry.load_all().values())
    if listing:
        for case in chosen:
            print(f"{case.name}\n    {case.title}\n    reference: {case.source}")
        return 0
    outcomes = []
    for case in chosen:
        with _nothing_on_stdout():
            outcomes.append(_run(case, quick))
        if not as_json:
            print(outcomes[-1].as_text(), flush=True)
    if as_json:
        print(json.dumps([outcome.as_json() for outcome in outcomes], indent=2, allow_nan=False))
    else:
        print(_summary(outcomes))
    return 0 if all(outcome.passed for outcome in outcomes) else 1


def _unknown(name: str, known: list[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.0)[0]
    return f"validate: unknown case {name!r}; did you mean {near!r}? Cases: {', '.join(known)}"


def _run(case: Case, quick: bool) -> Outcome:
    start = time.process_time()
    try:
        figures, error = case.run(quick), None
    except Exception as raised:  # one case that fails must not hide the others
        figures, error = (), f"{type(raised).__name__}: {raised}"
        _log.debug("case %s failed", case.name, exc_info=True)
    return Outcome(case, figures, time.process_time() - start, error)


def _summary(outcomes: Sequence[Outcome]) -> str:
    width = max(len("case"), *(len(outcome.case.name) for outcome in outcomes))
    lines = [f"{'case':{width}} {'figures':>8} {'outside':>8} {'processor time':>15}   result"]
    for outcome in outcomes:
        outside = [figure.name for figure in outcome.figures if not figure.accepted]
        result = "FAILED" if outcome.error else f"OUTSIDE: {', '.join(outside)}" if outside else "ok"
        numbers = f"{len(outcome.figures):8} {len(outside):8} {outcome.seconds:13.1f} s"
        lines.append(f"{outcome.case.name:{width}} {numbers}   {result}")
    good = sum(outcome.passed for outcome in outcomes)
    lines.append(f"{good} of {len(outcomes)} cases hold, {sum(o.seconds for o in outcomes):.1f} s of processor time")
    return "\n".join(lines)


def _number(value: float | None) -> float | None:
    return float(value) if value is not None and math.isfinite(value) else None


@contextlib.contextmanager
def _nothing_on_stdout() -> Iterator[None]:
    """Sends what Warp's native code and the cases write to standard error, so that tables and JSON stay clean."""
    sys.stdout.flush()
    saved = os.dup(1)
    os.dup2(2, 1)
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        os.dup2(saved, 1)
        os.close(saved)
