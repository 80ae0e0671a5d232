"""Simulations in several threads and processes, and steps on a tape: as alone, or refused."""

import os
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest
import warp as wp
from bodies import block

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.turns import Turn

SIDE = 12
# What a fresh process does: threads that compile, build and record at once
TOGETHER = """
import sys, threading
sys.path.insert(0, {tests!r})
from test_turns import busy
from warp_eulsph import execution
execution.set_graphs({graphs})
found = {{}}
threads = [threading.Thread(target=lambda k=k: found.update({{k: busy(k)}})) for k in range(3)]
[thread.start() for thread in threads]
[thread.join(120) for thread in threads]
assert [found.get(k) == busy(k) for k in range(3)] == [True] * 3
"""


def moving(seed):
    velocity = 5.0 * np.random.default_rng(seed).normal(size=(SIDE**2, 2))
    body = block(2, SIDE, jitter=0.2, seed=seed, velocity=velocity)
    return es.Simulation(body, reference=es.Every(3), arrangement=es.Current())


def busy(seed):
    """All bits of a few simulations, built, stepped and looked at."""
    found = []
    for _ in range(3):
        simulation = moving(seed)
        for _ in range(5):
            simulation.step(6)
            found += [simulation.x.tobytes(), *simulation.energy().values(), *simulation.extrema().values()]
    return found


@pytest.mark.of_the_cpu
@pytest.mark.parametrize("graphs", [False, True])
def test_simulations_in_threads_of_a_fresh_process_are_as_alone(graphs):
    code = TOGETHER.format(tests=os.path.dirname(__file__), graphs=graphs)
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert ran.returncode == 0, ran.stderr


def test_who_steps_on_and_on_lets_others_in():
    """Another thread's short step ends long before a long run of small ones does."""
    long, short, seen = moving(0), moving(1), []
    short.step(), long.step()
    other = threading.Thread(target=lambda: (short.step(), seen.append(long.steps)))
    other.start()
    for _ in range(2000):
        long.step()
        if seen:
            break
    other.join()
    assert seen[0] < 2000


def test_a_turn_may_be_taken_again_by_who_has_it():
    turn, order = Turn(), []
    with turn.lock:
        turn.call(order.append, "inner")
        other = threading.Thread(target=turn.call, args=(order.append, "other"))
        other.start()
        other.join(0.05)
        order.append("outer")
    other.join()
    assert order == ["inner", "outer", "other"]


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no such clock")
def test_ctrl_c_at_any_moment_leaves_the_turn_to_others():
    """Signals by a clock, whose handler breaks in as that of Ctrl-C does."""
    turn, hits, armed = Turn(), 0, False

    def break_in(number, frame):
        nonlocal armed
        if armed:
            armed = False
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, break_in)
    try:
        signal.setitimer(signal.ITIMER_REAL, 1e-4, 5e-5)
        while hits < 3000:
            try:
                armed = True
                turn.call(len, "")
                armed = False
            except KeyboardInterrupt:
                hits += 1
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    got: list[bool] = []
    other = threading.Thread(target=lambda: got.append(turn.lock.acquire(timeout=1.0)))
    other.start()
    other.join()
    assert got == [True]


@pytest.mark.of_the_cpu
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.parametrize("graphs", [False, True])
def test_simulations_go_on_in_a_forked_process(graphs, monkeypatch):
    """With a pool of threads in use before, which the child does not have; a child that hangs is killed."""
    monkeypatch.setattr(execution, "LEAST_RANGE", 16)
    execution.set_threads(2)
    execution.set_graphs(graphs)
    simulation, expected = moving(0), moving(0)
    for each in (simulation, expected):
        each.step(4)
    expected.step(4)
    held = threading.Event()
    waiting = threading.Thread(target=held.wait)  # another thread is there
    waiting.start()
    child = os.fork()
    if child == 0:
        signal.alarm(60)
        simulation.step(4)
        os._exit(0 if np.array_equal(simulation.x, expected.x) else 3)
    _, status = os.waitpid(child, 0)
    held.set()
    waiting.join()
    assert os.waitstatus_to_exitcode(status) == 0
    simulation.step(4)
    assert np.array_equal(simulation.x, expected.x)


@pytest.mark.parametrize("graphs", [False, True])
def test_a_step_on_a_tape_is_refused_and_breaks_nothing(graphs):
    execution.set_graphs(graphs)
    simulation, expected = moving(0), moving(0)
    simulation.step(3)
    with pytest.raises(RuntimeError, match="a step must not be taken within a tape"), wp.Tape():
        simulation.step()
    simulation.step(2)
    expected.step(5)
    assert np.array_equal(simulation.x, expected.x)
