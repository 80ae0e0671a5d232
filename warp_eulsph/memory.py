"""Memory of a simulation: about what it will take, before it is built, and what its arrays do take."""

import logging
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import warp as wp

from .execution import simd
from .fields import GROUPS
from .simd import LANES
from .space import Space

log = logging.getLogger(__name__)

# What only laws with a history have
_OF_YIELDING = ("Flux.dissipated", "Flux.secant", "Flux.tied", "Flux.slipped")


def bytes_per_particle(space: Space, reach: float, moving: bool, device: wp.DeviceLike, n: float = math.inf) -> float:
    """About what the default scheme allocates per particle, inside a body.

    Args:
        space: dimension and precision.
        reach: support radius in spacings, which says how many neighbours there are.
        moving: whether the arrangement moves: lists with room to grow, what a search needs, balanced positions. Where
            it does not, positions are tied to F.
        device: SIMD kernels of the CPU keep packed rows.
        n: particles there are, more than which are nobody's neighbours.
    """
    d, vectors = space.dim, simd(device)
    sizes = {"real": 1, "vec": d, "mat": d * d, "int": 0}
    absent = {"Forces.correction", "Forces.external", "Forces.damping", "Flux.drag", "Particles.group", *_OF_YIELDING}
    absent |= {"Flux.Pi"} if vectors or not moving else set()
    moved = {"Reference.resolution", "Reference.moment", "Flux.tie", "Forces.tie"}
    absent |= moved if moving else {"Reference.F", "Reference.balanced"}
    present = [
        field for group, fields in GROUPS.items() for name, field in fields.items() if f"{group}.{name}" not in absent
    ]
    reals = sum(sizes[field.kind] for field in present) + 2 * d + d * d + d * d + d  # the half step, ∇v, old v
    ints, doubles = 5, 2 + 2 * 7 / 64  # body, number, place, start, poor; energies, blocks of the books
    if vectors:
        reals += LANES * ((3 if moving else 4) + 2 * d)
    else:
        ints += 1  # stop
        reals += 0 if moving else 2 * LANES * d + 3  # ∇v or Π, Π̃; spin of ∇v F⁻¹
    if moving:
        reals += d + d * d + 3 * d + 3  # surface vectors of the half step, K, M13, places
        ints += 1
    if moving and vectors:
        reals += 5
        ints += 6
    item = wp.types.type_size_in_bytes(space.real)
    neighbours = min(math.pi ** (d / 2) / math.gamma(d / 2 + 1) * min(reach, 1e99) ** d, n)
    return reals * item + 4 * ints + 8 * doubles + neighbours * ((4 + item) * 1.25 if moving else 4 + 2 * item)


def available(device: wp.DeviceLike) -> int | None:
    """Bytes that can be allocated on the device, None where the system does not say.

    On the CPU what the machine has left, or the memory group of this process (as of a container or a batch job).
    """
    device = wp.get_device(device)
    if device.is_cuda:
        return int(device.free_memory)
    left = [bytes_left for bytes_left in (_of_machine(), *of_groups()) if bytes_left is not None]
    return min(left, default=None)


def _of_machine() -> int | None:
    table = Path("/proc/meminfo")
    if not table.exists():
        return None
    lines = dict(line.split(":", 1) for line in table.read_text(encoding="ascii").splitlines())
    return int(lines["MemAvailable"].split()[0]) * 1024


def of_groups(root: Path = Path("/sys/fs/cgroup"), own: Path = Path("/proc/self/cgroup")) -> list[int]:
    """Bytes left in each memory group that this process is in, those above it too; of version 1 or 2."""
    if not own.exists():
        return []
    found = []
    for line in own.read_text(encoding="utf-8", errors="replace").splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers == "" or "memory" in controllers.split(","):
            top = root if controllers == "" else root / "memory"
            folder = top / path.lstrip("/")
            found += [_left(group) for group in (folder, *folder.parents) if group == top or top in group.parents]
    return [left for left in found if left is not None]


def _left(group: Path) -> int | None:
    for limit, usage in (("memory.max", "memory.current"), ("memory.limit_in_bytes", "memory.usage_in_bytes")):
        try:
            most, used = ((group / name).read_text(encoding="ascii").strip() for name in (limit, usage))
            if most == "max":
                return None
            stat = dict(line.split() for line in (group / "memory.stat").read_text(encoding="ascii").splitlines())
            return max(int(most) - int(used) + int(stat.get("inactive_file", 0)), 0)  # files' pages make room
        except (OSError, ValueError):
            continue
    return None


def check_room(count: float, reals: float, who: str) -> None:
    """Raise MemoryError unless there is room for ``count`` rows of so many doubles, before they are made."""
    there = available("cpu")
    if there is not None and 8.0 * count * reals > there:
        raise MemoryError(
            f"{who}: {count:.4g} particles need {8e-9 * count * reals:.3g} GB to be laid out, and {there / 1e9:.3g} GB "
            "are available; increase the spacing"
        )


def check_memory(space: Space, media: Sequence[tuple[int, float, bool]], device: wp.DeviceLike) -> None:
    """Log what media will take; raise MemoryError if that is more than there is.

    Args:
        media: particles, support radius in spacings, and whether an arrangement moves, of each.
    """
    n, there = sum(count for count, _, _ in media), available(device)
    taken = sum(count * bytes_per_particle(space, reach, moving, device, count) for count, reach, moving in media)
    log.info("%d particles take about %.0f bytes each, %.3g MB", n, taken / n, taken / 1e6)
    if there is not None and taken > there:
        raise MemoryError(
            f"{n} particles take about {taken / n:.0f} bytes each, {taken / 1e9:.3g} GB, and {there / 1e9:.3g} GB are "
            "available; use fewer particles, float32, or a smaller dilation"
        )


def array_bytes(root: Any) -> int:
    """Bytes of all Warp arrays reachable from an object; memory that several arrays share counts once."""
    return sum(size for _, size in memory_by_names(root))


def memory_by_names(root: Any) -> list[tuple[list[str], int]]:
    """Blocks of memory in which Warp arrays reachable from an object lie, the names that lead to them and their bytes.

    Most first; arrays that share memory are of one block.
    """
    spans: list[tuple[int, int, str]] = []
    seen: set[int] = set()
    waiting = [("", root)]
    while waiting:
        name, thing = waiting.pop(0)
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        if isinstance(thing, wp.array):
            if thing.ptr:
                spans.append((thing.ptr, thing.ptr + thing.capacity, name))
        elif isinstance(thing, dict):
            waiting += [(f"{name}[{key}]", value) for key, value in thing.items()]
        elif isinstance(thing, (list, tuple)):
            waiting += [(f"{name}[{k}]", value) for k, value in enumerate(thing)]
        elif hasattr(thing, "_cls") and hasattr(thing._cls, "vars"):  # an instance of a wp.struct
            waiting += [(f"{name}.{own}", getattr(thing, own)) for own in thing._cls.vars]
        elif type(thing).__module__.startswith("warp_eulsph") and hasattr(thing, "__dict__"):
            waiting += [(f"{name}.{own}", value) for own, value in vars(thing).items()]
    blocks: list[tuple[list[str], int]] = []
    reached = 0
    for begin, end, name in sorted(spans, key=lambda span: (span[0], -span[1])):
        if begin >= reached:
            blocks.append(([], 0))
        names, size = blocks[-1]
        blocks[-1] = [*names, name], size + max(0, end - max(begin, reached))
        reached = max(reached, end)
    return sorted(blocks, key=lambda block: -block[1])
