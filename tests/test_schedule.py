"""Schedules: what is due when, and times that are hit exactly."""

import itertools
import math

import pytest

from warp_eulsph.schedule import AnyOf, AtTimes, EverySteps, EveryTime, next_target, targets


def test_every_time_counts_from_its_start_without_drift():
    every = EveryTime(0.1)
    assert list(targets(every, 0.0, 1.0)) == [0.1 * k for k in range(1, 10)] + [1.0]
    assert EveryTime(0.25, 0.5).next_time(0.0) == 0.5
    assert every.due(0.1 * 3, 7) and every.due(0.3, 7) and not every.due(0.31, 7)
    assert every.next_time(0.3) == pytest.approx(0.4)  # although 3 · 0.1 is another double than 0.3
    assert every.steps_left(5) is None


def test_many_intervals_end_where_they_should():
    times = list(targets(EveryTime(1e-3), 0.0, 1.0))
    assert len(times) == 1000 and times[-1] == 1.0 and times[499] == 0.5


def test_every_steps():
    every = EverySteps(4)
    assert [step for step in range(9) if every.due(0.0, step)] == [0, 4, 8]
    assert [every.steps_left(step) for step in (0, 1, 3, 4)] == [4, 3, 1, 4]
    assert every.next_time(0.0) == math.inf


def test_at_times():
    at = AtTimes([0.2, 0.7])
    assert list(targets(at, 0.0, 1.0)) == [0.2, 0.7, 1.0] and list(targets(at, 0.5, 0.7)) == [0.7]
    assert at.due(0.2, 3) and not at.due(0.3, 3)
    assert list(targets(AtTimes(), 0.0, 1.0)) == [1.0]


def test_any_of_several():
    both = AnyOf([EveryTime(0.3), EverySteps(5), AtTimes([0.4])])
    assert both.next_time(0.0) == 0.3 and both.next_time(0.3) == 0.4
    assert both.due(0.4, 1) and both.due(0.1, 5) and not both.due(0.1, 4)
    assert both.steps_left(3) == 2 and AnyOf([AtTimes()]).steps_left(3) is None


def test_times_that_differ_by_round_off_are_one():
    """4 · 0.3 ms, 3 · 0.4 ms and 1.2 ms are two doubles: no step lies between them, and all are due."""
    assert 4 * 3e-4 != 3 * 4e-4
    for other in (EveryTime(4e-4), AtTimes([4e-4, 3 * 4e-4])):
        times = list(targets(AnyOf([EveryTime(3e-4), other]), 0.0, 1.3e-3))
        assert len(times) == (7 if isinstance(other, EveryTime) else 6)
        assert min(b - a for a, b in itertools.pairwise(times)) > 1e-5
        assert other.due(4 * 3e-4, 1)


def test_times_that_steps_cover():
    """Each time falls to one step, the first that reaches it or ends a hair before; none is aimed at."""
    for covering in (EveryTime(0.1, exact=False), AtTimes([0.1, 0.2, 0.3], exact=False)):
        assert covering.next_time(0.0) == math.inf and not covering.due(0.1, 1)
        assert list(targets(covering, 0.0, 0.35)) == [0.35]
        ends = [0.0, 0.04, 0.1 - 1e-17, 0.11, 0.2 - 1e-12, 0.29, 0.33]
        assert [b for a, b in itertools.pairwise(ends) if covering.covered(a, b)] == [ends[2], ends[4], ends[6]]
        assert all(covering.next_look(t) > t for t in ends[:-1])
        assert covering.covered(0.05, 0.25)
    both = AnyOf([EveryTime(0.1, exact=False), EveryTime(0.4), EverySteps(7)])
    assert both.next_time(0.0) == 0.4 and both.next_look(0.15) == pytest.approx(0.2)
    assert both.covered(0.15, 0.21) and not both.covered(0.12, 0.18)
    assert not EveryTime(0.1).covered(0.05, 0.15)


def test_the_end_swallows_a_target_a_hair_before_it():
    assert next_target(EveryTime(0.1), 0.25, 0.30000000000000010) == 0.30000000000000010
    assert next_target(EveryTime(0.1), 0.15, 0.3) == 0.2
