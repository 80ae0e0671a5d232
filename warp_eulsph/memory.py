"""Memory of a simulation: about what it will take, before it is built, and what its arrays do take."""

import logging
import math
from pathlib import Path
from typing import Any

import warp as wp

from .execution import simd
from .fields import GROUPS
from .simd import LANES
from .space import Space

log = logging.getLogger(__name__)


def bytes_per_particle(space: Space, reach: float, moving: bool, device: Any) -> float:
    """About what the default scheme allocates per particle, inside a body.

    Args:
        space: dimension and precision.
        reach: support radius in spacings, which says how many neighbours there are.
        moving: whether the arrangement moves: lists with room to grow, what a search needs, balanced positions. Where
            it does not, positions are tied to F.
        device: SIMD kernels of the CPU keep packed rows.
    """
    d, vectors = space.dim, simd(device)
    sizes = {"real": 1, "vec": d, "mat": d * d, "int": 0}
    absent = {"Forces.correction", "Forces.external"} | ({"Flux.Pi"} if vectors else set())
    absent |= {"Reference.resolution", "Flux.tie", "Forces.tie"} if moving else {"Reference.F", "Reference.balanced"}
    present = [
        field for group, fields in GROUPS.items() for name, field in fields.items() if f"{group}.{name}" not in absent
    ]
    reals = sum(sizes[field.kind] for field in present) + 2 * d + d * d + d * d + d  # the half step, ∇v, old v
    ints, doubles = 4, 2 + 2 * 7 / 64  # body, number, start, poor; energies, blocks of the books
    if vectors:
        reals += LANES * (3 + 2 * d)
    if not moving:
        reals += LANES * (1 + d)
    if moving:
        reals += d + d * d + 3 * d + 3  # surface vectors of the half step, K, M13, places
        ints += 1
    if moving and vectors:
        reals += 5
        ints += 6
    item = wp.types.type_size_in_bytes(space.real)
    neighbours = math.pi ** (d / 2) / math.gamma(d / 2 + 1) * reach**d
    return reals * item + 4 * ints + 8 * doubles + neighbours * (4 + item) * (1.25 if moving else 1.0)


def available(device: Any) -> int | None:
    """Bytes that can be allocated on the device, None where the system does not say."""
    device = wp.get_device(device)
    if device.is_cuda:
        return int(device.free_memory)
    table = Path("/proc/meminfo")
    if not table.exists():
        return None
    lines = dict(line.split(":", 1) for line in table.read_text(encoding="ascii").splitlines())
    return int(lines["MemAvailable"].split()[0]) * 1024


def check_memory(space: Space, n: int, reach: float, moving: bool, device: Any) -> None:
    """Log what ``n`` particles will take; raise MemoryError if that is more than there is."""
    each, there = bytes_per_particle(space, reach, moving, device), available(device)
    log.info("%d particles take about %.0f bytes each, %.3g MB", n, each, n * each / 1e6)
    if there is not None and n * each > there:
        raise MemoryError(
            f"{n} particles take about {each:.0f} bytes each, {n * each / 1e9:.3g} GB, and {there / 1e9:.3g} GB are "
            "available; use fewer particles, float32, or a smaller dilation"
        )


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
