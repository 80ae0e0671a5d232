"""Memory of a simulation: the Warp arrays that hang on it."""

from typing import Any

import warp as wp


def array_bytes(root: Any) -> int:
    """Bytes of all Warp arrays reachable from an object; memory that several arrays share counts once."""
    spans: list[tuple[int, int]] = []
    seen: set[int] = set()
    waiting = [root]
    while waiting:
        thing = waiting.pop()
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        if isinstance(thing, wp.array):
            if thing.ptr:
                spans.append((thing.ptr, thing.ptr + thing.capacity))
        elif isinstance(thing, dict):
            waiting.extend(thing.values())
        elif isinstance(thing, (list, tuple)):
            waiting.extend(thing)
        elif hasattr(thing, "_cls") and hasattr(thing._cls, "vars"):  # an instance of a wp.struct
            waiting.extend(getattr(thing, name) for name in thing._cls.vars)
        elif type(thing).__module__.startswith("warp_eulsph") and hasattr(thing, "__dict__"):
            waiting.extend(vars(thing).values())
    total, reached = 0, 0
    for begin, end in sorted(spans):
        total += max(0, end - max(begin, reached))
        reached = max(reached, end)
    return total
