"""Attacks on runs: exceptions and interrupts in steps, damaged folders, loads changed before a resume."""

import contextlib
import os
import shutil
import signal
import threading
import time

import numpy as np
from bodies import bits
from faults import HELD, REFUSED, LostError, SilentError, right
from kept_runs import plate
from test_damage import CASE, commands, files, mutated

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.cli import main as command_line
from warp_eulsph.output import ChangedCaseError, Recording, record
from warp_eulsph.output.checkpoint import take
from warp_eulsph.whole import BrokenError


class OddError(Exception):
    """What a user's function raises."""


def exception_in_a_step(rng, folder):
    """Any exception at any launch of a kernel: refused until restored, then the same bits."""
    simulation, whole = plate(), plate()
    for each in (simulation, whole):
        each.by_graphs = False
        each.step(2)
    start = take(simulation, {}, {})
    kind = rng.choice([OddError, KeyboardInterrupt, MemoryError, RuntimeError, SystemExit])
    left, launch = [rng.randrange(120)], execution.Launcher.__call__

    def failing(self, *arguments, **options):
        left[0] -= 1
        if left[0] == 0:
            raise kind("attack")
        return launch(self, *arguments, **options)

    execution.Launcher.__call__ = failing
    try:
        simulation.step(4)
    except kind:
        for again in (simulation.step, lambda: simulation.run(until=1.0), lambda: take(simulation, {}, {})):
            try:
                again()
                raise SilentError(f"went on after {kind.__name__} at launch {left}")
            except BrokenError:
                pass
        execution.Launcher.__call__ = launch
        simulation.restore(start.arrays, start.counters)
        simulation.step(4)
    finally:
        execution.Launcher.__call__ = launch
    whole.step(4)
    right(bits(simulation) == bits(whole), f"{kind.__name__} changed bits")
    return HELD


def interrupt(rng, folder):
    """Ctrl-C at any moment waits for the end of the step."""
    simulation, whole = plate(), plate()
    simulation.by_graphs = whole.by_graphs = rng.random() < 0.5
    simulation.step(3), whole.step(3)
    begin = time.perf_counter()
    whole.step(20)
    timer = threading.Timer(rng.random() * (time.perf_counter() - begin), os.kill, (os.getpid(), signal.SIGINT))
    with contextlib.suppress(KeyboardInterrupt):
        timer.start()
        simulation.step(20)
        timer.join()
        time.sleep(0.005)
    timer.join()
    simulation.step(23 - simulation.steps)
    right(bits(simulation) == bits(whole), "an interrupt changed bits")
    return HELD


def run_folder(rng, folder):
    """A recorded run damaged in JSON, HDF5 and names: every command says so, and what is whole is kept."""
    original = folder / "original"
    if not original.exists():
        (folder / "plate.toml").write_text(CASE)
        right(command_line(["run", str(folder / "plate.toml"), "-o", str(original)]) == 0, "the case does not run")
    whole = {path.read_bytes() for path in files(original) if path.suffix in (".vtkhdf", ".h5")}
    derived = {path.read_bytes() for path in original.glob("run.vtkhdf")}  # made anew at will
    directory = shutil.copytree(original, folder / "mutated")
    try:
        done = mutated(directory, rng.randrange(10**9))
        kept = {path.read_bytes() for path in files(directory)} & whole
        for arguments, status in commands(directory, folder):
            if status not in (0, 2, 3):
                raise RuntimeError(f"{done}: {arguments[0]} ended with {status}")
        left = {path.read_bytes() for path in files(directory)}
        if (kept - left) - derived:
            raise LostError(done)
    finally:
        shutil.rmtree(directory)
    return HELD


class Pusher:
    """A load with a state, whose method is given."""

    def __init__(self, strength):
        self.strength = strength

    def push(self, x, t):
        return self.strength + 0.0 * x


def load_of(kind, strength):
    """A function of place and time that depends on ``strength`` in some way."""

    def plain(x, t):
        return strength + 0.0 * x

    def nested(x, t):
        def inner():
            return plain(x, t)

        return inner()

    def keyword(x, t, *, strength=strength):
        return strength + 0.0 * x

    table = {"strength": [strength]}
    return {
        "closure": plain,
        "enclosed twice": nested,
        "default": lambda x, t, s=strength: s + 0.0 * x,
        "keyword default": keyword,
        "bound method": Pusher(strength).push,
        "array": (lambda rows: lambda x, t: rows + 0.0 * x)(np.array([strength, 0.0])),
        "table": lambda x, t: table["strength"][0] + 0.0 * x,
        "object": (lambda pusher: lambda x, t: pusher.push(x, t))(Pusher(strength)),
        "list of functions": (lambda some: lambda x, t: some[0](x, t))([plain]),
        "constant": np.array([strength, 0.0]),
    }[kind]


LOADS = (
    *("closure", "enclosed twice", "default", "keyword default", "bound method", "array", "table", "object"),
    *("list of functions", "constant"),
)


def changed_load(rng, folder):
    """A load that is another than that of the checkpoint is seen; the same one is not refused."""
    kind, strength = rng.choice(LOADS), rng.choice([1e3, -2.5, 1e6])
    same = rng.random() < 0.3
    later = strength if same else strength * (1.0 + rng.choice([1e-15, 1e-3, 1.0]) * rng.choice([1, -1]))
    same = later == strength

    def build(of):
        body = plate().bodies[0]
        return es.Simulation(body, boundaries=[es.BodyForce(load_of(kind, of))], reference=es.Never())

    directory = folder / "load"
    try:
        record(build(strength), directory, 1e-4, Recording())
        try:
            record(build(later), directory, 2e-4, Recording(), resume=True)
        except ChangedCaseError:
            right(not same, f"{kind}: the same load is refused")
            return REFUSED
        right(same, f"{kind}: {strength} became {later} unseen")
        return HELD
    finally:
        shutil.rmtree(directory, ignore_errors=True)
