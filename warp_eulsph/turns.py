"""Simulations in several threads take turns: Warp records graphs and compiles kernels for the whole process at once.

What one thread launches while another records a graph would become part of that graph. So building, steps, and all else
that launches kernels holds one lock; who steps on and on lets others in between steps. Processes made by ``fork`` begin
between two launches, with no thread but their own; on the CPU simulations go on in them as in their parent.
"""

import functools
import os
import threading
import time
from collections.abc import Callable
from contextlib import ContextDecorator
from typing import Any, TypeVar

T = TypeVar("T")

#: Time [s] that who gives the lock back leaves for others to take it.
PAUSE = 2e-5


class Turn(ContextDecorator):
    """A lock that its thread may take again, and that is not taken at once from those who wait."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Make it as new, held by nobody."""
        self._lock, self._depth = threading.RLock(), 0
        self._waiting: set[int] = set()

    def __enter__(self) -> None:
        if not self._lock.acquire(False):
            me = threading.get_ident()
            self._waiting.add(me)
            try:
                self._lock.acquire()
            finally:
                self._waiting.discard(me)
        self._depth += 1

    def __exit__(self, *_: Any) -> None:
        self._depth -= 1
        others = self._depth == 0 and self._waiting
        self._lock.release()
        if others:
            time.sleep(PAUSE)


turn = Turn()
#: What a process made by ``fork`` does first.
in_child: list[Callable[[], None]] = [turn.reset]


def in_turn(*but: str) -> Callable[[type[T]], type[T]]:
    """Class decorator: building an object, its public methods and properties wait for their turn; not ``but`` these."""

    def decorate(cls: type[T]) -> type[T]:
        for name, member in list(vars(cls).items()):
            if name in but or (name.startswith("_") and name != "__init__"):
                continue
            if isinstance(member, property):
                setter = member.fset and _alone(member.fset)
                setattr(cls, name, property(member.fget and _alone(member.fget), setter, None, member.__doc__))
            elif callable(member):
                setattr(cls, name, _alone(member))
        return cls

    return decorate


def _alone(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def alone(*arguments: Any, **options: Any) -> Any:
        with turn:
            return function(*arguments, **options)

    return alone


def _begin_child() -> None:
    for step in in_child:
        step()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=turn.__enter__, after_in_parent=turn.__exit__, after_in_child=_begin_child)
