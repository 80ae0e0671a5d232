"""Frames of a run to picture and film files."""

import contextlib
import itertools
import shutil
import subprocess
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..output import Run
from ..output.reader import RunFrame
from .cells import spacing
from .plane import LONG, draw_line, draw_plane
from .quantity import quantity
from .volume import breadth, draw_volume

FILMS = (".gif", ".mp4")


@dataclass(frozen=True)
class Picture:
    """What a picture looks like.

    Args:
        field: what colours the particles (see ``quantity``).
        size: width and height in pixels, even numbers for films; those that suit the extent if None.
        title: stands before the time.
        outline: positions of the outermost particles at the start [m], (k, 2), dotted beneath the body; in 2-D only.
        start: positions of the particles at the start [m], (n, 2), by which what opens between cells that are sheared
            far is filled, in 2-D; a film takes them from the first frame of its run.
        colours: a colour map of matplotlib.
        limits: least and largest value of the colours; those shown if None.
        spacing: edge of the cells at the start [m]; by default the spacing of the first frame that is drawn.
        extent: lower and upper corner of what is seen [m], (2, dim); by default that of what is drawn.
        view: where a picture in 3-D is looked at from; y points up.
    """

    field: str = "velocity"
    size: tuple[int, int] | None = None
    title: str = ""
    outline: np.ndarray | None = None
    start: np.ndarray | None = None
    colours: str = "viridis"
    limits: tuple[float, float] | None = None
    spacing: float | None = None
    extent: np.ndarray | None = None
    view: tuple[float, float, float] = (0.6, 0.45, 1.0)

    def __post_init__(self) -> None:
        if self.size is not None and not all(100 <= side <= 10_000 for side in self.size):
            raise ValueError(f"size must be 100 to 10000 pixels each way, got {self.size}")
        if self.limits is not None and not self.limits[0] < self.limits[1]:
            raise ValueError(f"limits must be a least and a larger value, got {self.limits}")
        if len(self.view) != 3 or not np.isfinite(self.view).all() or not np.linalg.norm(self.view) > 0.0:
            raise ValueError(f"view must be three finite numbers, not all zero, got {self.view}")


def picture(frame: RunFrame, target: str | PathLike, options: Picture = Picture()) -> Path:
    """Draw one frame to a PNG file; the path of it.

    Raises:
        ValueError: no such field, or an ending that is not .png.
        ModuleNotFoundError: matplotlib, or in 3-D PyVista, is not installed.
    """
    path = Path(target)
    if path.suffix != ".png":
        raise ValueError(f"{path}: the ending of a picture must be .png, got {path.suffix!r}")
    image = draw_frame(frame, fitted(options, [frame]))
    path.parent.mkdir(parents=True, exist_ok=True)
    _pillow().fromarray(image).save(path)
    return path


def film(
    run: Run,
    target: str | PathLike,
    options: Picture = Picture(),
    *,
    frames: Sequence[int] | None = None,
    fps: float = 10.0,
) -> Path:
    """Draw frames of a run, all by default, to an animated GIF, or an MP4 where ffmpeg is; the path of it.

    View and colours are the same throughout, those that fit all frames unless ``options`` say.

    Raises:
        ValueError: no such field, an ending that is not .gif or .mp4, frames per second that are not positive.
        ModuleNotFoundError: matplotlib, or in 3-D PyVista, is not installed.
        OSError: a snapshot is not there, ffmpeg is not there or fails.
    """
    path = Path(target)
    if path.suffix not in FILMS:
        raise ValueError(f"{path}: the ending of a film must be one of {', '.join(FILMS)}, got {path.suffix!r}")
    if not (np.isfinite(fps) and fps > 0.0):
        raise ValueError(f"frames per second must be positive and finite, got {fps}")
    if path.suffix == ".mp4" and _ffmpeg() is None:
        raise FileNotFoundError(
            f"{path}: an MP4 needs the program ffmpeg; install it or pip install imageio-ffmpeg, or choose a .gif"
        )
    which = range(len(run)) if frames is None else frames
    if options.start is None and len(run):
        options = replace(options, start=run[0].x)
    # Each frame is opened anew: a frame keeps what was read from it.
    chosen = fitted(options, (run[k] for k in which))
    images = (draw_frame(run[k], chosen) for k in which)
    path.parent.mkdir(parents=True, exist_ok=True)
    (_save_gif if path.suffix == ".gif" else _save_mp4)(path, images, fps)
    return path


def draw_frame(frame: RunFrame, options: Picture) -> np.ndarray:
    """A frame as an image (height, width, 3) of bytes; ``options`` are those of ``fitted``."""
    return {1: draw_line, 2: draw_plane, 3: draw_volume}[frame.x.shape[1]](frame, options)


def fitted(options: Picture, frames: Iterable[RunFrame]) -> Picture:
    """The options with what they leave open taken from the frames: limits and extent that fit all of them.

    Raises:
        ValueError: no such field, or no frames.
    """
    edge, low, high, least, largest = options.spacing, None, None, np.inf, -np.inf
    for frame in frames:
        lowest, highest = quantity(frame, options.field).range
        least, largest = min(least, lowest), max(largest, highest)
        x = frame.x.astype(float)
        if edge is None:
            edge = spacing(x)
        low = x.min(axis=0) if low is None else np.minimum(low, x.min(axis=0))
        high = x.max(axis=0) if high is None else np.maximum(high, x.max(axis=0))
    if edge is None or low is None or high is None:
        raise ValueError("there must be at least one frame to draw, got none")
    margin = edge + 0.02 * float((high - low).max())
    extent = np.stack([low - margin, high + margin]) if options.extent is None else options.extent
    limits = options.limits
    if limits is None and np.isfinite(least) and np.isfinite(largest):
        wide = largest - least > 1e-12 * max(abs(least), abs(largest))
        limits = (least, largest) if wide else (least - 0.5, largest + 0.5)
    size = suited(extent, options.view) if options.size is None else options.size
    return replace(options, spacing=edge, limits=limits, extent=extent, size=size)


def suited(extent: np.ndarray, view: Sequence[float] = Picture.view) -> tuple[int, int]:
    """Pixels of a page without an empty half: upright for columns, flat for beams; even numbers."""
    if extent.shape[1] == 3:
        return 2 * round(min(max(350.0 + 700.0 * breadth(extent, view), 700.0), 1200.0) / 2.0), 700
    if extent.shape[1] == 1:
        return 1000, 700
    wide, high = extent[1] - extent[0]
    if wide > LONG * high:  # the colour bar lies beneath
        width, height = 1100.0, 200.0 + 1000.0 * high / wide
    else:
        width, height = 200.0 + 600.0 * wide / high, 700.0
    return 2 * round(max(width, 380.0) / 2.0), 2 * round(max(height, 260.0) / 2.0)


def _pillow() -> Any:
    try:
        from PIL import Image
    except ModuleNotFoundError:
        raise ModuleNotFoundError("pictures need matplotlib: pip install 'warp_eulsph[viz]'") from None
    return Image


def _ffmpeg() -> str | None:
    """The program: the system's, or the one that the package imageio-ffmpeg brings; None without."""
    found = shutil.which("ffmpeg")
    if found is None:
        try:
            import imageio_ffmpeg
        except ModuleNotFoundError:
            return None
        found = str(imageio_ffmpeg.get_ffmpeg_exe())
    return found


def _save_gif(path: Path, images: Iterable[np.ndarray], fps: float) -> None:
    frames = [_pillow().fromarray(image) for image in images]
    duration = max(20, round(1000.0 / fps))  # ms; browsers slow down what is faster
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=duration, loop=0, optimize=False)


def _save_mp4(path: Path, images: Iterable[np.ndarray], fps: float) -> None:
    stream = iter(images)
    first = next(stream)
    height, width = (side - side % 2 for side in first.shape[:2])  # the encoder takes even sides only
    command = [
        _ffmpeg() or "ffmpeg",
        "-loglevel",
        "error",
        "-y",
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-s",
        f"{width}x{height}",
    ]
    command += ["-r", f"{fps:g}", "-i", "-", "-pix_fmt", "yuv420p", str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as encoder:
        assert encoder.stdin is not None and encoder.stderr is not None
        with contextlib.suppress(BrokenPipeError):  # when it gives up, it says why
            for image in itertools.chain([first], stream):
                encoder.stdin.write(np.ascontiguousarray(image[:height, :width]).tobytes())
            encoder.stdin.close()
        complaint = encoder.stderr.read().decode(errors="replace").strip()
    if encoder.returncode:
        path.unlink(missing_ok=True)
        raise OSError(f"{path}: ffmpeg failed: {complaint}")
