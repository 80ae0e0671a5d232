"""A picture of a run that goes on, drawn anew as snapshots come."""

import os
import time
from collections.abc import Callable
from pathlib import Path

from ..output import Run


def watch(directory: str, output: str, draw: Callable[[Run, str], object], pause: float) -> int:
    """Draw the last frame of a run into ``output`` whenever there is a new one, until the run ends; frames drawn.

    The file is replaced at once, so that a viewer never sees half of it.

    Args:
        directory: of the run.
        output: a PNG file.
        draw: a run's last frame into a file.
        pause: time between two looks [s].
    """
    drawn, last = 0, -1
    path = Path(output)
    beside = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        while True:
            found = Run(directory)
            going = found.state == "running"  # asked first: what it writes before it ends is drawn below
            if not going:
                found = Run(directory)
            if len(found) and found[-1].step != last:
                draw(found, str(beside))
                os.replace(beside, path)
                drawn, last = drawn + 1, found[-1].step
                print(f"{path}: t = {found[-1].time:.6g} s, step {last}", flush=True)
            if not going:
                return drawn
            time.sleep(pause)
    finally:
        beside.unlink(missing_ok=True)
