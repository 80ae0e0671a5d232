"""Time on the device: the step from the wave speeds, its growth, and output times hit exactly."""

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..execution import Launcher
from ..fields import clock_structure, part_of, repeated
from ..space import Space
from ..structs import ClockArrays
from .health import WELL


@dataclass(frozen=True)
class TimeStep:
    """Δt = CFL · min spacing/c, wave speeds c of the current state and spacings h_k/dilation measured in the reference.

    Particles with a poor neighbourhood (an L_a beyond those of jittered corners) ask for a smaller step, and so do
    those that strain fast: ∇v Δt is at most CFL/4. So do conditions (``Bound.limit``): with frequencies ω beside
    those of the waves, 2c/spacing at most, it is Δt = CFL/√(max (c/spacing)² + Σ (ω/2)²).

    Args:
        cfl: Courant number; by default that of the scheme, 0.8 for Verlet and 0.4 for the others.
        growth: largest ratio of successive steps.
        fixed: a constant step [s] instead; steps before a target time are still shortened to hit it.
    """

    cfl: float | None = None
    growth: float = 1.1
    fixed: float | None = None

    def __post_init__(self) -> None:
        if self.cfl is not None and not (math.isfinite(self.cfl) and self.cfl > 0.0):
            raise ValueError(f"cfl must be positive and finite, got {self.cfl}; None takes the scheme's own")
        if not self.growth > 1.0:
            raise ValueError(f"growth must be greater than 1, got {self.growth}; 1.1 lets a step double in 8")
        if self.fixed is not None and not (math.isfinite(self.fixed) and self.fixed > 0.0):
            raise ValueError(f"fixed time step must be positive and finite, got {self.fixed} s")


# From how many steps before a time that must be hit on they are of one length: a step less than 1/32 shorter is enough
EVEN = 32.0


@functools.cache
def takes_step(space: Space) -> wp.Function:
    """``wp.func`` whether run r takes part in the coming step: others are as they are after it.

    Independent runs wait for each other at times to hit and to look at, and, where references are refreshed every few
    steps, for the step at which their own is due.
    """
    Clock = clock_structure(space)

    @wp.func
    def takes_step(clock: Clock, r: int) -> bool:
        if clock.bad[r] != WELL or clock.t[r] >= clock.target[0]:
            return False
        if clock.every == 0:
            return True
        return clock.t[r] < clock.look[0] and clock.lag[r] % clock.every == 0

    return takes_step


@functools.cache
def _make_choose(space: Space) -> wp.Kernel:
    Clock, moves = clock_structure(space), takes_step(space)

    @wp.kernel(module="unique", enable_backward=False)
    def choose(first: int, clock: Clock, cfl: wp.float64, growth: wp.float64, fixed: wp.float64):
        r = first + wp.tid()
        if r == 0:
            clock.running[0] = 0  # until ``tick`` finds a run that goes on
        dt = fixed
        if fixed == wp.float64(0.0):
            rate = wp.float64(clock.rate[r])
            if clock.added[r] > wp.float64(0.0):
                rate = wp.sqrt(rate * rate + clock.added[r])
            dt = cfl / rate
            if clock.free_dt[r] > wp.float64(0.0):
                dt = wp.min(dt, growth * clock.free_dt[r])
        clock.added[r] = wp.float64(0.0)  # asked for anew before the next step
        if clock.every > 0 and not moves(clock, r):
            clock.dt[r] = wp.float64(0.0)
            return
        if clock.bad[r] != WELL:
            dt = wp.float64(0.0)  # the run has failed: time stands still until the host looks
        clock.free_dt[r] = dt
        clock.longest_dt[r] = wp.max(clock.longest_dt[r], dt)
        left = clock.target[0] - clock.t[r]
        if dt >= left * (wp.float64(1.0) - wp.float64(1.0e-10)):
            dt = wp.max(left, wp.float64(0.0))
        elif dt * wp.float64(EVEN) > left and fixed == wp.float64(0.0):
            # Even steps to the target instead of long ones and a short one, which again and again swing modes up
            dt = left / wp.ceil(left / dt * (wp.float64(1.0) - wp.float64(1.0e-10)))
        clock.dt[r] = dt

    return choose


@functools.cache
def unfinished(space: Space) -> wp.Function:
    """``wp.func`` whether run r is well and has not reached what it aims at."""
    Clock = clock_structure(space)

    @wp.func
    def unfinished(clock: Clock, r: int) -> bool:
        return clock.bad[r] == WELL and clock.t[r] < wp.min(clock.target[0], clock.look[0])

    return unfinished


@functools.cache
def _make_tick(space: Space) -> wp.Kernel:
    """Kernel: the clock of each run; the batch is at its end where nobody says otherwise."""
    Clock, goes_on = clock_structure(space), unfinished(space)

    @wp.kernel(module="unique", enable_backward=False)
    def tick(first: int, clock: Clock):
        r = first + wp.tid()
        if clock.bad[r] == WELL:
            if clock.dt[r] >= clock.target[0] - clock.t[r]:
                clock.t[r] = wp.max(clock.target[0], clock.t[r])
            else:
                clock.t[r] = clock.t[r] + clock.dt[r]
        if clock.dt[r] > wp.float64(0.0):
            clock.steps[r] = clock.steps[r] + 1
        else:
            clock.lag[r] = clock.lag[r] + 1
        if r == 0:
            clock.taken[0] = clock.taken[0] + 1
        if goes_on(clock, r):
            clock.running[0] = 1

    return tick


@functools.cache
def _make_add(space: Space) -> wp.Kernel:
    Clock, real = clock_structure(space), space.real

    @wp.kernel(module="unique", enable_backward=False)
    def add(first: int, clock: Clock):
        r = first + wp.tid()
        half = wp.float64(0.5) * wp.float64(clock.frequency[r])
        clock.added[r] = clock.added[r] + half * half
        clock.frequency[r] = real(0.0)

    return add


@functools.cache
def _make_open(space: Space) -> wp.Kernel:
    Clock = clock_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def open_batch(clock: Clock):
        clock.taken[0] = 0
        clock.running[0] = 0
        for r in range(clock.t.shape[0]):
            if clock.bad[r] == WELL and clock.t[r] < clock.target[0]:
                clock.running[0] = 1

    return open_batch


class DeviceClock:
    """The clock arrays and the launches that move them; a step at the target time has Δt = 0 and changes nothing.

    Args:
        cfl: the scheme's own Courant number, for options that leave it open.
        sizes: particles of each run that has a clock of its own, in their order; one of all where they share it.
        every: steps between refreshes of independent runs; 0 where there is one clock.

    Attributes:
        fields: struct ``Clock``. independent: whether each run has its own time and steps.
    """

    def __init__(
        self,
        space: Space,
        option: TimeStep,
        cfl: float,
        device: wp.DeviceLike,
        sizes: Sequence[int],
        every: int = 0,
    ):
        self.space, self.option, self.device, self.sizes = space, option, device, tuple(sizes)
        self.independent = every > 0
        self._launch = Launcher(device)
        self.cfl = cfl if option.cfl is None else option.cfl
        self.fields: ClockArrays = clock_structure(space)()
        runs = len(sizes)
        for name in ("t", "dt", "free_dt", "longest_dt", "added"):
            setattr(self.fields, name, wp.zeros(runs, dtype=wp.float64, device=device))
        self.fields.target, self.fields.look = (wp.zeros(1, dtype=wp.float64, device=device) for _ in range(2))
        self.fields.look.fill_(math.inf)
        self.fields.rate, self.fields.frequency = (wp.zeros(runs, dtype=space.real, device=device) for _ in range(2))
        self.fields.bad = wp.full(runs, WELL, dtype=wp.int32, device=device)
        self.fields.running, self.fields.taken = (wp.zeros(1, dtype=wp.int32, device=device) for _ in range(2))
        self.fields.steps, self.fields.lag = (wp.zeros(runs, dtype=wp.int32, device=device) for _ in range(2))
        self.fields.first, self.fields.every = 0, every
        self._run = wp.array(np.repeat(np.arange(runs), sizes if every else 1), dtype=wp.int32, device=device)
        self.fields.run = self._run if every else repeated(self._run, sum(sizes))

    def runs_of(self, span: range) -> dict[int, range]:
        """Number of each run that has particles in ``span`` -> their numbers; a run of its own is not cut."""
        if not self.independent:
            return {0: span}
        ends = np.cumsum([0, *self.sizes]).tolist()
        return {r: range(ends[r], ends[r + 1]) for r in range(len(self.sizes)) if ends[r] in span}

    def of(self, span: range) -> ClockArrays:
        """Struct ``Clock`` for kernels that count the particles of ``span`` from 0; itself where these are all."""
        if len(span) == len(self.fields.run):
            return self.fields
        own: ClockArrays = clock_structure(self.space)()
        for name in ClockArrays.__annotations__:
            setattr(own, name, getattr(self.fields, name))
        own.run, own.first = part_of(self.fields.run, span), span.start
        return own

    def evolving(self) -> dict[str, wp.array]:
        """The clock's arrays by name: what a checkpoint must hold."""
        names = ["t", "dt", "free_dt", "target", "rate", "bad"]
        if self.independent:
            names += ["longest_dt", "steps", "lag"]
        return {f"Clock.{name}": getattr(self.fields, name) for name in names}

    @property
    def well(self) -> np.ndarray:
        """Which runs have not failed, (runs,) bool, or the only one; reads the device."""
        well: np.ndarray = self.fields.bad.numpy() == WELL
        return well if self.independent else np.ones(1, dtype=bool)

    def total(self, values: np.ndarray) -> np.ndarray:
        """Sum of ``values``, (runs, …), over the runs that are well; reads the device."""
        found: np.ndarray = values[self.well].sum(axis=0) if self.independent else values[0]
        return found

    def _largest(self, values: wp.array) -> float:
        return float(values.numpy().max() if self.independent else values.numpy()[0])

    @property
    def t(self) -> float:
        """Time [s] that all runs have reached which have not failed, the last one that did if none is left; reads the
        device."""
        t = self.fields.t.numpy()
        if not self.independent:
            return float(t[0])
        well = self.well
        return float(t[well].min() if well.any() else t.max())

    @property
    def dt(self) -> float:
        """Last time step [s], the longest of independent runs; reads the device."""
        return self._largest(self.fields.dt)

    @property
    def free_dt(self) -> float:
        """Last time step [s] that no output time shortened; reads the device."""
        return self._largest(self.fields.free_dt)

    @property
    def longest_dt(self) -> float:
        """Longest time step [s] so far that no output time shortened; reads the device."""
        return self._largest(self.fields.longest_dt)

    def aim(self, target: float, look: float = math.inf) -> None:
        """Set the time [s] that must be hit next, and that from which on the host looks, which shortens no step."""
        self.fields.target.fill_(target)
        self.fields.look.fill_(look)

    def open_batch(self) -> None:
        """Begin a batch of recorded steps, of which none is taken once the target is reached or a particle is bad."""
        self._launch.once(_make_open(self.space), 1, [self.fields])

    @property
    def taken(self) -> int:
        """Steps taken since the batch was begun; reads the device."""
        return int(self.fields.taken.numpy()[0])

    def ask(self) -> None:
        """Begin to ask for the next step: of the waves by ``rate``, of others by ``frequency`` and ``add``."""
        self.fields.rate.zero_()

    def add(self) -> None:
        """Count the ``frequency`` that one condition asked for."""
        self._launch(_make_add(self.space), len(self.sizes), [self.fields])

    def choose(self) -> None:
        """Δt for the step to come, from what was asked for."""
        option = self.option
        arguments = [self.fields, self.cfl, option.growth, option.fixed or 0.0]
        self._launch(_make_choose(self.space), len(self.sizes), arguments)

    @property
    def bad(self) -> int | None:
        """Place of the first unphysical particle of the only clock, None while all are well; reads the device."""
        first = int(self.fields.bad.numpy()[0])
        return None if first == WELL else first

    def tick(self) -> None:
        """t ← t + Δt, exactly the target when it is reached."""
        self._launch(_make_tick(self.space), len(self.sizes), [self.fields])
