"""Time on the device: the step from the wave speeds, its growth, and output times hit exactly."""

import functools
import math
from dataclasses import dataclass

import warp as wp

from ..execution import Launcher
from ..fields import clock_structure
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
def _make_choose(space: Space) -> wp.Kernel:
    Clock = clock_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def choose(clock: Clock, cfl: wp.float64, growth: wp.float64, fixed: wp.float64):
        dt = fixed
        if fixed == wp.float64(0.0):
            rate = wp.float64(clock.rate[0])
            if clock.added[0] > wp.float64(0.0):
                rate = wp.sqrt(rate * rate + clock.added[0])
            dt = cfl / rate
            if clock.free_dt[0] > wp.float64(0.0):
                dt = wp.min(dt, growth * clock.free_dt[0])
        if clock.bad[0] != WELL:
            dt = wp.float64(0.0)  # the run has failed: time stands still until the host looks
        clock.free_dt[0] = dt
        clock.longest_dt[0] = wp.max(clock.longest_dt[0], dt)
        left = clock.target[0] - clock.t[0]
        if dt >= left * (wp.float64(1.0) - wp.float64(1.0e-10)):
            dt = wp.max(left, wp.float64(0.0))
        elif dt * wp.float64(EVEN) > left and fixed == wp.float64(0.0):
            # Even steps to the target instead of long ones and a short one, which again and again swing modes up
            dt = left / wp.ceil(left / dt * (wp.float64(1.0) - wp.float64(1.0e-10)))
        clock.dt[0] = dt
        clock.added[0] = wp.float64(0.0)  # asked for anew before the next step

    return choose


@functools.cache
def _make_tick(space: Space) -> wp.Kernel:
    Clock = clock_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def tick(clock: Clock):
        if clock.bad[0] == WELL:
            if clock.dt[0] >= clock.target[0] - clock.t[0]:
                clock.t[0] = wp.max(clock.target[0], clock.t[0])
            else:
                clock.t[0] = clock.t[0] + clock.dt[0]
        clock.taken[0] = clock.taken[0] + 1
        if clock.bad[0] != WELL or clock.t[0] >= wp.min(clock.target[0], clock.look[0]):
            clock.running[0] = 0

    return tick


@functools.cache
def _make_add(space: Space) -> wp.Kernel:
    Clock, real = clock_structure(space), space.real

    @wp.kernel(module="unique", enable_backward=False)
    def add(clock: Clock):
        half = wp.float64(0.5) * wp.float64(clock.frequency[0])
        clock.added[0] = clock.added[0] + half * half
        clock.frequency[0] = real(0.0)

    return add


@functools.cache
def _make_open(space: Space) -> wp.Kernel:
    Clock = clock_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def open_batch(clock: Clock):
        clock.taken[0] = 0
        clock.running[0] = int(clock.bad[0] == WELL and clock.t[0] < clock.target[0])

    return open_batch


class DeviceClock:
    """The clock arrays and the launches that move them; a step at the target time has Δt = 0 and changes nothing.

    ``cfl`` is the scheme's own Courant number, for options that leave it open.
    """

    def __init__(self, space: Space, option: TimeStep, cfl: float, device: wp.DeviceLike):
        self.space, self.option, self.device = space, option, device
        self._launch = Launcher(device)
        self.cfl = cfl if option.cfl is None else option.cfl
        self.fields: ClockArrays = clock_structure(space)()
        for name in ("t", "dt", "free_dt", "longest_dt", "target", "look", "added"):
            setattr(self.fields, name, wp.zeros(1, dtype=wp.float64, device=device))
        self.fields.look.fill_(math.inf)
        self.fields.rate, self.fields.frequency = (wp.zeros(1, dtype=space.real, device=device) for _ in range(2))
        self.fields.bad = wp.full(1, WELL, dtype=wp.int32, device=device)
        self.fields.running, self.fields.taken = (wp.zeros(1, dtype=wp.int32, device=device) for _ in range(2))

    def evolving(self) -> dict[str, wp.array]:
        """The clock's arrays by name: what a checkpoint must hold."""
        return {f"Clock.{name}": getattr(self.fields, name) for name in ("t", "dt", "free_dt", "target", "rate", "bad")}

    @property
    def t(self) -> float:
        """Time [s]; reads the device."""
        return float(self.fields.t.numpy()[0])

    @property
    def dt(self) -> float:
        """Last time step [s]; reads the device."""
        return float(self.fields.dt.numpy()[0])

    @property
    def free_dt(self) -> float:
        """Last time step [s] that no output time shortened; reads the device."""
        return float(self.fields.free_dt.numpy()[0])

    @property
    def longest_dt(self) -> float:
        """Longest time step [s] so far that no output time shortened; reads the device."""
        return float(self.fields.longest_dt.numpy()[0])

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
        self._launch.once(_make_add(self.space), 1, [self.fields])

    def choose(self) -> None:
        """Δt for the step to come, from what was asked for."""
        option = self.option
        arguments = [self.fields, self.cfl, option.growth, option.fixed or 0.0]
        self._launch.once(_make_choose(self.space), 1, arguments)

    @property
    def bad(self) -> int | None:
        """Place of the first unphysical particle, None while all are well; reads the device."""
        first = int(self.fields.bad.numpy()[0])
        return None if first == WELL else first

    def tick(self) -> None:
        """t ← t + Δt, exactly the target when it is reached."""
        self._launch.once(_make_tick(self.space), 1, [self.fields])
