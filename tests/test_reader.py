"""A run read back: lazily, by name, with derived fields; and by VTK, bit for bit, wherever the folder is."""

import sys
import time

import h5py
import numpy as np
import pytest
import warp as wp
from kept_runs import UNTIL, plate, recording, run
from test_snapshots import pad

import warp_eulsph as es
from warp_eulsph.output import Recording, Run, RunDirectory, SnapshotWriter, read_snapshot, record
from warp_eulsph.output.manifest import Manifest, entry_of
from warp_eulsph.schedule import EveryTime


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    directory = tmp_path_factory.mktemp("runs") / "plate"
    simulation = plate()
    record(simulation, directory, UNTIL, recording(simulation, dtype=np.float64))
    return directory


def test_frames_by_index_time_and_slice(directory):
    run = Run(directory)
    assert len(run) == len(run.times) == 6 and [frame.time for frame in run] == run.times.tolist()
    assert run[-1].time == UNTIL and run[0].step == 0 == run.steps[0]
    assert [frame.step for frame in run[1:3]] == run.steps[1:3].tolist()
    assert run.at(8.1e-4).time == 8e-4
    with pytest.raises(IndexError):
        run[6]
    assert repr(run[0]) == "<frame of step 0, t = 0 s, 36 particles>"


def test_fields_have_their_natural_shapes_and_units(directory):
    run = Run(directory)
    frame, snapshot = run[-1], read_snapshot(run[-1].path)
    assert frame.F.shape == (36, 2, 2) and frame.x.shape == frame.v.shape == (36, 2)
    assert frame.cauchy_stress.shape == (36, 3, 3)
    for name, values in snapshot.fields.items():
        assert np.array_equal(frame[name], values)
    assert np.array_equal(frame.x, snapshot.x)
    assert run.units == {**snapshot.units, "x": "m", **{k: run.units[k] for k in run.fields if k not in frame.units}}
    assert run.units["von_mises"] == "Pa" and run.units["velocity"] == "m/s"
    assert frame.F is frame.F  # read once
    with pytest.raises(KeyError, match="holds no 'temperature', only"):
        frame["temperature"]


def test_derived_fields(directory):
    frame = Run(directory)[-1]
    s = frame.cauchy_stress
    first = s[7]
    by_hand = np.sqrt(
        0.5 * ((first[0, 0] - first[1, 1]) ** 2 + (first[1, 1] - first[2, 2]) ** 2 + (first[2, 2] - first[0, 0]) ** 2)
        + 3.0 * (first[0, 1] ** 2 + first[1, 2] ** 2 + first[0, 2] ** 2)
    )
    assert frame.von_mises[7] == pytest.approx(by_hand, rel=1e-12)
    assert frame.pressure == pytest.approx(-(s[:, 0, 0] + s[:, 1, 1] + s[:, 2, 2]) / 3, rel=1e-12)
    assert frame.principal_stretches.prod(axis=1) == pytest.approx(frame.J, rel=1e-12)
    assert (np.diff(frame.principal_stresses) >= 0.0).all()
    assert frame.principal_stresses.sum(axis=1) == pytest.approx(-3 * frame.pressure, rel=1e-9)
    C = np.einsum("nki,nkj->nij", frame.F, frame.F)
    assert frame.green_lagrange == pytest.approx(0.5 * (C - np.eye(2)), abs=1e-14)
    F = np.zeros((36, 3, 3))
    F[:, :2, :2], F[:, 2, 2] = frame.F, 1.0
    assert frame.first_piola @ F.transpose(0, 2, 1) == pytest.approx(frame.J[:, None, None] * s, rel=1e-6, abs=1.0)
    assert Run(directory).displacement(-1) == pytest.approx(frame.x - Run(directory)[0].x, abs=0)


def test_some_fields_only(tmp_path):
    record(plate(), tmp_path, 1e-4, Recording(fields=["deformation_gradient", "cauchy_stress"]))
    run = Run(tmp_path)
    assert run.fields == [
        *("x", "cauchy_stress", "deformation_gradient"),
        *("von_mises", "principal_stresses", "principal_stretches", "green_lagrange", "first_piola"),
    ]
    assert pytest.approx(np.linalg.det(run[-1].F), rel=1e-6) == run[-1].J
    assert run[-1].pressure.shape == (36,)


def test_log_probes_and_description(directory, device):
    run = Run(directory)
    assert run.log["t"][-1] == UNTIL and run.log["momentum"].shape == (len(run.log["t"]), 2)
    assert run.probe_names == ["corner", "hold", "middle", "whole"]
    assert len(run.probes["corner"]["t"]) == run.steps[-1] + 1
    assert run.probes["corner"].units["v"] == "m/s" and run.probes["hold"].units["t"] == "s"
    assert run.description["simulation"]["dimension"] == 2 and run.state == "done"
    assert run.environment["sessions"][0]["device"]["kind"] == ("cuda" if device.is_cuda else "cpu")


def test_comparison_of_two_runs(directory, tmp_path):
    simulation = plate(reference=es.Always())
    record(simulation, tmp_path, UNTIL, Recording(snapshots=EveryTime(8e-4)))
    found = Run(directory).compare(Run(tmp_path), fields=("x", "von_mises"))
    assert found.times.tolist() == [0.0, 8e-4, 1.6e-3, 2e-3]
    apart = np.linalg.norm(Run(directory)[-1].x - Run(tmp_path)[-1].x, axis=1)
    assert found.largest["x"][-1] == apart.max() > found.rms["x"][-1] == pytest.approx(np.sqrt((apart**2).mean()))
    same = Run(directory).compare(Run(directory))
    assert not same.largest["x"].any()
    lonely = SnapshotWriter(tmp_path / "lonely")
    simulation.step()
    lonely.write(simulation)
    with pytest.raises(ValueError, match="no time in common"):
        Run(directory).compare(Run(tmp_path / "lonely"))


def test_data_set_has_labels_and_units(directory):
    run = Run(directory)
    data = run.to_xarray([*run.fields])
    assert data.time.values.tolist() == run.times.tolist() and data.step.values.tolist() == run.steps.tolist()
    assert dict(data.sizes) == {
        "time": 6,
        "particle": 36,
        "axis": 2,
        "axis_2": 2,
        "stress_axis": 3,
        "stress_axis_2": 3,
        "principal_stresses_order": 3,
        "principal_stretches_order": 2,
    }
    assert set(data) == {*run.fields} - {"particle"} and data.particle.values.tolist() == list(range(36))
    for name in data:
        assert data[name].attrs["units"] == run.units[name]
        assert data[name].values.dtype == run[-1].field(name).dtype
        for k, frame in enumerate(run):
            assert np.array_equal(data[name][k], frame.field(name))
    assert data.velocity.attrs["long_name"] == "velocity" and data.time.attrs["units"] == "s"
    last = run[-1]
    assert data.velocity.sel(axis="y", particle=7)[-1] == last.v[7, 1]
    assert data.cauchy_stress.isel(time=-1).sel(stress_axis="z", stress_axis_2="z")[5] == last.cauchy_stress[5, 2, 2]
    sheared = data.deformation_gradient.isel(time=-1).sel(axis="x", axis_2="y").values
    assert np.array_equal(sheared, last.F[:, 0, 1])
    assert "von_mises" not in run.to_xarray()


def test_data_set_reads_only_what_is_looked_at(directory, monkeypatch):
    from warp_eulsph.output import reader

    run = Run(directory)
    data, read = run.to_xarray(["velocity", "von_mises"]), []
    whole = reader.read_field
    monkeypatch.setattr(reader, "read_field", lambda path, name: read.append((path.stem, name)) or whole(path, name))
    found = data.velocity.sel(time=8.1e-4, method="nearest").isel(particle=[3, 30, 4])
    assert read == []
    assert np.array_equal(found.values, run.at(8e-4).v[[3, 30, 4]])
    assert set(read) == {(run.at(8e-4).path.stem, "velocity")}
    assert np.array_equal(data.von_mises[::-2].values, np.stack([frame.von_mises for frame in run[::-2]]))
    assert data.velocity[3:3].shape == data.velocity[3:3].values.shape == (0, 36, 2)


def test_data_set_of_a_region_and_what_is_wrong(directory, tmp_path, monkeypatch):
    record(plate(), tmp_path / "some", 1e-4, Recording(region=[4, 9, 35], fields=["J"]))
    run = Run(tmp_path / "some")
    data = run.to_xarray()
    assert data.particle.values.tolist() == [4, 9, 35] and set(data) == {"x", "J"}
    assert float(data.J.sel(particle=35)[-1]) == run[-1].J[2]
    with pytest.raises(ValueError, match=r"fields must be among \['x', 'J', .*\], got \['velocity'\]"):
        run.to_xarray(["J", "velocity"])
    monkeypatch.setitem(sys.modules, "xarray", None)
    monkeypatch.delitem(sys.modules, "warp_eulsph.output.labelled")
    with pytest.raises(ModuleNotFoundError, match=r"data sets need xarray: pip install 'warp_eulsph\[xarray\]'"):
        run.to_xarray()


def test_no_run_is_an_error(tmp_path):
    with pytest.raises(FileNotFoundError, match="no run in"):
        Run(tmp_path)


def test_run_without_its_manifest_opens(directory, tmp_path):
    (tmp_path / "snap").mkdir()
    for path in (directory / "snap").iterdir():
        (tmp_path / "snap" / path.name).write_bytes(path.read_bytes())
    assert Run(tmp_path).times.tolist() == Run(directory).times.tolist()
    assert not (tmp_path / "manifest.jsonl").exists()  # reading writes nothing


def test_a_running_run_can_be_read_and_a_killed_one_is_told(tmp_path):
    states = []

    def watch(simulation):
        (tmp_path / "manifest.jsonl").open("a").close()
        states.append((Run(tmp_path).state, len(Run(tmp_path))))

    run(tmp_path, until=1e-3, watch=watch)
    assert {state for state, _ in states} == {"running"} and states[-1][1] >= 1
    home = RunDirectory(tmp_path)
    home.write(home.status, home.read(home.status) | {"state": "running"})
    assert Run(tmp_path).state == "killed"


def test_opening_a_thousand_snapshots_takes_half_a_second(tmp_path):
    simulation = plate()
    writer = SnapshotWriter(tmp_path)
    content = writer.write(simulation).read_bytes()
    entries = [entry_of("snap/0000000000.vtkhdf", 0, 0.0, 36, content)]
    for step in range(1, 1000):
        name = f"snap/{step:010d}.vtkhdf"
        (tmp_path / name).write_bytes(content)
        entries.append(entry_of(name, step, 1e-3 * step, 36, content))
    Manifest(tmp_path).replace(entries)
    begin = time.process_time()
    run = Run(tmp_path)
    assert len(run) == len(run.times) == 1000 and run[500].F.shape == (36, 2, 2)
    assert time.process_time() - begin < 0.5


def test_pyvista_reads_the_series_with_its_times(directory):
    import pyvista

    reader, run = pyvista.get_reader(str(directory / "run.vtkhdf.series")), Run(directory)
    assert list(reader.time_values) == run.times.tolist()
    for k, frame in enumerate(run):
        reader.set_active_time_point(k)
        data = reader.read()
        np.testing.assert_array_equal(data.points, pad(frame.x))
        np.testing.assert_array_equal(data.point_data["pressure"], frame.pressure)


def test_index_layout_that_old_readers_need(directory):
    with h5py.File(directory / "run.vtkhdf") as file:
        root = file["VTKHDF"]
        assert root.attrs["Type"] == b"PolyData" and root.attrs["Version"].tolist() == [2, 2]
        assert root["Points"].is_virtual and np.isnan(root["Points"].fillvalue)
        assert {source.file_name for source in root["Points"].virtual_sources()} == {
            f"snap/{step:010d}.vtkhdf" for step in Run(directory).steps
        }
        assert root["Steps/PointOffsets"].dtype == np.int64 and root["Steps"].attrs["NSteps"] == 6
        # VTK 9.3 looks for the Offsets of part k at k entries further on: all frames share one part.
        assert root["Steps/PartOffsets"][()].tolist() == [0] * 6 and root["NumberOfPoints"][()].tolist() == [36]


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_float32_runs_are_kept_too(dim, tmp_path):
    from test_snapshots import simulate

    simulation = simulate(dim, wp.float32)
    record(simulation, tmp_path, 1.2e-3)
    assert np.array_equal(Run(tmp_path)[-1].F, simulation.F)
