"""When a run does something: every so much time, every so many steps, at given times. Schedules keep no state."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from numbers import Integral, Real

from .checks import objects, real_array

# Times closer than this share of an interval, or of themselves, are one: a step between them would be round-off.
SAME = 1e-9
# Times of one schedule in a run; a step a microsecond for a quarter of an hour. More were meant otherwise.
MOST_TIMES = 1e9


class Schedule(ABC):
    """When something is due, told from time and step alone, so that a resumed run goes on as if never stopped."""

    @abstractmethod
    def due(self, t: float, step: int) -> bool:
        """Whether it is due at time ``t`` [s] after ``step`` steps."""

    def next_time(self, t: float) -> float:
        """The first time [s] after ``t`` that the run must hit exactly; inf if there is none."""
        return math.inf

    def next_look(self, t: float) -> float:
        """The time [s] after ``t`` at which steps are looked at next, of lengths as they are; inf if there is none."""
        return math.inf

    def covered(self, before: float, t: float) -> bool:
        """Whether steps from the time ``before`` to ``t`` [s] reached one that need not be hit exactly."""
        return self.next_look(before) < self.next_look(t)

    def steps_left(self, step: int) -> int | None:
        """Steps from ``step`` to the next one that is due; None if steps do not count."""
        return None

    def check(self, t: float, until: float) -> None:  # noqa: B027 - most have nothing to refuse
        """ValueError if a run from ``t`` to ``until`` [s] would not end in anybody's time."""


@dataclass(frozen=True)
class EveryTime(Schedule):
    """At start + k · interval, hit exactly or by the step that covers it.

    Args:
        interval: [s].
        start: [s].
        exact: steps before a time are shortened to end in it; if not, the first step that reaches it is taken as it is.
    """

    interval: float
    start: float = 0.0
    exact: bool = True

    def __post_init__(self) -> None:
        for name in ("interval", "start"):
            given = getattr(self, name)
            if isinstance(given, bool) or not isinstance(given, Real):
                raise ValueError(f"{name} must be a time [s], got {given!r}")
        if not (math.isfinite(self.interval) and self.interval > 0.0):
            raise ValueError(f"interval must be a positive time [s], got {self.interval}")
        if not math.isfinite(self.start):
            raise ValueError(f"start must be a finite time [s], got {self.start}")

    def due(self, t: float, step: int) -> bool:
        k = (t - self.start) / self.interval
        return self.exact and math.isfinite(k) and abs(t - self._time(round(k))) <= SAME * self.interval

    def next_time(self, t: float) -> float:
        return self._next(t) if self.exact else math.inf

    def next_look(self, t: float) -> float:
        return math.inf if self.exact else _just_before(self._next(t), SAME * self.interval, t)

    def _next(self, t: float) -> float:
        """The first time [s] after ``t``."""
        k = (t - self.start) / self.interval
        first = max(math.floor(k), 0) if math.isfinite(k) else 0
        for ahead in range(first, first + 4):
            if self._time(ahead) > t + SAME * self.interval and self._time(ahead) > t:
                return self._time(ahead)
        raise ValueError(f"interval must be long enough to be told apart at t = {t} s, got {self.interval} s")

    def check(self, t: float, until: float) -> None:
        if (until - t) / self.interval > MOST_TIMES:
            raise ValueError(
                f"interval must be at least 1/{MOST_TIMES:.0e} of the time from {t} to {until} s, got {self.interval} s"
            )

    def _time(self, k: int) -> float:
        return self.start + self.interval * k


@dataclass(frozen=True)
class EverySteps(Schedule):
    """After every ``count`` steps, and at the start."""

    count: int

    def __post_init__(self) -> None:
        if isinstance(self.count, bool) or not isinstance(self.count, Integral) or self.count < 1:
            raise ValueError(f"count of steps must be at least 1, got {self.count!r}; a whole number")

    def due(self, t: float, step: int) -> bool:
        return step % self.count == 0

    def steps_left(self, step: int) -> int | None:
        return self.count - step % self.count


@dataclass(frozen=True)
class AtTimes(Schedule):
    """At given times [s], hit exactly or by the steps that cover them; none by default.

    Args:
        times: [s], increasing.
        exact: steps before a time are shortened to end in it; if not, the first step that reaches it is taken as it is.
    """

    times: Sequence[float] = ()
    exact: bool = True

    def __post_init__(self) -> None:
        given = real_array(list(self.times) if isinstance(self.times, Iterable) else self.times, "times")
        times = tuple(given.tolist()) if given.ndim == 1 else ()
        if given.ndim != 1 or list(times) != sorted(set(times)):
            raise ValueError(f"times must be finite and increase [s], got {given.tolist()}")
        object.__setattr__(self, "times", times)

    def due(self, t: float, step: int) -> bool:
        return self.exact and any(abs(t - time) <= SAME * abs(time) for time in self.times)

    def next_time(self, t: float) -> float:
        return self._next(t) if self.exact else math.inf

    def next_look(self, t: float) -> float:
        time = math.inf if self.exact else self._next(t)
        return time if time == math.inf else _just_before(time, SAME * abs(time), t)

    def _next(self, t: float) -> float:
        """The first time [s] after ``t``."""
        return next((time for time in self.times if time - t > SAME * abs(time)), math.inf)


@dataclass(frozen=True)
class AnyOf(Schedule):
    """When any of several schedules says so."""

    schedules: Sequence[Schedule]

    def __post_init__(self) -> None:
        object.__setattr__(self, "schedules", tuple(objects(self.schedules, Schedule, "schedules", "EveryTime(1e-3)")))

    def due(self, t: float, step: int) -> bool:
        return any(schedule.due(t, step) for schedule in self.schedules)

    def next_time(self, t: float) -> float:
        return min((schedule.next_time(t) for schedule in self.schedules), default=math.inf)

    def next_look(self, t: float) -> float:
        return min((schedule.next_look(t) for schedule in self.schedules), default=math.inf)

    def covered(self, before: float, t: float) -> bool:
        return any(schedule.covered(before, t) for schedule in self.schedules)

    def steps_left(self, step: int) -> int | None:
        left = [steps for schedule in self.schedules if (steps := schedule.steps_left(step)) is not None]
        return min(left, default=None)

    def check(self, t: float, until: float) -> None:
        for schedule in self.schedules:
            schedule.check(t, until)


def _just_before(time: float, hair: float, t: float) -> float:
    """``time`` less ``hair``, by which it may be missed in round-off, and after ``t`` [s]."""
    return max(time - hair, math.nextafter(t, math.inf))


def next_target(schedule: Schedule, t: float, until: float) -> float:
    """The next time [s] to hit exactly, at most ``until``, which swallows a target a hair before it."""
    target = schedule.next_time(t)
    return target if target < until - SAME * (until - t) else until


def targets(schedule: Schedule, t: float, until: float) -> Iterator[float]:
    """The times [s] after ``t`` that ``schedule`` has up to ``until``, which is the last."""
    schedule.check(t, until)
    while t < until:
        t = next_target(schedule, t, until)
        yield t
