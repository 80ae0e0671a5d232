"""Copies of arrays on the host, which a GPU makes while the run goes on.

There an array is first copied within the device, in the order of the run's own work, which may overwrite it from then
on; a stream of its own brings the copy to pinned memory of the host. Only the thread of the run talks to the device: it
waits for a copy, as a rule long arrived, before it hands it to the one that writes. On the CPU a copy is made at once.
"""

from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

#: Indices of the elements of an array that are copied, (k,), all if None.
Chosen = np.ndarray | None


def _rows(values: np.ndarray, chosen: Chosen) -> np.ndarray:
    """The elements asked for: all as they are, or copies, by ``take``, which is several times as fast as an index."""
    return values if chosen is None else values.take(chosen, axis=0)


class Copy:
    """Values on their way to the host.

    Args:
        values: where they will be.
        chosen: those that are asked for.
        arrived: event of their arrival; None if they are there.
        held: what must live until then.
        give_back: called when nobody needs ``values`` any more.
    """

    def __init__(
        self,
        values: np.ndarray,
        chosen: Chosen = None,
        arrived: wp.Event | None = None,
        held: wp.array | None = None,
        give_back: Callable[[], object] | None = None,
    ):
        self._values, self._chosen, self._arrived = values, chosen, arrived
        self._held, self._give_back = held, give_back

    @property
    def on_its_way(self) -> bool:
        """Whether ``wait`` has yet to be called."""
        return self._arrived is not None

    def wait(self) -> None:
        """Wait until the values have arrived."""
        if self._arrived is not None:
            wp.synchronize_event(self._arrived)
            self._arrived = self._held = None

    @property
    def values(self) -> np.ndarray:
        """The values asked for, which must have arrived; not to be used after ``release``."""
        if self.on_its_way:
            raise RuntimeError("copied values were asked for before they arrived; wait() first")
        return _rows(self._values, self._chosen)

    def release(self) -> None:
        """Leave the memory to later copies."""
        if self._give_back is not None:
            self._give_back()
            self._give_back = None


class Copies:
    """Makes copies of arrays of one device; pinned memory is used again, because to allocate it halts the device."""

    def __init__(self, device: wp.DeviceLike):
        self.device = wp.get_device(device)
        self._stream = wp.Stream(self.device) if self.device.is_cuda else None
        self._free: defaultdict[tuple[Any, ...], list[wp.array]] = defaultdict(list)

    def take(self, array: wp.array | np.ndarray, chosen: Chosen = None) -> Copy:
        """A copy of the present values of some elements; an array of the host is taken as it is."""
        if isinstance(array, np.ndarray):
            return Copy(_rows(array, chosen))
        if self._stream is None:
            values = array.numpy()
            return Copy(values.copy() if chosen is None else _rows(values, chosen))
        free = self._free[array.shape, array.dtype]
        host = free.pop() if free else wp.empty(array.shape, dtype=array.dtype, device="cpu", pinned=True)
        staged = wp.clone(array)
        self._stream.wait_stream(self.device.stream)
        wp.copy(host, staged, stream=self._stream)
        return Copy(host.numpy(), chosen, self._stream.record_event(), staged, lambda: free.append(host))
