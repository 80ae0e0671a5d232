"""A run that is kept: what lies in its directory, and that stopping and resuming leaves no trace in it."""

import json
import logging
import os
import signal
import time

import numpy as np
import pytest
from kept_runs import UNTIL, StopAfter, contents, plate, recording, run

import warp_eulsph as es
from warp_eulsph.output import (
    BusyError,
    ChangedCaseError,
    DamagedError,
    PointProbe,
    Recording,
    Run,
    RunDirectory,
    Stop,
    read_snapshot,
    record,
)
from warp_eulsph.output.atomic import temporary_beside
from warp_eulsph.schedule import AtTimes, EverySteps, EveryTime


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A run without interruption: (directory, simulation)."""
    directory = tmp_path_factory.mktemp("whole")
    simulation, outcome = run(directory)
    assert outcome.stopped is None and outcome.time == UNTIL
    return directory, simulation


def test_directory_holds_what_was_asked_for(whole):
    directory, simulation = whole
    entries = [json.loads(line) for line in (directory / "manifest.jsonl").read_text().splitlines()]
    times = [float.fromhex(entry["time"]) for entry in entries]
    # 1.2 ms is due for a probe too, whose multiple of 0.3 ms is another double: one step ends there, not two.
    assert times == [0.0, 4e-4, 8e-4, 3e-4 * 4, 1.6e-3, 2e-3]
    for entry in entries:
        snapshot = read_snapshot(directory / entry["name"])
        assert (snapshot.time, snapshot.step, len(snapshot.x)) == (float.fromhex(entry["time"]), entry["step"], 36)
    log = [json.loads(line) for line in (directory / "log.jsonl").read_text().splitlines()]
    steps = [line["step"] for line in log]
    assert steps == sorted({*range(0, simulation.steps + 1, 2), simulation.steps})
    assert log[-1]["total"] == simulation.energy()["total"] and log[-1]["t"] == UNTIL
    assert json.loads((directory / "status.json").read_text())["state"] == "done"
    session = json.loads((directory / "env.json").read_text())["sessions"][0]
    assert session["versions"]["numpy"] == np.__version__ and session["dtype"] == "float64"
    described = json.loads((directory / "run.json").read_text())
    assert described["until"] == UNTIL
    assert described["simulation"]["bodies"]["plate"]["material"]["young"] == 17e6
    assert described["recording"]["snapshots"] == {"type": "EveryTime", "interval": 4e-4, "start": 0.0, "exact": True}
    assert not list(directory.rglob("*.tmp"))


@pytest.mark.parametrize("split", [(0,), (1,), (7,), (3, 4, 11), tuple(range(1, 12))], ids=str)
def test_stopping_and_resuming_leaves_no_trace(whole, tmp_path, split):
    stop = StopAfter(*split)
    _, outcome = run(tmp_path, stop=stop, watch=stop.watch)
    count = 0
    while outcome.stopped is not None:
        count += 1
        assert json.loads((tmp_path / "status.json").read_text())["state"] == "stopped"
        _, outcome = run(tmp_path, resume=True, stop=stop, watch=stop.watch)
    assert count == len(split)
    assert contents(tmp_path) == contents(whole[0])


def test_resume_of_a_finished_run_changes_nothing_and_goes_on_to_a_later_end(tmp_path):
    run(tmp_path, until=1e-3)
    before = contents(tmp_path)
    run(tmp_path, until=1e-3, resume=True)
    assert contents(tmp_path) == before
    simulation, outcome = run(tmp_path, until=1.5e-3, resume=True)
    assert outcome.time == 1.5e-3 and simulation.t == 1.5e-3
    with pytest.raises(ValueError, match=r"until must be finite and not before the present time 0\.0015 s"):
        run(tmp_path, until=1e-3, resume=True)


def test_a_run_that_is_there_is_not_lost(tmp_path):
    run(tmp_path, until=1e-3)
    with pytest.raises(FileExistsError, match="holds a run; resume it"):
        run(tmp_path, until=1e-3)
    before = (tmp_path / "snap" / "0000000000.vtkhdf").read_bytes()
    run(tmp_path, build=lambda: plate(young=1e6), until=1e-3, replace=True)
    assert (tmp_path / "abandoned" / "0001" / "snap" / "0000000000.vtkhdf").read_bytes() == before
    assert (tmp_path / "abandoned" / "0001" / "run.json").exists()


def test_two_runs_into_one_directory_are_refused(tmp_path):
    def second(simulation):
        with pytest.raises(BusyError, match="another run writes into"):
            run(tmp_path, replace=True)

    _, outcome = run(tmp_path, until=1e-4, watch=second)
    assert outcome.stopped is None


def test_changed_case_is_refused_unless_forced(tmp_path, caplog):
    stop = StopAfter(5)
    run(tmp_path, stop=stop, watch=stop.watch)
    before = contents(tmp_path)
    message = r"step 5:\n  simulation.bodies.plate.material.young: 17000000.0, now 18000000.0\nundo"
    with pytest.raises(ChangedCaseError, match=message):
        run(tmp_path, build=lambda: plate(young=18e6), resume=True)
    with pytest.raises(ChangedCaseError, match=r"simulation\.reference\.steps: 3, now 4"):
        run(tmp_path, build=lambda: plate(reference=es.Every(4)), resume=True)
    simulation = plate()
    with pytest.raises(ChangedCaseError, match=r"recording.fields: .*, now \['J'\]"):
        record(simulation, tmp_path, UNTIL, recording(simulation, fields=["J"]), resume=True)
    assert contents(tmp_path) == before
    with caplog.at_level(logging.WARNING):
        _, outcome = run(tmp_path, build=lambda: plate(young=18e6), resume=True, force=True)
    assert "resuming a changed case: simulation.bodies.plate.material.young" in caplog.text
    assert outcome.time == UNTIL


def test_functions_and_what_they_enclose_are_part_of_the_case():
    def pushed(speed):
        x = plate().bodies[0].x
        body = es.Body(x=x, volume=1 / 36, material=plate().bodies[0].material)
        condition = es.Velocity(lambda X: X[:, 0] < 0.2, value=lambda x, t: speed * np.sin(t) + 0.0 * x)
        return es.Simulation(body, boundaries=[condition])

    def nested(power):
        def profile(x):
            return x**power

        body = es.Body(x=plate().bodies[0].x, volume=1 / 36, material=plate().bodies[0].material)
        return es.Simulation(body, boundaries=[es.BodyForce(lambda x, t: profile(x))])

    from warp_eulsph.output.description import describe, differences

    assert not differences(describe(pushed(1.0)), describe(pushed(1.0)))
    assert differences(describe(pushed(1.0)), describe(pushed(2.0))) == [
        "boundaries.0.value.enclosed.speed: 1.0, now 2.0"
    ]
    assert describe(nested(1))["boundaries"]["0"]["value"]["enclosed"]["profile"]["function"].endswith("profile")


def test_other_versions_are_named(tmp_path, caplog, monkeypatch):
    stop = StopAfter(5)
    run(tmp_path, stop=stop, watch=stop.watch)
    monkeypatch.setattr("warp_eulsph.output.environment.platform.python_version", lambda: "2.7.18")
    with caplog.at_level(logging.WARNING):
        run(tmp_path, resume=True)
    assert "resuming elsewhere, so the bits may differ: versions.python" in caplog.text
    assert len(json.loads((tmp_path / "env.json").read_text())["sessions"]) == 2


def test_damaged_checkpoint_is_skipped_with_a_message(whole, tmp_path, caplog):
    stop = StopAfter(4, 9)
    run(tmp_path, stop=stop, watch=stop.watch)
    run(tmp_path, resume=True, stop=stop, watch=stop.watch)
    older, newer = sorted((tmp_path / "ckpt").glob("*.ckpt"))
    content = bytearray(newer.read_bytes())
    content[len(content) // 2] ^= 4
    newer.write_bytes(content)
    with caplog.at_level(logging.WARNING):
        run(tmp_path, resume=True)
    assert "is damaged: its SHA-256 does not fit" in caplog.text
    assert f"using checkpoint {older} of step 4" in caplog.text
    assert contents(tmp_path) == contents(whole[0])
    assert list((tmp_path / "abandoned").rglob(newer.name))


def test_no_whole_checkpoint_is_an_error(tmp_path):
    stop = StopAfter(4)
    run(tmp_path, stop=stop, watch=stop.watch)
    for path in (tmp_path / "ckpt").glob("*.ckpt"):
        path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(DamagedError, match="no checkpoint is whole, the run must start anew"):
        run(tmp_path, resume=True)


def test_a_run_without_checkpoints_starts_anew_and_says_so(whole, tmp_path, caplog):
    run(tmp_path, until=1e-3)
    for path in (tmp_path / "ckpt").iterdir():
        path.unlink()
    run(tmp_path, resume=True)
    assert "has no checkpoint: the run starts anew" in caplog.text
    assert contents(tmp_path) == contents(whole[0])
    assert len(list((tmp_path / "abandoned/0001/snap").iterdir())) >= 3


def test_torn_lists_are_mended_at_the_resume(whole, tmp_path):
    stop = StopAfter(9)
    run(tmp_path, stop=stop, watch=stop.watch)
    for name in ("manifest.jsonl", "log.jsonl"):
        with (tmp_path / name).open("a") as file:
            file.write('{"name": "snap/00')
    temporary_beside(tmp_path / "snap" / "0000000011.vtkhdf").write_bytes(b"part of a frame")
    run(tmp_path, resume=True)
    assert contents(tmp_path) == contents(whole[0])
    assert not list(tmp_path.rglob("*.tmp"))


def test_unstable_run_keeps_its_last_good_state(tmp_path):
    def crushed():
        simulation = plate()
        push = es.Velocity(lambda X: X[:, 0] > 5 / 6, value=[-300.0, 0.0])
        held = simulation.boundaries[0]
        body = simulation.bodies[0]
        return es.Simulation(body, boundaries=[held, push], reference=es.Never(), time_step=es.TimeStep(fixed=1e-4))

    simulation = crushed()
    with pytest.raises(es.UnstableError, match=r"the last good snapshot is .*snap/\d{10}\.vtkhdf"):
        record(simulation, tmp_path, 0.1, Recording(snapshots=EverySteps(1)))
    status = json.loads((tmp_path / "status.json").read_text())
    assert status["state"] == "unstable" and "unstable at t = " in status["reason"]
    entries = [json.loads(line) for line in (tmp_path / "manifest.jsonl").read_text().splitlines()]
    assert entries[-1]["step"] == simulation.steps - 1
    assert np.isfinite(read_snapshot(tmp_path / entries[-1]["name"]).x).all()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signals_finish_the_step_and_checkpoint(whole, tmp_path, number):
    def interrupt(simulation):
        if simulation.steps == 6:
            os.kill(os.getpid(), number)

    before = signal.getsignal(number)
    with Stop() as stop:
        _, outcome = run(tmp_path, stop=stop, watch=interrupt)
    assert outcome.stopped == number.name and 6 <= outcome.step <= 7
    assert signal.getsignal(number) is before
    run(tmp_path, resume=True)
    assert contents(tmp_path) == contents(whole[0])


def test_wall_limit_and_stop_file(tmp_path):
    _, outcome = run(tmp_path, stop=Stop(wall=0.0))
    assert outcome.stopped == "wall limit of 0 s" and outcome.step == 1
    file = RunDirectory(tmp_path).stop
    file.touch()
    _, outcome = run(tmp_path, resume=True, stop=Stop(file=file))
    assert outcome.stopped == f"file {file}" and outcome.step == 2 and not file.exists()


def test_checkpoints_by_wall_time(tmp_path):
    taken = []

    def watch(simulation):
        time.sleep(0.01)
        taken.append(len(list((tmp_path / "ckpt").glob("*.ckpt"))))

    simulation = plate()
    record(simulation, tmp_path, 1e-3, recording(simulation, checkpoint=0.001), watch=watch)
    assert 2 <= max(taken) <= 3  # three for the moment between a new one and the removal of the oldest
    assert len(list((tmp_path / "ckpt").glob("*.ckpt"))) == 2


def test_recording_at_given_times_and_without_interval(tmp_path):
    simulation = plate()
    record(simulation, tmp_path, 1e-3, Recording(snapshots=AtTimes([1e-4, 7e-4]), fields=["J"], dtype=np.float64))
    entries = [json.loads(line) for line in (tmp_path / "manifest.jsonl").read_text().splitlines()]
    assert [float.fromhex(entry["time"]) for entry in entries] == [0.0, 1e-4, 7e-4, 1e-3]
    snapshot = read_snapshot(tmp_path / entries[-1]["name"])
    assert set(snapshot.fields) == {"J"} and np.array_equal(snapshot.x, simulation.x)


EDGE = [k for k in range(36) if plate().x[k, 0] > 0.5]


@pytest.mark.parametrize(
    "region", [lambda X: X[:, 0] > 0.5, EDGE, np.isin(np.arange(36), EDGE)], ids=["predicate", "numbers", "mask"]
)
def test_snapshots_of_a_region_hold_its_particles_and_nothing_else_changes(whole, tmp_path, region):
    simulation = plate()
    record(simulation, tmp_path, UNTIL, recording(simulation, region=region))
    assert 0 < len(EDGE) < 36
    for frame, full in zip(Run(tmp_path), Run(whole[0]), strict=True):
        assert (frame.time, frame.step, frame.N) == (full.time, full.step, len(EDGE))
        assert frame.particles.tolist() == EDGE and full.particles.tolist() == list(range(36))
        for name in full.units:
            assert np.array_equal(frame[name], full[name][EDGE]), name
    mine, all_ = contents(tmp_path), contents(whole[0])
    for name in ("log.jsonl", "corner", "whole", "hold", "middle", "state"):  # all particles, checkpoints too
        assert mine[name] == all_[name]
    manifest = [json.loads(line) for line in (tmp_path / "manifest.jsonl").read_text().splitlines()]
    assert {line["N"] for line in manifest} == {len(EDGE)}
    kept = json.loads((tmp_path / "run.json").read_text())["recording"]
    assert kept["particles"]["shape"] == [len(EDGE)] and kept["region"] is not None
    assert json.loads((whole[0] / "run.json").read_text())["recording"]["particles"] is None
    with pytest.raises(ValueError, match="must have the same particles, got 18 and 36"):
        Run(tmp_path).compare(Run(whole[0]))


def test_a_run_of_a_region_resumes_bit_for_bit_and_under_no_other_region(tmp_path):
    def go(directory, limit=0.5, **options):
        simulation = plate()
        kept = recording(simulation, region=lambda X: X[:, 0] > limit, fields=["velocity"])
        return record(simulation, directory, UNTIL, kept, **options)

    go(tmp_path / "whole")
    stop = StopAfter(3, 7)
    go(tmp_path / "parts", stop=stop, watch=stop.watch)
    with pytest.raises(ChangedCaseError, match=r"recording\.region\.enclosed\.limit: 0\.5, now 0\.4"):
        go(tmp_path / "parts", limit=0.4, resume=True)
    while go(tmp_path / "parts", resume=True, stop=stop, watch=stop.watch).stopped is not None:
        pass
    assert contents(tmp_path / "parts") == contents(tmp_path / "whole")
    assert Run(tmp_path / "parts").fields == ["x", "particle", "velocity"]


def test_snapshots_of_one_body(tmp_path):
    x = plate().bodies[0].x
    rubber = plate().bodies[0].material
    two = [es.Body(x=x + 2.0 * k, volume=1 / 36, material=rubber, name=name) for k, name in enumerate(("a", "b"))]
    simulation = es.Simulation(two)
    record(simulation, tmp_path, 1e-5, Recording(body="b", region=lambda X: X[:, 0] < 2.5))
    frame = Run(tmp_path)[-1]
    assert frame.N == 18 and frame.particles.min() >= 36 and (frame["body"] == 1).all()
    assert frame.interpolate([[2.3, 2.5]], "x") == pytest.approx(np.array([[2.3, 2.5]]), abs=1e-6)  # single precision


def test_wrong_regions_are_told_before_files_move(tmp_path):
    run(tmp_path, until=1e-4)
    before = contents(tmp_path)
    for changes, message in [
        ({"region": lambda X: X[:, 0] > 9.0}, "Recording: the region selects no particle"),
        ({"region": [36]}, r"Recording: region indices must be integers in \[0, 36\)"),
        ({"region": lambda X: X}, r"Recording: a region predicate must return \(36,\) bool"),
        ({"body": "plat"}, r"Recording: body must be one of \['plate'\], got 'plat'"),
    ]:
        with pytest.raises(ValueError, match=message):
            record(plate(), tmp_path, 1e-3, Recording(**changes), replace=True)
    assert contents(tmp_path) == before


def test_wrong_probes_and_fields_are_told_before_files_move(tmp_path):
    run(tmp_path, until=1e-4)
    before = contents(tmp_path)
    simulation = plate()
    with pytest.raises(ValueError, match="must lie in body 'plate'"):
        record(simulation, tmp_path, 1e-3, Recording(probes=[PointProbe(name="far", X=(9, 9))]), replace=True)
    with pytest.raises(ValueError, match=r"fields must be among .* got \['vellocity'\]"):
        record(simulation, tmp_path, 1e-3, Recording(fields=["vellocity"]), replace=True)
    assert contents(tmp_path) == before


def test_bad_recordings_are_named():
    with pytest.raises(ValueError, match="dtype must be"):
        Recording(dtype=np.float16)
    with pytest.raises(ValueError, match="names of probes must differ"):
        Recording(probes=[PointProbe(name="a", X=(0, 0))] * 2)
    with pytest.raises(ValueError, match="checkpoint must be a positive wall time"):
        Recording(checkpoint=0.0)
    with pytest.raises(ValueError, match="interval must be a positive time"):
        EveryTime(0.0)
    with pytest.raises(ValueError, match="count of steps must be at least 1"):
        EverySteps(0)
    with pytest.raises(ValueError, match="times must be finite and increase"):
        AtTimes([2.0, 1.0])
