"""Nothing goes on from the middle of a step: Ctrl-C waits, any other exception breaks the simulation until restore."""

import os
import signal
import threading
import time

import numpy as np
import pytest
from bodies import bits
from hypothesis import given, settings
from hypothesis import strategies as st
from kept_runs import plate, recording

import warp_eulsph as es
from warp_eulsph.output import record, write_snapshot
from warp_eulsph.output.checkpoint import take
from warp_eulsph.scheme.graphs import StepGraphs
from warp_eulsph.whole import BrokenError, Whole


@pytest.fixture(scope="module", autouse=True)
def _listening():
    """To Ctrl-C, which a process that a shell started in the background ignores."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def driven(failing=lambda call: None):
    """A plate under a load that the host gives; ``failing`` is told the number of each call."""
    calls = iter(range(10**9))

    def load(x, t):
        failing(next(calls))
        return 1e5 * np.sin(50.0 * t) + 0.0 * x

    body = plate().bodies[0]
    held = es.Velocity(lambda X: X[:, 0] < 0.2, value=lambda x, t: 0.0 * load(x, t))
    return es.Simulation(body, boundaries=[held, es.BodyForce(load)])


@pytest.fixture(scope="module")
def undisturbed():
    simulation = driven()
    simulation.step(4)
    return bits(simulation)


class OddError(Exception):
    """What a user's function raises."""


@pytest.mark.parametrize("kind", [OddError, KeyboardInterrupt, MemoryError, SystemExit])
@pytest.mark.parametrize("call", range(3, 11))
def test_exceptions_at_every_call_break_it_until_restore(call, kind, undisturbed, tmp_path):
    def failing(number):
        if number == call:
            raise kind("from a load")

    simulation = driven(failing)
    start = take(simulation, {}, {})
    with pytest.raises(kind):
        simulation.step(4)
    steps = simulation.steps
    for again in (
        lambda: simulation.run(until=1.0),
        lambda: simulation.step(),
        lambda: simulation.advance(1.0),
        lambda: take(simulation, {}, {}),
        lambda: write_snapshot(tmp_path / "half.vtkhdf", simulation),
        lambda: record(simulation, tmp_path / "run", 1.0, recording(simulation, probes=[])),
    ):
        with pytest.raises(BrokenError, match=rf"left half done by {kind.__name__}: from a load.*restore\(\)"):
            again()
    assert simulation.steps == steps and not (tmp_path / "run" / "run.json").exists()
    simulation.restore(start.arrays, start.counters)
    simulation.step(4)
    assert bits(simulation) == undisturbed


@settings(max_examples=25, deadline=None)
@given(st.floats(0.0, 1.0))
def test_ctrl_c_at_any_moment_waits_for_the_end_of_the_step(share):
    for graphs in (False, True):
        simulation, whole = plate(), plate()
        simulation.by_graphs = whole.by_graphs = graphs
        simulation.step(3), whole.step(3)
        begin = time.perf_counter()
        whole.step(20)
        timer = threading.Timer(share * (time.perf_counter() - begin), os.kill, (os.getpid(), signal.SIGINT))
        before = signal.getsignal(signal.SIGINT)
        try:
            timer.start()
            simulation.step(20)
            timer.join()
            time.sleep(0.01)
        except KeyboardInterrupt:
            pass
        timer.join()
        assert signal.getsignal(signal.SIGINT) is before
        simulation.step(23 - simulation.steps)
        assert bits(simulation) == bits(whole)


def test_a_second_signal_breaks_in_at_once_and_is_not_forgotten():
    whole = Whole()
    with pytest.raises(KeyboardInterrupt), whole:
        signal.raise_signal(signal.SIGINT)
        reached = True
        signal.raise_signal(signal.SIGINT)
        reached = False
    assert reached and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with pytest.raises(BrokenError, match="by KeyboardInterrupt"):
        whole.check()
    whole.mend()
    whole.check()


def test_a_third_signal_does_not_hide_the_second():
    """It may come before the end of the block is told."""
    whole = Whole()
    whole.__enter__()
    signal.raise_signal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    with pytest.raises(BrokenError, match="by KeyboardInterrupt"):
        whole.check()


def test_a_recording_of_a_graph_is_not_broken_into(monkeypatch):
    """It would go on for ever, in all that is launched; so signals wait for the end of the step here."""
    simulation, expected = plate(), plate()
    simulation.by_graphs = expected.by_graphs = True
    record, recorded = StepGraphs._record, []

    def signalled(self, due):
        for _ in range(3):
            signal.raise_signal(signal.SIGINT)
        record(self, due)
        recorded.append(due)

    simulation.step(3)  # one of each kind by the host
    monkeypatch.setattr(StepGraphs, "_record", signalled)
    with pytest.raises(KeyboardInterrupt):
        simulation.step(9)
    monkeypatch.undo()
    assert recorded and simulation.whole.broken is None and not simulation.device.is_capturing
    simulation.step(12 - simulation.steps)
    expected.step(12)
    assert bits(simulation) == bits(expected)


def test_signals_of_others_are_left_alone():
    seen = []
    for handler in (signal.SIG_IGN, lambda number, frame: seen.append(number)):
        whole = Whole()
        before = signal.signal(signal.SIGINT, handler)
        try:
            with whole:
                signal.raise_signal(signal.SIGINT)
                assert not seen
            with whole:
                signal.raise_signal(signal.SIGINT), signal.raise_signal(signal.SIGINT)
            assert signal.getsignal(signal.SIGINT) is handler and whole.broken is None
            assert len(seen) == 3 * callable(handler)
        finally:
            signal.signal(signal.SIGINT, before)


def test_steps_in_other_threads_touch_no_signals():
    simulation, before = plate(), signal.getsignal(signal.SIGINT)
    thread = threading.Thread(target=simulation.step)
    thread.start()
    thread.join()
    assert simulation.steps == 1 and signal.getsignal(signal.SIGINT) is before


def test_holding_signals_costs_next_to_nothing():
    whole, begin = Whole(), time.thread_time()
    for _ in range(1000):
        with whole:
            pass
    assert (time.thread_time() - begin) / 1000 < 50e-6  # s of its own, whatever else runs; a step takes a millisecond
