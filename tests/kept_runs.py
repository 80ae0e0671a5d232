"""A small run with everything on, for the tests of run directories."""

import json
import os
import random
import signal
import time
from pathlib import Path

import numpy as np
from bodies import lattice

import warp_eulsph as es
from warp_eulsph.cases import read_case
from warp_eulsph.output import BodyProbe, PointProbe, ReactionProbe, Recording, Run, SectionProbe, record
from warp_eulsph.output.checkpoint import decode
from warp_eulsph.output.tables import read_table
from warp_eulsph.schedule import EverySteps, EveryTime

UNTIL = 2e-3


def plate(young=17e6, reference=es.Every(3)):
    """A plate of 36 particles, held at one end and driven at the other; the simulation and both conditions."""
    x = lattice(2, 6)
    rubber = es.NeoHookean(density=1100.0, young=young, poisson=0.45)
    body = es.Body(x=x, volume=1 / 36, material=rubber, velocity=20.0 * np.sin(3.0 * x[:, ::-1]), name="plate")
    held = es.Fixed(lambda X: X[:, 0] < 1 / 6)
    step = es.TimeStep(cfl=0.3)
    return es.Simulation(body, boundaries=[held], reference=reference, arrangement=es.Current(), time_step=step)


def recording(simulation, **changes):
    """Snapshots by time, log and probes by steps."""
    options = {
        "snapshots": EveryTime(4e-4),
        "log": EverySteps(2),
        "probes": [
            PointProbe(name="corner", X=(0.9, 0.9)),
            BodyProbe(name="whole", schedule=EverySteps(3)),
            ReactionProbe(name="hold", boundary=simulation.boundaries[0]),
            SectionProbe(name="middle", point=(0.5, 0.5), normal=(1.0, 0.0), schedule=EveryTime(3e-4)),
        ],
    }
    return Recording(**{**options, **changes})


def run(directory, build=plate, until=UNTIL, **options):
    """Record a fresh simulation: (simulation, outcome)."""
    simulation = build()
    return simulation, record(simulation, directory, until, recording(simulation), **options)


def contents(directory):
    """All that a run leaves that does not depend on the wall clock: bytes of files, rows of tables, and the state."""
    found = {path.name: path.read_bytes() for path in (directory / "snap").glob("*.vtkhdf")}
    for folder in (directory / "probes").glob("*"):
        columns, units = read_table(folder)
        found[folder.name] = {name: column.tobytes() for name, column in columns.items()} | units
    for name in ("manifest.jsonl", "log.jsonl", "run.json"):
        found[name] = (directory / name).read_text()
    last = decode(sorted((directory / "ckpt").glob("*.ckpt"))[-1].read_bytes())
    found["state"] = {name: array.tobytes() for name, array in last.arrays.items()} | last.counters
    found["series"] = json.loads((directory / "run.vtkhdf.series").read_text())
    return found


class StopAfter:
    """Stops a run at given steps, one at each call of ``record``."""

    def __init__(self, *steps):
        self.left, self.simulation = list(steps), None

    def watch(self, simulation):
        self.simulation = simulation

    def reason(self):
        if self.left and self.simulation is not None and self.simulation.steps >= self.left[0]:
            return f"step {self.left.pop(0)}"
        return None


def killed_until_done(begin, kills, rng=None, after=lambda: None):
    """Run ``begin`` in children, the first ``kills`` of them killed at random moments, until one ends; how many were.

    ``after`` is called after each.
    """
    rng, killed = rng or random.Random(2), 0
    while True:
        child = os.fork()
        if child == 0:  # a copy of this process, with its kernels loaded
            try:
                begin()
            except BaseException:
                os._exit(1)
            os._exit(0)
        time.sleep(rng.uniform(0.01, 0.25))
        if killed < kills:
            os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        after()
        if not os.WIFSIGNALED(status):
            assert os.WEXITSTATUS(status) == 0, "the resumed run failed"
            return killed
        killed += 1


def short_run(dim, directory):
    """Three tenths of an example in 1-D, 2-D or 3-D, coarse: a run of four frames."""
    name = {1: "bar", 2: "spinning_plate", 3: "twisting_column"}[dim]
    case = read_case(Path(__file__).parents[1] / "examples" / "cases" / f"{name}.toml", ["parameters.n=6"])
    case = case.model_copy(update={"output": case.output.model_copy(update={"every": 0.1 * case.until})})
    simulation = case.build()
    record(simulation, directory, 0.3 * case.until, case.recording(simulation))
    return Run(directory)
