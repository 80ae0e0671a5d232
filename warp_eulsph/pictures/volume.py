"""Pictures in 3-D, by PyVista without a screen."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..output.reader import RunFrame
from .cells import corners
from .quantity import quantity

# The six sides of a cell, corners in order round each.
SIDES = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
UP = (0.0, 1.0, 0.0)  # as columns do


ANGLE = 30.0  # of the view, upwards [degrees]
AWAY = 2.0  # distance of the eye, in diagonals of what is seen
BAR = 140  # room for the colour bar and its numbers [pixels]


def upwards(view: Sequence[float]) -> tuple[float, float, float]:
    """What points up in the picture."""
    return UP if abs(view[1]) < 0.99 * np.linalg.norm(view) else (0.0, 0.0, -1.0)


def breadth(extent: np.ndarray, view: Sequence[float]) -> float:
    """How broad a box, (2, 3) [m], looks, over the height of the picture."""
    side = np.cross(upwards(view), view)
    span = np.abs(side / np.linalg.norm(side)) @ (extent[1] - extent[0])
    return float(span / (2.0 * AWAY * np.linalg.norm(extent[1] - extent[0]) * np.tan(np.radians(0.5 * ANGLE))))


def draw_volume(frame: RunFrame, options: Any) -> np.ndarray:
    """Cells coloured by a quantity, as an image (height, width, 3) of bytes.

    Raises:
        ModuleNotFoundError: PyVista is not installed.
    """
    try:
        import pyvista
    except ModuleNotFoundError:
        raise ModuleNotFoundError("pictures in 3-D need PyVista: pip install 'warp_eulsph[viz]'") from None
    from vtkmodules.vtkCommonCore import vtkLogger

    # Without a screen VTK warns of it, then draws all the same.
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    shown = quantity(frame, options.field)
    points = corners(frame, options.spacing)
    n = len(points)
    sides = np.empty((n, len(SIDES), 5), dtype=np.int64)
    sides[:, :, 0], sides[:, :, 1:] = 4, 8 * np.arange(n)[:, None, None] + SIDES
    cells = pyvista.PolyData(points.reshape(-1, 3), faces=sides.ravel())
    cells.cell_data["colour"] = np.repeat(shown.values, len(SIDES))
    plotter: Any = pyvista.Plotter(off_screen=True, window_size=[int(size) for size in options.size])
    try:
        plotter.set_background("white")
        wide = options.size[0]
        bar = {"title": " ", "color": "black", "vertical": True, "height": 0.6, "width": 80 / wide, "n_labels": 5}
        bar |= {"position_x": 1.0 - BAR / wide, "position_y": 0.2, "title_font_size": 16, "label_font_size": 14}
        look = {"scalars": "colour", "cmap": options.colours, "clim": options.limits, "ambient": 0.3}
        look |= {"show_edges": True, "edge_color": "black", "edge_opacity": 0.25, "line_width": 1}
        plotter.add_mesh(cells, scalar_bar_args=bar, **look)
        plotter.add_axes(color="black")
        plotter.add_text(
            "\n".join(filter(None, (options.title, shown.label, f"t = {frame.time:.6g} s"))),
            color="black",
            font_size=10,
        )
        low, high = options.extent
        centre, reach = 0.5 * (low + high), float(np.linalg.norm(high - low))
        away = np.array(options.view) / np.linalg.norm(options.view)
        plotter.camera_position = [tuple(centre + AWAY * reach * away), tuple(centre), upwards(options.view)]
        plotter.camera.view_angle = ANGLE
        return np.asarray(plotter.screenshot(return_img=True))[:, :, :3].copy()
    finally:
        plotter.close()
