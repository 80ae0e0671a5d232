"""Exports of a run to single files: they say what the snapshots hold, to numpy, VTK and PyVista."""

import csv

import numpy as np
import pytest
from kept_runs import plate, short_run

from warp_eulsph.output import Recording, Run, record
from warp_eulsph.output.export import export


@pytest.fixture(scope="module", params=[1, 2, 3], ids=["1d", "2d", "3d"])
def run(request, tmp_path_factory):
    """A short run of four frames in 1-D, 2-D or 3-D."""
    return short_run(request.param, tmp_path_factory.mktemp(f"run{request.param}"))


def test_npz_holds_all_times(run, tmp_path):
    data = np.load(export(list(run), tmp_path / "a.npz"))
    for k, file in enumerate(run):
        snapshot = file
        assert (data["time"][k], data["step"][k]) == (snapshot.time, snapshot.step)
        np.testing.assert_array_equal(data["x"][k], snapshot.x)
        for name, values in [(name, snapshot[name]) for name in snapshot.units]:
            np.testing.assert_array_equal(data[name][k], values)


def test_csv_reads_back_to_the_same_numbers(run, tmp_path):
    path = export(list(run), tmp_path / "a.csv", ["velocity", "deformation_gradient", "body"])
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    snapshot = run[-1]
    n, dim = snapshot.x.shape
    assert len(rows) == len(run) * n and float(rows[-1]["time"]) == snapshot.time
    last = rows[-n:]
    for i, axis in enumerate("xyz"[:dim]):
        np.testing.assert_array_equal(np.array([row[axis] for row in last], dtype=np.float32), snapshot.x[:, i])
        found = np.array([row[f"velocity_{axis}"] for row in last], dtype=np.float32)
        np.testing.assert_array_equal(found, snapshot["velocity"][:, i])
        found = np.array([row[f"deformation_gradient_x{axis}"] for row in last], dtype=np.float32)
        np.testing.assert_array_equal(found, snapshot.F[:, 0, i])
    assert [row["particle"] for row in last[:3]] == ["0", "1", "2"] and last[0]["body"] == "0"


def test_csv_of_a_region_in_double_precision(tmp_path, monkeypatch):
    """The numbers of the particles stand in their column once; blocks of rows follow each other."""
    monkeypatch.setattr("warp_eulsph.output.export._BLOCK", 4)
    simulation = plate()
    simulation.step(3)
    record(simulation, tmp_path / "run", 1e-3, Recording(region=[3, 4, 8, 9, 30, 35], dtype=np.float64))
    frame = Run(tmp_path / "run")[0]
    with export([frame], tmp_path / "a.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0][:4] == ["time", "particle", "x", "y"] and len(set(rows[0])) == len(rows[0]) and len(rows) == 7
    found = dict(zip(rows[0], np.array(rows[1:], dtype=float).T, strict=True))
    assert found["particle"].tolist() == [3, 4, 8, 9, 30, 35] and (found["time"] == frame.time).all()
    assert np.array_equal(found["y"], frame.x[:, 1]) and np.array_equal(found["pressure"], frame.pressure)
    assert np.array_equal(found["cauchy_stress_xy"], frame.cauchy_stress[:, 0, 1]) and found["pressure"].all()


def test_single_vtkhdf_in_vtk(run, tmp_path):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader

    path = export(list(run), tmp_path / "a.vtkhdf", ["velocity", "cauchy_stress", "body"])
    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == 4
    for k, file in enumerate(run):
        snapshot = file
        reader.SetStep(k)
        reader.Update()
        data = reader.GetOutput()
        assert reader.GetTimeValue() == snapshot.time
        dim = snapshot.x.shape[1]
        assert data.GetNumberOfPoints() == data.GetNumberOfVerts() == len(snapshot.x)
        np.testing.assert_array_equal(vtk_to_numpy(data.GetPoints().GetData())[:, :dim], snapshot.x)
        velocity = vtk_to_numpy(data.GetPointData().GetArray("velocity"))
        np.testing.assert_array_equal(velocity[:, :dim], snapshot["velocity"])
        stress = vtk_to_numpy(data.GetPointData().GetArray("cauchy_stress"))
        np.testing.assert_array_equal(stress, snapshot["cauchy_stress"].reshape(-1, 9))
        assert data.GetFieldData().GetArray("Step").GetValue(0) == snapshot.step


def test_xdmf_in_vtk(run):
    """The small file beside the snapshots holds no numbers of its own but the times."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
    from vtkmodules.vtkIOXdmf2 import vtkXdmfReader

    path = export(list(run), run.directory.path / "views" / "a.xdmf", ["velocity", "J", "cauchy_stress"])
    assert path.stat().st_size < 10_000
    reader = vtkXdmfReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    assert list(times) == [file.time for file in run]
    for time, file in zip(times, run, strict=True):
        snapshot = file
        reader.UpdateTimeStep(time)
        data = reader.GetOutputDataObject(0)
        dim = snapshot.x.shape[1]
        np.testing.assert_array_equal(vtk_to_numpy(data.GetPoints().GetData())[:, :dim], snapshot.x)
        for name, shown in (("velocity", (3,)), ("J", ()), ("cauchy_stress", (9,))):
            values = vtk_to_numpy(data.GetPointData().GetArray(name))
            assert values.shape == (len(snapshot.x), *shown)
            expected = snapshot[name].reshape(len(values), -1)
            np.testing.assert_array_equal(values.reshape(len(values), -1)[:, : expected.shape[1]], expected)


def test_pvd_and_vtu_in_pyvista(run, tmp_path):
    """Every time with its fields, exact; a .vtu alone too, of one frame only."""
    import pyvista

    reader = pyvista.get_reader(export(list(run), tmp_path / "a.pvd", ["velocity", "J", "deformation_gradient"]))
    assert reader.time_values == [frame.time for frame in run]
    for k, frame in enumerate(run):
        reader.set_active_time_point(k)
        data, dim = reader.read()[0], frame.x.shape[1]
        np.testing.assert_array_equal(data.points[:, :dim], frame.x)
        np.testing.assert_array_equal(data["velocity"][:, :dim], frame.v)
        np.testing.assert_array_equal(data["J"], frame["J"])
        np.testing.assert_array_equal(data["deformation_gradient"].reshape(-1, 3, 3)[:, :dim, :dim], frame.F)
        assert data.n_cells == data.n_points == len(frame.x)
    single = pyvista.read(export([run[-1]], tmp_path / "b.vtu"))
    np.testing.assert_array_equal(single["cauchy_stress"], run[-1].cauchy_stress.reshape(-1, 9))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "a.pvd", "b.vtu"]
    with pytest.raises(ValueError, match=r"a \.vtu holds one frame, got 4; choose one"):
        export(list(run), tmp_path / "c.vtu")


def test_bad_exports_are_named(run, tmp_path):
    with pytest.raises(ValueError, match=r"ending must be one of .vtkhdf, .xdmf, .vtu, .pvd, .csv, .npz, got '.txt'"):
        export(list(run), tmp_path / "a.txt")
    with pytest.raises(ValueError, match=r"fields must be among \['J'.*got \['speed'\]"):
        export(list(run), tmp_path / "a.npz", ["speed"])
    assert not list(tmp_path.iterdir())
