"""How kernels run: on how many threads of the CPU, by SIMD kernels or the portable ones, launched or as graphs.

None of it changes what is computed. Threads keep every bit: each particle gathers its own sums, so that it does not
matter who computes it. Graphs keep every bit: they hold the same launches. SIMD kernels differ from the portable ones
by round-off.

The environment sets the defaults: ``WARP_EULSPH_THREADS`` (all cores the process may use), ``WARP_EULSPH_SIMD``
(1; 0 turns it off) and ``WARP_EULSPH_GRAPHS`` (auto: on GPUs, and on the CPU where a launch is not worth several
threads; 0 or 1).
"""

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from itertools import pairwise
from typing import Any

import warp as wp

from .turns import in_child, turn

# Below this many particles a pointwise kernel takes less time than handing it to a thread (some 20 µs).
LEAST_RANGE = 2048
# More ranges than threads, so that a core that is busy elsewhere takes fewer of them.
RANGES_PER_THREAD = 4
# Launches that an object repeats are a few dozen; arguments that are made anew each time must not pile up.
MOST_RECORDED = 256


def cores() -> int:
    """Cores that the process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _from_environment() -> tuple[int, bool, bool | None]:
    given = os.environ.get("WARP_EULSPH_THREADS", "")
    if given and not (given.isascii() and given.isdecimal() and len(given) < 5 and int(given) > 0):
        raise ValueError(f"WARP_EULSPH_THREADS must be a number of threads, from 1 to 9999, got {given!r}")
    vectors = os.environ.get("WARP_EULSPH_SIMD", "1")
    if vectors not in ("0", "1"):
        raise ValueError(f"WARP_EULSPH_SIMD must be 0 or 1, got {vectors!r}")
    recorded = os.environ.get("WARP_EULSPH_GRAPHS", "auto")
    if recorded not in ("auto", "0", "1"):
        raise ValueError(f"WARP_EULSPH_GRAPHS must be auto, 0 or 1, got {recorded!r}")
    return int(given) if given else cores(), vectors == "1", {"auto": None, "0": False, "1": True}[recorded]


_wrong: str | None = None
try:
    _threads, _simd, _graphs = _from_environment()
except ValueError as error:  # told when something is to be run, not by a package that cannot be imported
    _threads, _simd, _graphs, _wrong = 1, True, None, str(error)
_pool: ThreadPoolExecutor | None = None


def threads() -> int:
    """Threads that share the particles of a launch on the CPU."""
    return _threads


def set_threads(count: int | None = None) -> None:
    """Use ``count`` threads on the CPU from now on; all cores that the process may use by default."""
    global _threads, _pool
    if count is not None and count < 1:
        raise ValueError(f"threads must be at least 1, got {count}; None takes all cores")
    with turn.lock:
        if _pool is not None:
            _pool.shutdown()
        _threads, _pool = cores() if count is None else count, None


def set_simd(on: bool) -> None:
    """Whether simulations made from now on use SIMD kernels where they run on the CPU."""
    global _simd
    _simd = on


def simd(device: wp.DeviceLike) -> bool:
    """Whether SIMD kernels are to be used on this device.

    Raises:
        ValueError: the environment sets something that is none of its values.
    """
    if _wrong is not None:
        raise ValueError(_wrong)
    return _simd and wp.get_device(device).is_cpu


def set_graphs(on: bool | None = None) -> None:
    """Whether simulations made from now on take their steps as graphs; None where that is faster."""
    global _graphs
    _graphs = on


def graphs(device: wp.DeviceLike, n: int) -> bool:
    """Whether steps of ``n`` particles on this device are to be recorded as graphs.

    By default on GPUs whose driver knows conditional graphs, and on the CPU where launches are too short for threads: a
    graph on the CPU runs on one.

    Raises:
        ValueError: the environment sets something that is none of its values.
    """
    if _wrong is not None:
        raise ValueError(_wrong)
    if _graphs is not None:
        return _graphs
    on_cpu = wp.get_device(device).is_cpu
    return n < 2 * LEAST_RANGE if on_cpu else wp.is_conditional_graph_supported()


def device_of(given: wp.DeviceLike) -> wp.Device:
    """The device that is meant.

    Raises:
        ValueError: it is not here.
    """
    try:
        return wp.get_device(given)
    except (ValueError, RuntimeError) as error:
        here = [device.alias for device in wp.get_devices()]
        raise ValueError(f"device must be one of {here}, got {given!r}; None takes Warp's default") from error


class Launcher:
    """Launches of one object on one device, recorded: a repeated one costs a fifth of ``wp.launch``.

    Two launches are the same if kernel, extent and arguments are: numbers equal, arrays and structs the same objects.
    What fields of a struct point to may change in between.
    """

    def __init__(self, device: wp.DeviceLike):
        self.device = wp.get_device(device)
        self._recorded: dict[tuple[Any, ...], tuple[list[Any], Any]] = {}

    def __call__(self, kernel: wp.Kernel, n: int, arguments: Sequence[Any], first: int = 0, each: int = 1) -> None:
        """Launch over particles ``first`` … ``first + n − 1``, in ranges on several threads on the CPU.

        Or over blocks of ``each`` particles, numbered so.

        The kernel's first parameter, which is not among ``arguments``, is the index that its thread 0 has. It must
        write to its own particle only.
        """
        if n:
            with turn.lock:
                _together(self._commands(kernel, _ranges_on(self.device, n, each), arguments, first))

    def once(self, kernel: wp.Kernel, dim: int, arguments: Sequence[Any]) -> None:
        """Launch a kernel of ``dim`` threads, few, that has no such parameter, in one piece."""
        with turn.lock:
            self._commands(kernel, ((0, dim),), arguments, None)[0].launch()

    def forget(self) -> None:
        """Let go of the recorded launches and of the arrays they hold."""
        self._recorded.clear()

    def _commands(
        self, kernel: wp.Kernel, ranges: tuple[tuple[int, int], ...], arguments: Sequence[Any], first: int | None
    ) -> list[Any]:
        key = (kernel, ranges, first, *[a if isinstance(a, (int, float)) else id(a) for a in arguments])
        known = self._recorded.get(key)
        if known is None:
            if len(self._recorded) >= MOST_RECORDED:
                self.forget()
            commands = _recorded(kernel, ranges, arguments, first, self.device)
            known = self._recorded[key] = commands, arguments  # keeps the arguments, and so their ids, alive
        return known[0]


def launch(kernel: wp.Kernel, n: int, arguments: Sequence[Any], device: wp.DeviceLike, first: int = 0) -> None:
    """Launch as a ``Launcher`` does, once, for arguments that will not come again."""
    device = wp.get_device(device)
    if n:
        with turn.lock:
            _together(_recorded(kernel, _ranges_on(device, n), arguments, first, device))


def _recorded(
    kernel: wp.Kernel,
    ranges: tuple[tuple[int, int], ...],
    arguments: Sequence[Any],
    first: int | None,
    device: wp.DeviceLike,
) -> list[Any]:
    lead = [[] if first is None else [first + begin] for begin, _ in ranges]
    return [
        wp.launch(kernel, end - begin, [*own, *arguments], device=device, record_cmd=True)
        for own, (begin, end) in zip(lead, ranges, strict=True)
    ]


def _together(commands: list[Any]) -> None:
    """Launch all of them, on several threads."""
    if len(commands) == 1:
        commands[0].launch()
        return
    # A launch on the CPU releases the interpreter's lock while it runs; whoever is free takes the next range.
    rest = iter(commands)
    waiting = [_workers().submit(_take, rest) for _ in range(min(_threads, len(commands)) - 1)]
    try:
        _take(rest)
    finally:  # whatever broke in: what still runs would write into what comes next
        wait(waiting)
    for worker in waiting:
        worker.result()


def _take(commands: Iterator[Any]) -> None:
    for command in commands:
        command.launch()


def _ranges_on(device: wp.DeviceLike, n: int, each: int = 1) -> tuple[tuple[int, int], ...]:
    whole = not device.is_cpu or device.is_capturing  # a graph on the CPU runs on one thread
    return ((0, n),) if whole else _ranges(n, each)


def _ranges(n: int, each: int = 1) -> tuple[tuple[int, int], ...]:
    """[begin, end) of the ranges that n blocks of ``each`` particles are split into."""
    count = 1 if _threads == 1 else min(_threads * RANGES_PER_THREAD, n * each // LEAST_RANGE, n)
    if count <= 1:
        return ((0, n),)
    ends = [n * k // count for k in range(count + 1)]
    return tuple(pairwise(ends))


def _workers() -> ThreadPoolExecutor:
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(_threads - 1, thread_name_prefix="warp-eulsph")
    return _pool


def _forget_workers() -> None:
    """A child process has no thread but its own."""
    global _pool
    _pool = None


in_child.append(_forget_workers)
