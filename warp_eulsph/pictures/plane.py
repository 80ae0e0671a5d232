"""Pictures in 1-D and 2-D, by matplotlib."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..output.reader import RunFrame
from .cells import corners, sheet
from .quantity import quantity

# Beneath the cells they are drawn larger by this factor, which fills the cracks between those that deformed differently
# and those that smoothed edges leave.
OVERLAP = 1.15
# A body longer than this many times its height has its colour bar beneath.
LONG = 2.0
# Corners of a cell in the order of its outline.
OUTLINE = [0, 1, 3, 2]


def matplotlib_figure(size: tuple[float, float]) -> Any:
    """A figure of ``size`` pixels that needs no screen.

    Raises:
        ModuleNotFoundError: matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise ModuleNotFoundError("pictures need matplotlib: pip install 'warp_eulsph[viz]'") from None
    figure = Figure(figsize=(size[0] / 100.0, size[1] / 100.0), dpi=100, layout="compressed")
    FigureCanvasAgg(figure)
    return figure


def draw_line(frame: RunFrame, options: Any) -> np.ndarray:
    """A quantity over x, as an image (height, width, 3) of bytes."""
    figure = matplotlib_figure(options.size)
    shown = quantity(frame, options.field)
    order = np.argsort(frame.x[:, 0])
    axes = figure.add_subplot()
    axes.plot(frame.x[order, 0], shown.values[order], ".-", lw=1, ms=4, label="computed")
    if shown.exact is not None:
        axes.plot(frame.x[order, 0], shown.exact[order], "k:", lw=1, label="exact")
        axes.legend(loc="upper right")
    axes.set(xlabel="x [m]", ylabel=shown.label, title=_title(frame, options))
    if options.limits is not None:
        axes.set_ylim(*_widened(options.limits))
    if options.extent is not None:
        axes.set_xlim(*options.extent[:, 0])
    axes.grid(alpha=0.3)
    return _image(figure)


def draw_plane(frame: RunFrame, options: Any) -> np.ndarray:
    """Cells coloured by a quantity, as an image (height, width, 3) of bytes."""
    figure = matplotlib_figure(options.size)
    from matplotlib.collections import PolyCollection

    shown = quantity(frame, options.field)
    axes = figure.add_subplot()
    if options.start is not None:
        beneath = sheet(frame, options.start)
        matter = PolyCollection(frame.x.astype(float)[beneath], array=shown.values[beneath].mean(axis=1))
        matter.set(cmap=options.colours, edgecolor="face", linewidth=0.2, clim=options.limits)
        axes.add_collection(matter)
    centres, own = frame.x.astype(float)[:, None], corners(frame, options.spacing)
    outlines: Any = np.concatenate([centres + OVERLAP * (own - centres), own])[:, OUTLINE]
    cells = PolyCollection(outlines, array=np.tile(shown.values, 2), cmap=options.colours)
    cells.set(edgecolor="face", linewidth=0.2)
    if options.limits is not None:
        cells.set_clim(*options.limits)
    axes.add_collection(cells)
    if options.outline is not None:
        axes.plot(*options.outline.T, ".", ms=1.5, color="0.6", zorder=0)
    extent = options.extent
    axes.set(xlim=extent[:, 0], ylim=extent[:, 1], aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.set_title(_title(frame, options))
    wide, high = extent[1] - extent[0]
    place = "bottom" if wide > LONG * high else "right"
    bar = figure.colorbar(cells, label=shown.label, location=place, shrink=0.8, pad=0.02)
    bar.formatter.set_powerlimits((-3, 4))
    return _image(figure)


def draw_curves(columns: Sequence[tuple[str, np.ndarray]], path: Path, title: str) -> None:
    """The columns after the first over the first, each with its label, (k,) each, as a PNG.

    Raises:
        ModuleNotFoundError: matplotlib is not installed.
    """
    figure = matplotlib_figure((800, 500))
    axes = figure.add_subplot()
    (across, x), curves = columns[0], columns[1:]
    for label, y in curves:
        axes.plot(x, y, lw=1.2, label=label)
    axes.set(xlabel=across, ylabel=curves[0][0] if len(curves) == 1 else "", title=title)
    if len(curves) > 1:
        axes.legend()
    axes.grid(alpha=0.3)
    figure.savefig(path)


def _title(frame: RunFrame, options: Any) -> str:
    return f"{options.title}{', ' if options.title else ''}t = {frame.time:.6g} s"


def _widened(limits: tuple[float, float]) -> tuple[float, float]:
    margin = 0.05 * (limits[1] - limits[0]) or 1.0
    return limits[0] - margin, limits[1] + margin


def _image(figure: Any) -> np.ndarray:
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba())[:, :, :3].copy()
