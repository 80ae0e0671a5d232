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
from typing import Any, TypeVar

T = TypeVar("T")

#: Time [s] that who gives the lock back leaves for others to take it.
PAUSE = 2e-5


class Turn:
    """Who has its lock launches kernels; a thread may take it again.

    It is taken by ``with turn.lock``, or ``call``, which lets those go first who wait. Its lock is of C, which Ctrl-C
    cannot come between and the block: an ``__enter__`` or ``__exit__`` of Python can be left with the lock taken for
    good, and other threads would wait for ever.
    """

    def __init__(self) -> None:
        self.lock: Any = threading.RLock()
        self._waiting: set[int] = set()

    def reset(self) -> None:
        """Make it as new, held by nobody."""
        self.lock._at_fork_reinit()
        self._waiting.clear()

    def call(self, function: Callable[..., T], *arguments: Any, **options: Any) -> T:
        """Call ``function`` in turn; afterwards those who wait have theirs."""
        if self.lock._is_owned():
            return function(*arguments, **options)
        me = threading.get_ident()
        try:
            self._waiting.add(me)
            with self.lock:
                self._waiting.discard(me)
                return function(*arguments, **options)
        finally:
            self._waiting.discard(me)
            if self._waiting:
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
                setter = member.fset and alone(member.fset)
                setattr(cls, name, property(member.fget and alone(member.fget), setter, None, member.__doc__))
            elif callable(member):
                setattr(cls, name, alone(member))
        return cls

    return decorate


def alone(function: Callable[..., T]) -> Callable[..., T]:
    """Decorator: calls wait for their turn."""

    @functools.wraps(function)
    def in_turn(*arguments: Any, **options: Any) -> T:
        return turn.call(function, *arguments, **options)

    return in_turn


def _begin_child() -> None:
    for step in in_child:
        step()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=turn.lock.acquire, after_in_parent=turn.lock.release, after_in_child=_begin_child)
