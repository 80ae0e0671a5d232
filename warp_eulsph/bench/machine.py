"""What the machine can do: memory bandwidth by a triad, arithmetic by chains of fused multiply-adds."""

import functools
import time
from typing import Any

import warp as wp

from ..execution import Launcher

TRIAD_BYTES = 256 * 2**20  # of the three arrays together, beyond any cache
CHAINS = 12  # independent ones, enough to hide the latency of a multiply-add
ROUNDS = 1_000  # a call of milliseconds: on a machine that others use, some of many calls are not interrupted
ROWS = 4096  # elements of the triad that one thread index does


@functools.cache
def _make_triad(real: type) -> wp.Kernel:
    @wp.func_native(f"for (int i = a * {ROWS}; i < (a + 1) * {ROWS}; ++i) x.data[i] = y.data[i] + s * z.data[i];")
    def rows(a: int, s: real, x: wp.array(dtype=real), y: wp.array(dtype=real), z: wp.array(dtype=real)): ...

    @wp.kernel(module="unique", enable_backward=False)
    def triad(first: int, s: real, x: wp.array(dtype=real), y: wp.array(dtype=real), z: wp.array(dtype=real)):
        rows(first + wp.tid(), s, x, y, z)

    return triad


@functools.cache
def _make_multiply_add(real: type) -> wp.Kernel:
    name = "double" if real is wp.float64 else "float"
    lanes = 64 // wp.types.type_size_in_bytes(real)

    @wp.func_native(f"""
    #pragma clang fp contract(fast)
    typedef {name} V __attribute__((ext_vector_type({lanes})));
    V chains[{CHAINS}];
    #pragma unroll
    for (int i = 0; i < {CHAINS}; ++i) chains[i] = ({name})(a + i);
    for (int round = 0; round < {ROUNDS}; ++round) {{
        #pragma unroll
        for (int i = 0; i < {CHAINS}; ++i) chains[i] = chains[i] * s + s;
    }}
    V total = 0;
    #pragma unroll
    for (int i = 0; i < {CHAINS}; ++i) total += chains[i];
    {name} sum = 0;
    #pragma unroll
    for (int i = 0; i < {lanes}; ++i) sum += total[i];
    out.data[a] = sum;
    """)
    def chain(a: int, s: real, out: wp.array(dtype=real)): ...

    @wp.kernel(module="unique", enable_backward=False)
    def multiply_add(first: int, s: real, out: wp.array(dtype=real)):
        chain(first + wp.tid(), s, out)

    return multiply_add


def _best(run: Any, tries: int = 40) -> float:
    run()
    seconds = []
    for _ in range(tries):
        start = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def bandwidth(real: type) -> float:
    """Memory bandwidth [byte/s] of x = y + s z with the present number of threads, two reads and a write counted."""
    item = wp.types.type_size_in_bytes(real)
    count = TRIAD_BYTES // (3 * item * ROWS)
    launch = Launcher("cpu")
    x, y, z = (wp.zeros(count * ROWS, dtype=real, device="cpu") for _ in range(3))
    return 3 * item * count * ROWS / _best(lambda: launch(_make_triad(real), count, [0.5, x, y, z]))


def arithmetic(real: type) -> float:
    """Floating-point operations per second of fused multiply-adds on full vectors, two operations each."""
    count = 1024
    launch, out = Launcher("cpu"), wp.zeros(count, dtype=real, device="cpu")
    lanes = 64 // wp.types.type_size_in_bytes(real)
    return 2 * CHAINS * ROUNDS * lanes * count / _best(lambda: launch(_make_multiply_add(real), count, [0.5, out]))
