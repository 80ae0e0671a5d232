"""Verdicts as pictures and files: panels of coloured cells, rows of a table for programs."""

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Panel:
    """One grid of cells.

    Args:
        title: above it.
        along: what grows to the right.
        rows: names, downwards.
        columns: numbers, to the right.
        cells: row by row (verdict, what stands in the cell).
    """

    title: str
    along: str
    rows: Sequence[str]
    columns: Sequence[float]
    cells: Sequence[Sequence[tuple[str, str]]]


def draw(
    panels: Sequence[Panel],
    colours: Mapping[str, str],
    path: Path,
    panel_size: tuple[float, float],
    label_size: float | str,
) -> None:
    """A picture of the panels, two side by side, each of ``panel_size`` [inch]; ``colours`` are those of verdicts."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    high, wide = math.ceil(len(panels) / 2), min(2, len(panels))
    figure, axes = plt.subplots(high, wide, figsize=(panel_size[0] * wide, panel_size[1] * high), squeeze=False)
    for axis in axes.flat[len(panels) :]:
        axis.remove()
    for axis, panel in zip(axes.flat, panels, strict=False):
        for i, row in enumerate(panel.cells):
            for k, (verdict, text) in enumerate(row):
                axis.add_patch(plt.Rectangle((k, i), 1, 1, facecolor=colours[verdict], edgecolor="white"))
                axis.text(k + 0.5, i + 0.5, text, ha="center", va="center", fontsize=7)
        axis.set(xlim=(0, len(panel.columns)), ylim=(len(panel.rows), 0), title=panel.title, xlabel=panel.along)
        axis.set_xticks(np.arange(len(panel.columns)) + 0.5, [f"{mark:g}" for mark in panel.columns])
        axis.set_yticks(np.arange(len(panel.rows)) + 0.5, panel.rows)
        axis.tick_params(length=0, labelsize=label_size)
    handles = [plt.Rectangle((0, 0), 1, 1, facecolor=colour) for colour in colours.values()]
    figure.legend(handles, colours, ncols=len(colours), loc="upper center", frameon=False)
    figure.tight_layout(rect=(0, 0, 1, 0.96))
    figure.savefig(path, dpi=80)
    plt.close(figure)


def write_csv(kind: type[Any], verdicts: Sequence[Any], path: Path) -> None:
    """All verdicts, dataclasses of this kind, one per line."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(kind)])
        writer.writeheader()
        writer.writerows(asdict(verdict) for verdict in verdicts)
