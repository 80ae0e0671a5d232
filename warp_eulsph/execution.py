"""How kernels run on the CPU: on how many threads, and whether by SIMD kernels or by the portable ones.

Neither changes what is computed. Threads keep every bit: each particle gathers its own sums, so that it does not matter
who computes it. SIMD kernels differ from the portable ones by round-off.

The environment sets the defaults: ``WARP_EULSPH_THREADS`` (all cores the process may use) and ``WARP_EULSPH_SIMD``
(1; 0 turns it off).
"""

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

import warp as wp

# Below this many particles a range costs less than handing it to a thread (about 20 µs).
LEAST_RANGE = 512
# More ranges than threads, so that a core that is busy elsewhere takes fewer of them.
RANGES_PER_THREAD = 4


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _from_environment() -> tuple[int, bool]:
    given = os.environ.get("WARP_EULSPH_THREADS", "")
    if given and not (given.isdigit() and int(given) > 0):
        raise ValueError(f"WARP_EULSPH_THREADS must be a number of threads, at least 1, got {given!r}")
    vectors = os.environ.get("WARP_EULSPH_SIMD", "1")
    if vectors not in ("0", "1"):
        raise ValueError(f"WARP_EULSPH_SIMD must be 0 or 1, got {vectors!r}")
    return int(given) if given else _cores(), vectors == "1"


_threads, _simd = _from_environment()
_pool: ThreadPoolExecutor | None = None


def threads() -> int:
    """Threads that share the particles of a launch on the CPU."""
    return _threads


def set_threads(count: int | None = None) -> None:
    """Use ``count`` threads on the CPU from now on; all cores that the process may use by default."""
    global _threads, _pool
    if count is not None and count < 1:
        raise ValueError(f"threads must be at least 1, got {count}; None takes all cores")
    if _pool is not None:
        _pool.shutdown()
    _threads, _pool = _cores() if count is None else count, None


def set_simd(on: bool) -> None:
    """Whether simulations made from now on use SIMD kernels where they run on the CPU."""
    global _simd
    _simd = on


def simd(device: Any) -> bool:
    """Whether SIMD kernels are to be used on this device."""
    return _simd and wp.get_device(device).is_cpu


def launch(kernel: Any, n: int, arguments: Sequence[Any], device: Any, first: int = 0) -> None:
    """Launch a kernel over particles ``first`` … ``first + n − 1``, in ranges on several threads on the CPU.

    The kernel's first parameter, which is not among ``arguments``, is the index that its thread 0 has. It must write to
    its own particle only.
    """
    ranges = _ranges(n) if wp.get_device(device).is_cpu else [(0, n)]
    if len(ranges) == 1:
        wp.launch(kernel, n, [first, *arguments], device=device)
        return
    commands = [
        wp.launch(kernel, end - begin, [first + begin, *arguments], device=device, record_cmd=True)
        for begin, end in ranges
    ]
    # A launch on the CPU releases the interpreter's lock while it runs; whoever is free takes the next range.
    rest = iter(commands)
    waiting = [_workers().submit(_take, rest) for _ in range(_threads - 1)]
    _take(rest)
    for worker in waiting:
        worker.result()


def _take(commands: Iterator[Any]) -> None:
    for command in commands:
        command.launch()


def _ranges(n: int) -> list[tuple[int, int]]:
    """[begin, end) of the ranges that n particles are split into."""
    count = 1 if _threads == 1 else min(_threads * RANGES_PER_THREAD, n // LEAST_RANGE)
    if count <= 1:
        return [(0, n)]
    ends = [n * k // count for k in range(count + 1)]
    return list(pairwise(ends))


def _workers() -> ThreadPoolExecutor:
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(_threads - 1, thread_name_prefix="warp-eulsph")
    return _pool
