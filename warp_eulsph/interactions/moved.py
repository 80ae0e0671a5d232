"""Whether particles have moved against each other so far that what was found of them is to be found anew."""

import functools

import warp as wp

from ..atomics import raise_at
from ..execution import Launcher
from ..fields import clock_structure
from ..space import Space
from ..structs import ClockArrays, StateArrays


@functools.cache
def _make_note(space: Space) -> wp.Kernel:
    """Kernel: where particles are."""
    vec = space.vec

    @wp.kernel(module="unique", enable_backward=False)
    def note(first: int, places: wp.array(dtype=wp.int32), x: wp.array(dtype=vec), at: wp.array(dtype=vec)):
        k = first + wp.tid()
        at[k] = x[places[k]]

    return note


@functools.cache
def _make_spread(space: Space) -> wp.Kernel:
    """Kernel: the ends of the box of all displacements, the lower ones negative; with ``ahead`` also those to come."""
    real, vec, dim, Clock, raise_end = space.real, space.vec, space.dim, clock_structure(space), raise_at(space.real)

    @wp.kernel(module="unique", enable_backward=False)
    def find_spread(
        first: int,
        places: wp.array(dtype=wp.int32),
        x: wp.array(dtype=vec),
        v: wp.array(dtype=vec),
        clock: Clock,
        ahead: wp.float64,
        at: wp.array(dtype=vec),
        ends: wp.array(dtype=real),
    ):
        k = first + wp.tid()
        a = places[k]
        moved = x[a] - at[k]
        later = moved + v[a] * real(ahead * clock.free_dt[0])
        for i in range(wp.static(dim)):
            raise_end(ends, i, wp.max(moved[i], later[i]))
            raise_end(ends, dim + i, -wp.min(moved[i], later[i]))

    return find_spread


@functools.cache
def _make_decide(space: Space) -> wp.Kernel:
    """Kernel of one thread: whether the box is larger than allowed, or anything else says so; ends are reset."""
    real, dim = space.real, space.dim

    @wp.kernel(module="unique", enable_backward=False)
    def decide(
        ends: wp.array(dtype=real),
        allowed: real,
        stale: wp.array(dtype=wp.int32),
        far: wp.array(dtype=wp.int32),
        running: wp.array(dtype=wp.int32),
    ):
        square = real(0.0)
        for i in range(wp.static(dim)):
            width = ends[i] + ends[dim + i]
            square += width * width
        if not (wp.sqrt(square) <= allowed) or stale[0] == 1:
            far[0] = 1
            running[0] = 0
        for i in range(wp.static(2 * dim)):
            ends[i] = real(-wp.inf)

    return decide


class Moved:
    """Displacements of particles since something was found of them.

    What matters is how two of them moved against each other, which is no more than the diagonal of the box that holds
    all displacements: bodies that fly along together have not moved.

    Args:
        space: dimension and precision.
        places: where the particles lie, (k,) int32 on the device.
        allowed: relative motion [m] up to which what was found holds.

    Attributes:
        at: where they were then [m], (k,) of vec.
        stale: 1 where it is to be found anew in any case, (1,) int32.
    """

    def __init__(self, space: Space, places: wp.array, allowed: float):
        self.space, self.places, self.allowed, device = space, places, allowed, places.device
        self._launch = Launcher(device)
        self.at = wp.zeros(len(places), dtype=space.vec, device=device)
        self._ends = wp.full(2 * space.dim, -float("inf"), dtype=space.real, device=device)
        self.stale = wp.full(1, 1, dtype=wp.int32, device=device)
        self._far, self._nobody = (wp.zeros(1, dtype=wp.int32, device=device) for _ in range(2))

    def forget(self) -> None:
        """Have it found anew in any case."""
        self.stale.fill_(1)

    def note(self, x: wp.array) -> None:
        """It was found where particles are at ``x`` [m], (n,) of vec by place."""
        self._launch(_make_note(self.space), len(self.at), [self.places, x, self.at])
        self.stale.zero_()
        self._far.zero_()

    def check(self, state: StateArrays, clock: ClockArrays, ahead: float, running: wp.array) -> None:
        """Set ``running`` to 0 where something has moved too far, or will at its present speed; launches only.

        Args:
            state: struct ``State``.
            clock: struct ``Clock``.
            ahead: time to look ahead, over the last step.
            running: (1,) int32.
        """
        arguments = [self.places, state.x, state.v, clock, ahead, self.at, self._ends]
        self._launch(_make_spread(self.space), len(self.at), arguments)
        arguments = [self._ends, self.allowed, self.stale, self._far, running]
        self._launch.once(_make_decide(self.space), 1, arguments)

    def __call__(self, state: StateArrays, clock: ClockArrays, ahead: float = 0.0) -> bool:
        """Whether something has moved too far, or will; reads the device."""
        self.check(state, clock, ahead, self._nobody)
        return self.far

    @property
    def far(self) -> bool:
        """Whether a check found that since the last note; reads the device."""
        return bool(self._far.numpy()[0])
