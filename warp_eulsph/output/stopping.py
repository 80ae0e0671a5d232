"""Why a run stops before its end: a signal, a limit of wall time, a file."""

import math
import signal
import threading
import time
from pathlib import Path
from types import FrameType
from typing import Any


class Stop:
    """Asks a run to stop after its present step. As a context it takes over SIGTERM and SIGINT (from the main thread).

    A second SIGINT raises ``KeyboardInterrupt`` at once, as usual.

    Args:
        wall: seconds from now on.
        file: the run stops when it is there; removed then, so that the run can be resumed.
    """

    def __init__(self, wall: float = math.inf, file: Path | None = None):
        self._end, self._file = time.monotonic() + wall, file
        self._wall = wall
        self._signal: str | None = None
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> "Stop":
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGTERM, signal.SIGINT):
                self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *raised: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before.clear()

    def reason(self) -> str | None:
        """Why to stop now; None to go on."""
        if self._signal is not None:
            return self._signal
        if time.monotonic() >= self._end:
            return f"wall limit of {self._wall:g} s"
        if self._file is not None and self._file.is_file():
            self._file.unlink(missing_ok=True)
            return f"file {self._file}"
        return None

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._signal = signal.Signals(number).name
        if number == signal.SIGINT:
            signal.signal(signal.SIGINT, signal.default_int_handler)
