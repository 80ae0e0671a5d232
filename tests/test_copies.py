"""Copies of arrays for the writer: made at once on the CPU, behind the steps on a GPU.

What a GPU does is stood in for: copies that arrive when they are waited for, into memory that is used again.
"""

import threading

import numpy as np
import pytest
import warp as wp
from kept_runs import contents, plate, run

import warp_eulsph as es
from warp_eulsph.output import Recording, copies, read_snapshot, record, series
from warp_eulsph.schedule import EverySteps

made = []


class LateCopies(copies.Copies):
    """Copies of which nothing is there before it is waited for, nor after it is released."""

    def __init__(self, device):
        super().__init__(device)
        self.taken, self.arrived, self.released = 0, [], 0
        made.append(self)

    def take(self, array, chosen=None):
        if isinstance(array, np.ndarray):
            return super().take(array, chosen)
        present, values = np.array(array.numpy()), np.full_like(array.numpy(), -1)
        self.taken += 1

        def arrive():
            self.arrived.append(threading.current_thread())
            values[:] = present

        def give_back():
            self.released += 1
            values.fill(-2)

        return copies.Copy(values, chosen, arrive, give_back=give_back)


@pytest.fixture
def late(monkeypatch):
    """Runs take late copies; their makers."""
    made.clear()
    monkeypatch.setattr(series, "Copies", LateCopies)
    monkeypatch.setattr(wp, "synchronize_event", lambda arrive: arrive())
    return made


@pytest.mark.of_the_cpu
def test_a_copy_on_the_cpu_is_there_at_once_and_stays():
    array = wp.array([1.0, 2.0], dtype=wp.float64)
    copy = copies.Copies(array.device).take(array)
    array.fill_(3.0)
    assert not copy.on_its_way and copy.values.tolist() == [1.0, 2.0]


def test_values_cannot_be_had_before_they_arrive():
    copy = copies.Copy(np.zeros(1), arrived=object())
    assert copy.on_its_way
    with pytest.raises(RuntimeError, match="before they arrived"):
        _ = copy.values


def test_late_copies_leave_the_same_run(tmp_path, late):
    run(tmp_path / "late")
    (maker,) = late
    assert maker.taken == len(maker.arrived) == maker.released > 0
    assert set(maker.arrived) == {threading.main_thread()}  # nobody else talks to the device
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(series, "Copies", copies.Copies)
        run(tmp_path / "plain")
    assert contents(tmp_path / "late") == contents(tmp_path / "plain")


def test_steps_are_taken_before_a_late_copy_is_waited_for(tmp_path, late):
    simulation, pending = plate(), []

    def watch(simulation):
        pending.append(late[0].taken - len(late[0].arrived))

    record(simulation, tmp_path, 1e-3, Recording(snapshots=EverySteps(2)), watch=watch)
    each = late[0].taken // (len(list((tmp_path / "snap").glob("*.vtkhdf"))))
    assert pending[:4] == [0, each, 0, each]  # of step 2, until step 3 is done


def test_the_last_good_snapshot_is_written_though_it_was_on_its_way(tmp_path, late):
    simulation = plate()

    def turn_inside_out(simulation):
        if simulation.steps == 5:
            simulation.stepper.U.F.assign(np.diag([-1.0, 1.0]) @ simulation.F)

    with pytest.raises(es.UnstableError, match=r"the last good snapshot is .*0000000005\.vtkhdf"):
        record(simulation, tmp_path, 0.1, Recording(snapshots=EverySteps(1)), watch=turn_inside_out)
    last = sorted((tmp_path / "snap").glob("*.vtkhdf"))[-1]
    assert int(last.stem) == 5 and np.isfinite(read_snapshot(last).x).all()


@pytest.mark.skipif(not wp.is_cuda_available(), reason="needs a GPU")
def test_copies_of_a_gpu_are_those_of_the_moment():
    maker = copies.Copies("cuda:0")
    array = wp.array(np.arange(1_000_000.0), dtype=wp.float64, device="cuda:0")
    for round_ in range(3):  # the later ones in memory used before
        copy = maker.take(array)
        array.fill_(float(round_))
        assert copy.on_its_way
        copy.wait()
        expected = np.arange(1_000_000.0) if round_ == 0 else np.full(1_000_000, round_ - 1.0)
        assert np.array_equal(copy.values, expected)
        copy.release()
