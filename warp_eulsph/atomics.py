"""Least and largest values that several threads may write to; Warp's own on the CPU are for one thread."""

import functools

import warp as wp

_SNIPPET = """
#if defined(__CUDA_ARCH__)
    // read first: most threads need no turn at the one address that all of them write to
    if (value {better} *(volatile {type}*)target.data) wp::atomic_{name}(target.data, value);
#else
    constexpr int relaxed = __ATOMIC_RELAXED;
    {type} old;
    __atomic_load(target.data, &old, relaxed);
    while (value {better} old && !__atomic_compare_exchange(target.data, &old, &value, true, relaxed, relaxed)) {{}}
#endif
"""


@functools.cache
def raise_to(real: type) -> wp.Function:
    """``wp.func`` (target, value): target[0] ← max(target[0], value); NaN changes nothing."""
    name = "double" if real is wp.float64 else "float"

    @wp.func_native(_SNIPPET.format(name="max", type=name, better=">"))
    def raise_to(target: wp.array(dtype=real), value: real): ...

    return raise_to


@wp.func_native(_SNIPPET.format(name="min", type="int", better="<"))
def lower_to(target: wp.array(dtype=wp.int32), value: wp.int32):
    """target[0] ← min(target[0], value)."""
