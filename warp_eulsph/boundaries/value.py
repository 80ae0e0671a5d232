"""Values of conditions: constants, arrays, or functions of position and time."""

import functools
from typing import Any

import numpy as np
import warp as wp

from ..checks import real_array, spread
from ..execution import Launcher
from ..fields import clock_structure
from ..space import Space
from ..structs import ClockArrays
from .base import Assembly, check_takes, read_only


@functools.cache
def _make_evaluate(space: Space, components: int, function: Any) -> wp.Kernel:
    real, vec, value = space.real, space.vec, space.row(components)
    Clock = clock_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def evaluate(
        first: int,
        indices: wp.array(dtype=wp.int32),
        x: wp.array(dtype=vec),
        clock: Clock,
        fraction: wp.float64,
        out: wp.array(dtype=value),
    ):
        k = first + wp.tid()
        a = indices[k]
        run = clock.run[a]
        t = clock.t[run] + fraction * clock.dt[run]
        out[k] = value(function(x[a], real(t)))

    return evaluate


class Value:
    """Rows of ``components`` reals for k particles, kept on the device.

    Attributes:
        places: of the particles in memory, (k,) int32 on the device.

    Args:
        assembly: the particles.
        indices: numbers of those it is for, (k,).
        components: reals in a row.
        given: a number or (components,) for all; (k, components), or (k,) when components is 1, one each, in the order
            of ``indices``, which is that of the region's own; a
            ``wp.func`` (x, t) -> row, evaluated on the device; or a Python function (x (k, dim), t) -> any of these
            shapes, evaluated on the host each step (slower: it reads the device).
        who: named in errors.
        places: rows of the arrays of positions that ``at`` gets, where those are not of all particles.
    """

    def __init__(
        self,
        assembly: Assembly,
        indices: np.ndarray,
        components: int,
        given: Any,
        who: str,
        places: wp.array | None = None,
    ):
        self.space, self.device, self.components, self.who = assembly.space, assembly.device, components, who
        self.count, self._launch = len(indices), Launcher(assembly.device)
        self.places = assembly.order.places_of(indices) if places is None else places
        self.rows = wp.zeros(len(indices), dtype=self.space.row(components), device=assembly.device)
        self.function = given if callable(given) else None
        self.on_device = isinstance(given, wp.Function)
        if self.function is None:
            self.rows.assign(self._broadcast(given))
        elif not self.on_device:
            check_takes(given, 2, f"{who}: value", "lambda x, t: 0.0 * x")
            self._broadcast(
                given(read_only(assembly.X[indices]), 0.0)
            )  # a wrong function fails now, not in the first step

    @property
    def recordable(self) -> bool:
        """Whether the rows need no Python function."""
        return self.function is None or self.on_device

    def at(self, x: wp.array, clock: ClockArrays, fraction: float) -> wp.array:
        """The rows at positions ``x`` [m] and time t + fraction · Δt, (k,)."""
        if self.on_device:
            kernel = _make_evaluate(self.space, self.components, self.function)
            self._launch(kernel, len(self.places), [self.places, x, clock, fraction, self.rows])
        elif self.function is not None:
            t = float(clock.t.numpy()[0]) + fraction * float(clock.dt.numpy()[0])
            self.rows.assign(self._broadcast(self.function(read_only(x.numpy()[self.places.numpy()]), t)))
        return self.rows

    def _broadcast(self, given: Any) -> np.ndarray:
        values = real_array(given, f"{self.who}: values", self.space.numpy)
        if self.components == 1 and values.shape == (self.count,):
            values = values[:, None]
        return np.ascontiguousarray(spread(values, (self.count, self.components), f"{self.who}: values"))
