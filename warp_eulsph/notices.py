"""What Warp says about the package's kernels: one line while they are compiled for the first time, nothing afterwards.

Warp tells about every module that it loads, in a line on standard output. The package's kernels are a module each, some
forty in a run, so that a change of options compiles only what it needs; that many lines say nothing. They go to the
logger ``warp_eulsph.kernels`` at debug level instead, Warp's greeting too, and standard error gets one line when
compiling begins, a bar on a terminal. Messages of other modules, warnings and errors pass through. With
``wp.config.log_level = wp.LOG_WARNING`` or ``wp.config.quiet = True`` there is no line either.
"""

import logging
import re
import sys
import threading
from typing import Any

import warp as wp

log = logging.getLogger("warp_eulsph.kernels")

# Modules that a run compiles on an empty cache, about: 41 a column, 61 the three forms of the bar.
EXPECTED = 50
# After so long [s] without a kernel the bar is taken away: nobody says which kernel is the last.
PATIENCE = 3.0

# Kernels of the package are made in functions of these names: that is all of them that the messages tell.
_OWN = re.compile(r"^\s*Module _?make_\w+?__locals__\w+ .*took (?P<ms>[\d.]+) ms\s*(?P<compiled>\(compiled\))?")
_GREETING = re.compile(r"^Warp \d+\.\d+")


class Notices:
    """A logger for Warp (``wp.set_logger``) that sums up the messages of the package's kernels.

    Args:
        other: logger that gets all other messages.
        stream: where the line goes; standard error, whatever that is at the time, if None.
    """

    def __init__(self, other: Any, stream: Any = None):
        self.other, self.stream = other, stream
        self.compiled = 0
        self._bar: Any = None
        self._idle: threading.Timer | None = None
        self._lock = threading.Lock()

    def debug(self, message: str) -> None:
        """Passed on."""
        self.other.debug(message)

    def info(self, message: str) -> None:
        """Passed on, unless it is about kernels of the package or Warp's greeting."""
        own = _OWN.match(message)
        if own is None and not _GREETING.match(message):
            self.other.info(message)
            return
        log.debug("%s", message.strip())
        if own and own["compiled"] and not getattr(wp.config, "quiet", False):
            self._count(float(own["ms"]) / 1e3)

    def warning(self, message: str, category: Any = None, stacklevel: int = 1) -> None:
        """Passed on."""
        self.other.warning(message, category, stacklevel + 1)

    def error(self, message: str) -> None:
        """Passed on."""
        self.other.error(message)

    def _count(self, seconds: float) -> None:
        with self._lock:
            self.compiled += 1
            if self.compiled == 2:  # one alone is not worth a line, and the first pays for the compiler's start too
                self._begin(f"compiling kernels once, about {EXPECTED * seconds:.0f} s")
            elif self._bar is not None:
                self._bar.total = max(self._bar.total, self.compiled)
                self._bar.update()
                self._wait()

    def _begin(self, text: str) -> None:
        stream = sys.stderr if self.stream is None else self.stream
        if not stream.isatty():
            stream.write(f"{text}\n")
            return
        from tqdm import tqdm

        self._bar = tqdm(
            total=EXPECTED, initial=2, desc=text, file=stream, leave=False, bar_format="{desc} |{bar:20}| {n}"
        )
        self._wait()

    def _wait(self) -> None:
        if self._idle is not None:
            self._idle.cancel()
        self._idle = threading.Timer(PATIENCE, self._end)
        self._idle.daemon = True
        self._idle.start()

    def _end(self) -> None:
        with self._lock:
            if self._bar is not None:
                self._bar.close()
                self._bar = None


def sum_up_compiling() -> None:
    """From now on Warp's messages go through ``Notices``; once is enough."""
    if not isinstance(wp.get_logger(), Notices):
        wp.set_logger(Notices(wp.get_logger()))
