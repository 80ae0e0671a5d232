"""Figures beside their references, as a table."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """A figure that a run printed, and the band it must lie in.

    Args:
        name: what it is, with its unit.
        value: what was computed.
        low: least value accepted.
        high: greatest value accepted.
        reference: what it should be; None where there is no reference.
    """

    name: str
    value: float
    low: float = float("-inf")
    high: float = float("inf")
    reference: float | None = None

    @property
    def accepted(self) -> bool:
        """Whether the value lies in the band; NaN does not."""
        return self.low <= self.value <= self.high


def table(figures: Sequence[Figure]) -> str:
    """One line per figure: name, value, reference, band, and whether it holds."""
    width = max(len(figure.name) for figure in figures)
    lines = [f"{'':{width}} {'computed':>12} {'reference':>12}   accepted"]
    for figure in figures:
        reference = "" if figure.reference is None else f"{figure.reference:.6g}"
        verdict = "ok" if figure.accepted else "OUTSIDE"
        band = f"{figure.low:.4g} to {figure.high:.4g}"
        lines.append(f"{figure.name:{width}} {figure.value:12.6g} {reference:>12}   {band:24} {verdict}")
    return "\n".join(lines)
