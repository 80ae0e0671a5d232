"""Steps are taken whole: Ctrl-C waits for their end, and whatever breaks into one is not forgotten."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any

import warp as wp


class BrokenError(RuntimeError):
    """A simulation is asked to go on from the middle of a step, which something broke into."""


_undivided = False


@contextmanager
def undivided() -> Iterator[None]:
    """What is short and would leave the whole process in disorder, within a step: a second signal waits here too.

    A recording that is broken into goes on for ever, and takes in what any simulation launches.
    """
    global _undivided
    _undivided = True
    try:
        yield
    finally:
        _undivided = False


class Whole:
    """Guards what must not be left half done: ``with whole: step()``. To be entered in turn (``turns``).

    SIGINT (Ctrl-C) is held back until the end, in the main thread; a second one breaks in at once. After any exception
    in between, ``check`` raises until ``mend`` says that all is as it should be.

    Attributes:
        broken: what broke in, None while all is well.
    """

    def __init__(self) -> None:
        self.broken: str | None = None
        self._held = 0
        self._before: Any = None

    def check(self) -> None:
        """Raise unless all is well.

        Raises:
            BrokenError: an exception left a step half done.
        """
        if self.broken is not None:
            raise BrokenError(
                f"a step was left half done by {self.broken}, so that going on would be silently wrong; restore() a "
                "checkpoint (of a recorded run: resume it), or build the simulation anew"
            )

    def mend(self) -> None:
        """Note that the state is whole again."""
        self.broken = None

    def __enter__(self) -> None:
        if taped():
            raise RuntimeError(
                "a step must not be taken within a tape, got a wp.Tape that records: kernels have no backward pass, so "
                "that gradients would be zero; leave the tape, and take derivatives by differences of runs"
            )
        self._hold_back()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if kind is not None:
            self.broken = f"{kind.__name__}: {error}" if str(error) else kind.__name__
        self._release()

    def _hold_back(self) -> None:
        """Hold signals back, in the main thread."""
        if threading.current_thread() is not threading.main_thread():
            return
        before = signal.getsignal(signal.SIGINT)
        if callable(before):  # neither ignored, nor left to the system, nor set by other than Python
            self._before, self._held = before, 0
            signal.signal(signal.SIGINT, self._hold)

    def _hold(self, number: int, frame: FrameType | None) -> None:
        self._held += 1
        if self._held > 1 and not _undivided:  # somebody does not want to wait
            # Noted here too: a third one may come before __exit__
            before, self.broken = self.broken, KeyboardInterrupt.__name__
            self._release()
            self.broken = before  # whose signal it is goes on

    def _release(self) -> None:
        """Give the signal back to who had it before, if it is held, and pass on what came meanwhile."""
        if self._before is None:
            return
        before, self._before = self._before, None
        signal.signal(signal.SIGINT, before)
        held, self._held = self._held, 0
        for _ in range(held):
            signal.raise_signal(signal.SIGINT)


def taped() -> bool:
    """Whether a ``wp.Tape`` is recording, which Warp has no public way to ask."""
    return wp._src.context.runtime.tape is not None
