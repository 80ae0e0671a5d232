"""Least and largest values that several threads may write to; Warp's own on the CPU are for one thread."""

import functools

import warp as wp

_SNIPPET = """
#if defined(__CUDA_ARCH__)
    // read first: most threads need no turn at the one address that all of them write to
    if (value {better} *(volatile {type}*)({place})) wp::atomic_{name}({place}, value);
#else
    constexpr int relaxed = __ATOMIC_RELAXED;
    {type} old;
    __atomic_load({place}, &old, relaxed);
    while (value {better} old && !__atomic_compare_exchange({place}, &old, &value, true, relaxed, relaxed)) {{}}
#endif
"""


@functools.cache
def raise_to(real: type) -> wp.Function:
    """``wp.func`` (target, value): target[0] ← max(target[0], value); NaN changes nothing."""
    name = {wp.float64: "double", wp.float32: "float", wp.int32: "int"}[real]

    @wp.func_native(_SNIPPET.format(name="max", type=name, better=">", place="target.data"))
    def raise_to(target: wp.array(dtype=real), value: real): ...

    return raise_to


@functools.cache
def raise_at(real: type) -> wp.Function:
    """``wp.func`` (target, i, value): target[i] ← max(target[i], value); NaN changes nothing."""
    name = "double" if real is wp.float64 else "float"

    @wp.func_native(_SNIPPET.format(name="max", type=name, better=">", place="target.data + i"))
    def raise_at(target: wp.array(dtype=real), i: int, value: real): ...

    return raise_at


@wp.func_native(_SNIPPET.format(name="min", type="int", better="<", place="target.data"))
def lower_to(target: wp.array(dtype=wp.int32), value: wp.int32):
    """target[0] ← min(target[0], value)."""


@wp.func_native(_SNIPPET.format(name="min", type="int", better="<", place="target.data + i"))
def lower_at(target: wp.array(dtype=wp.int32), i: int, value: wp.int32):
    """target[i] ← min(target[i], value)."""
