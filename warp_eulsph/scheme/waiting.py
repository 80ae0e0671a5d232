"""Independent runs that wait while others take a step: what a step of no length would change is put back."""

import functools
from collections.abc import Sequence

import warp as wp

from ..execution import Launcher
from ..fields import clock_structure
from ..space import Space
from ..structs import ClockArrays
from .time_step import takes_step


@functools.cache
def _make_put_back(space: Space, dtype: type) -> wp.Kernel:
    Clock, moves = clock_structure(space), takes_step(space)

    @wp.kernel(module="unique", enable_backward=False)
    def put_back(first: int, begin: int, clock: Clock, kept: wp.array(dtype=dtype), array: wp.array(dtype=dtype)):
        k = first + wp.tid()
        if not moves(clock, clock.run[begin + k]):
            array[k] = kept[k]

    return put_back


class Waiting:
    """Keeps what a refresh or a condition changes, and puts it back where runs wait.

    Args:
        arrays: that evolve, with the place of the particle that the first element of each is of.
        clock: of the medium.
    """

    def __init__(self, space: Space, arrays: Sequence[tuple[int, wp.array]], clock: ClockArrays, device: wp.DeviceLike):
        self.space, self.clock, self._launch = space, clock, Launcher(device)
        self._kept = [(begin, array, wp.empty_like(array)) for begin, array in arrays if len(array)]

    def keep(self) -> None:
        """All as it is before."""
        for _, array, kept in self._kept:
            wp.copy(kept, array)

    def put_back(self) -> None:
        """That of the particles whose runs take no part in the coming step."""
        for begin, array, kept in self._kept:
            kernel = _make_put_back(self.space, array.dtype)
            self._launch(kernel, len(array), [begin, self.clock, kept, array])
