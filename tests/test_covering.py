"""Frames of the steps that cover their times: no step is shortened, none is missed, and a run can be taken up again."""

import numpy as np
import pytest
from bodies import bits, block
from kept_runs import StopAfter, contents, plate

import warp_eulsph as es
from warp_eulsph.output import BodyProbe, Recording, Run, record
from warp_eulsph.schedule import EverySteps, EveryTime

UNTIL, EVERY, PROBED = 8e-3, 5.3e-4, 7.1e-4  # of steps of 1.8e-4


def covering():
    """Snapshots and a probe at times that no step ends at."""
    probe = BodyProbe(name="whole", schedule=EveryTime(PROBED, exact=False))
    return Recording(snapshots=EveryTime(EVERY, exact=False), probes=[probe], log=EverySteps(10**9))


class Times:
    """Keeps the times of frames."""

    def __init__(self):
        self.times = []

    def write(self, simulation):
        self.times.append(simulation.t)


def ends_of_steps(build):
    """Times of a run without frames at which its steps end, and the run."""
    simulation, times = build(), [0.0]
    while simulation.t < UNTIL:
        simulation.advance(UNTIL, 1)
        times.append(simulation.t)
    return np.array(times), simulation


@pytest.mark.parametrize("graphs", [False, True])
def test_frames_are_of_the_steps_that_reach_their_times(graphs):
    def build():
        simulation = plate()
        simulation.by_graphs = graphs
        return simulation

    ends, alone = ends_of_steps(build)
    first_there = np.searchsorted(ends, EVERY * np.arange(1, UNTIL // EVERY + 1))
    expected = np.unique([0, *first_there, len(ends) - 1])
    frames, simulation = Times(), build()
    simulation.run(UNTIL, every=EVERY, exact=False, output=frames)
    assert frames.times == ends[expected].tolist()
    assert simulation.steps == alone.steps and bits(simulation) == bits(alone)
    exact = build()
    exact.run(UNTIL, every=EVERY, output=Times())
    assert exact.steps > alone.steps  # what hitting the times costs here


def test_a_recorded_run_keeps_what_steps_cover_and_goes_on_as_if_never_stopped(tmp_path):
    ends, alone = ends_of_steps(plate)
    whole = plate()
    record(whole, tmp_path / "whole", UNTIL, covering())
    assert whole.steps == alone.steps and bits(whole) == bits(alone)
    probed = Run(tmp_path / "whole").probes["whole"]["t"]
    reached = ends[np.searchsorted(ends, PROBED * np.arange(1, UNTIL // PROBED + 1))]
    assert np.asarray(probed).tolist() == np.unique([0.0, *reached, ends[-1]]).tolist()
    for step in (5, 11, 12, 13):
        stop, directory = StopAfter(step), tmp_path / f"{step}"
        assert record(plate(), directory, UNTIL, covering(), stop=stop, watch=stop.watch).stopped
        record(plate(), directory, UNTIL, covering(), resume=True)
        assert contents(directory) == contents(tmp_path / "whole")


def test_a_step_that_ends_at_a_time_but_for_round_off_covers_it():
    step = es.TimeStep(fixed=1e-5)  # 1e-4 is ten of them, of another sum in the last digits
    simulation, frames = es.Simulation(block(1, 10), time_step=step), Times()
    simulation.run(1e-3, every=1e-4, exact=False, output=frames)
    assert frames.times == pytest.approx(1e-4 * np.arange(11), rel=1e-12) and simulation.steps == 100
