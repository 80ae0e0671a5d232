"""What a simulation is told by: a load that changed is seen, wherever it keeps what it needs."""

import functools
import json
import logging
import threading

import pytest
from kept_runs import plate

import warp_eulsph as es
from warp_eulsph.output.description import describe, differences


class Machine:
    """A load that is a method of an object with a setting."""

    def __init__(self, force):
        self.force = force

    def load(self, x, t):
        return self.force + 0.0 * x


SETTING = 1.0


def reads_its_module(x, t):
    return SETTING + 0.0 * x


def defaults(force):
    return lambda x, t, force=force: force + 0.0 * x


def keywords(force):
    def load(x, t, *, force=force):
        return force + 0.0 * x

    return load


def enclosed_twice(force):
    def inner(t):
        return force

    def outer(t):
        return inner(t)

    return lambda x, t: outer(t) + 0.0 * x


def callable_of_another(force):
    machine = Machine(force)
    return lambda x, t: machine.load(x, t)


def two_on_a_line(force):
    return (lambda x, t: 1.0 + 0.0 * x, lambda x, t: 2.0 + 0.0 * x)[int(force) - 1]


@pytest.mark.parametrize(
    "load",
    [
        defaults,
        keywords,
        enclosed_twice,
        callable_of_another,
        two_on_a_line,
        lambda force: Machine(force).load,
        lambda force: functools.partial(Machine(force).load),
    ],
)
def test_a_changed_load_is_seen_wherever_it_is_kept(load):
    def described(force):
        return describe(es.Simulation(plate().bodies[0], boundaries=[es.BodyForce(load(force))]))

    assert not differences(described(1.0), described(1.0))
    assert differences(described(1.0), described(2.0))


def test_what_a_function_reads_of_its_module_is_part_of_the_case(monkeypatch):
    simulation = es.Simulation(plate().bodies[0], boundaries=[es.BodyForce(reads_its_module)])
    before = describe(simulation)
    assert not differences(before, describe(simulation))
    monkeypatch.setitem(globals(), "SETTING", 2.0)
    assert differences(before, describe(simulation)) == ["boundaries.0.value.reads.SETTING: 1.0, now 2.0"]


class Tangled:
    """A load beside much that is none of its business, itself among it."""

    def __init__(self, force):
        self.force, self.missing, self.me = force, float("nan"), self
        self.simulation, self.log, self.lock = plate(), logging.getLogger("tangled"), threading.Lock()

    def load(self, x, t):
        return self.force + 0.0 * x


def test_what_is_described_is_the_same_each_time():
    one, same, other = (describe_load(Tangled(force).load) for force in (1.0, 1.0, 2.0))
    assert not differences(one, same) and not differences(one, json.loads(json.dumps(same)))
    assert differences(one, other) == ["boundaries.0.value.of.force: 1.0, now 2.0"]


def describe_load(load):
    return describe(es.Simulation(plate().bodies[0], boundaries=[es.BodyForce(load)]))


def test_functions_that_enclose_each_other_have_an_end():
    def even(n):
        return n == 0 or odd(n - 1)

    def odd(n):
        return n > 0 and even(n - 1)

    body = plate().bodies[0]
    simulation = es.Simulation(body, boundaries=[es.BodyForce(lambda x, t: float(even(2)) + 0.0 * x)])
    assert json.dumps(describe(simulation))
