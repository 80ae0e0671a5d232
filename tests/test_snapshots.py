"""Snapshots read back bit for bit by h5py (by VTK: test_vtk.py), and a failing disk leaves no damaged file."""

import json
import os

import h5py
import numpy as np
import pytest
import warp as wp

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.output import (
    DEFAULT_FIELDS,
    FIELDS,
    Recording,
    Run,
    SnapshotWriter,
    read_snapshot,
    record,
    write_snapshot,
)
from warp_eulsph.pictures import quantity

DENSITY, YOUNG, POISSON = 1100.0, 17e6, 0.3


def simulate(dim, dtype=wp.float64):
    """Two small blocks in motion, so that every field is different everywhere."""
    material = es.NeoHookean(density=DENSITY, young=YOUNG, poisson=POISSON)
    x, volume = box((0.0,) * dim, (1.0,) * dim, 0.25, jitter=0.05)
    v = np.random.default_rng(1).normal(size=x.shape)
    bodies = [
        es.Body(x=x + 2.0 * k, volume=volume, material=material, velocity=v * (1 + k), name=f"block {k}")
        for k in range(2)
    ]
    simulation = es.Simulation(bodies, dtype=dtype)
    simulation.run(until=1e-3)
    return simulation


def neo_hookean_stress(F):
    """σ by hand, the law written down in 3-D: (n, 3, 3) from (n, d, d)."""
    n, d = F.shape[:2]
    F3 = np.tile(np.eye(3), (n, 1, 1))
    F3[:, :d, :d] = F
    J = np.linalg.det(F3)[:, None, None]
    mu, kappa = YOUNG / 2 / (1 + POISSON), YOUNG / 3 / (1 - 2 * POISSON)
    b = F3 @ F3.transpose(0, 2, 1)
    trace = np.trace(b.T)[:, None, None]
    return mu * J ** (-5 / 3) * (b - trace / 3 * np.eye(3)) + kappa * (J - 1) * np.eye(3)


@pytest.fixture(scope="module", params=[1, 2, 3])
def simulation(request):
    return simulate(request.param)


def pad(a):
    """Natural shape to VTK's: vectors to 3 components, tensors to 9 with ones on the missing diagonal."""
    if a.ndim == 2:
        return np.pad(a, ((0, 0), (0, 3 - a.shape[1])))
    if a.ndim == 3:
        full = np.tile(np.eye(3, dtype=a.dtype), (len(a), 1, 1))
        full[:, : a.shape[1], : a.shape[1]] = a
        return full.reshape(-1, 9)
    return a


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_read_back_bit_for_bit(simulation, tmp_path, dtype):
    path = tmp_path / "a.vtkhdf"
    write_snapshot(path, simulation, dtype=dtype)
    snapshot = read_snapshot(path)
    d, n = simulation.space.dim, len(simulation.x)
    assert (snapshot.time, snapshot.step) == (simulation.t, simulation.steps)
    np.testing.assert_array_equal(snapshot.x, simulation.x.astype(dtype))
    np.testing.assert_array_equal(snapshot.fields["velocity"], simulation.v.astype(dtype))
    np.testing.assert_array_equal(snapshot.fields["deformation_gradient"], simulation.F.astype(dtype))
    np.testing.assert_array_equal(snapshot.fields["body"], np.repeat([0, 1], n // 2))
    assert set(snapshot.fields) == set(DEFAULT_FIELDS)
    for name, values in snapshot.fields.items():
        assert values.shape == (n, *FIELDS[name].shape(d)), name
        assert values.dtype == (np.int32 if name in ("body", "particle") else dtype), name
        assert snapshot.units[name] == FIELDS[name].unit
    assert snapshot.units["cauchy_stress"] == "Pa" and snapshot.units["velocity"] == "m/s"


def test_derived_fields_against_the_law_written_by_hand(simulation, tmp_path):
    write_snapshot(tmp_path / "a.vtkhdf", simulation, dtype=np.float64)
    fields = read_snapshot(tmp_path / "a.vtkhdf").fields
    J = np.linalg.det(simulation.F)
    sigma = neo_hookean_stress(simulation.F)
    # A few operations in float64 on numbers of the moduli's size: 1e-13 of E.
    np.testing.assert_allclose(fields["cauchy_stress"], sigma, rtol=0, atol=1e-13 * YOUNG)
    np.testing.assert_allclose(fields["pressure"], -np.trace(sigma.T) / 3, rtol=0, atol=1e-13 * YOUNG)
    np.testing.assert_allclose(fields["J"], J, rtol=1e-14)
    np.testing.assert_allclose(fields["density"], DENSITY / J, rtol=1e-14)
    d = simulation.space.dim
    np.testing.assert_allclose(fields["volume"], 0.25**d * J, rtol=1e-14)
    np.testing.assert_allclose(fields["smoothing_length"], 1.3 * 0.25 * J ** (1 / d), rtol=1e-14)
    assert fields["particle"].tolist() == list(range(len(J)))
    assert np.abs(sigma).max() > 1e-3 * YOUNG  # the state is stressed, so the comparison means something


def test_bar_has_uniaxial_stress(tmp_path):
    x, volume = box((0.0,), (1.0,), 0.05)
    bar = es.Body(x=x, volume=volume, material=es.Bar(density=7833.0, young=2e11), velocity=x)
    simulation = es.Simulation(bar)
    simulation.run(until=2e-5)
    write_snapshot(tmp_path / "a.vtkhdf", simulation, ["cauchy_stress"], dtype=np.float64)
    sigma = read_snapshot(tmp_path / "a.vtkhdf").fields["cauchy_stress"]
    # In 1-D σ = P F / J = P.
    np.testing.assert_allclose(sigma[:, 0, 0], 2e11 * (simulation.F[:, 0, 0] - 1), rtol=0, atol=1e-14 * 2e11)
    assert np.abs(sigma[:, 0, 0]).max() > 1e5
    assert not sigma[:, 1:].any() and not sigma[:, :, 1:].any()


def test_layout_that_old_readers_need(simulation, tmp_path):
    write_snapshot(tmp_path / "a.vtkhdf", simulation)
    with h5py.File(tmp_path / "a.vtkhdf") as file:
        root = file["VTKHDF"]
        assert isinstance(root.attrs["Type"], np.bytes_) and root.attrs["Type"] == b"PolyData"
        assert root.attrs["Version"].dtype == np.int64 and root.attrs["Version"].tolist() == [2, 2]
        assert file.attrs["time"] == simulation.t and file.attrs["time"].dtype == np.float64
        assert root["Vertices/Connectivity"].compression == root["Vertices/Offsets"].compression == "gzip"
        for kind in ("Lines", "Polygons", "Strips"):
            assert root[kind]["Offsets"][()].tolist() == [0] and root[kind]["NumberOfCells"][()].tolist() == [0]


def test_some_fields_only(simulation, tmp_path):
    write_snapshot(tmp_path / "a.vtkhdf", simulation, fields=["J"])
    assert set(read_snapshot(tmp_path / "a.vtkhdf").fields) == {"J"}
    with pytest.raises(ValueError, match=r"snapshot fields must be among .*'pressure'.* got \['presure'\]"):
        write_snapshot(tmp_path / "b.vtkhdf", simulation, fields=["presure"])
    with pytest.raises(ValueError, match="dtype must be"):
        write_snapshot(tmp_path / "b.vtkhdf", simulation, dtype=np.float16)
    assert not (tmp_path / "b.vtkhdf").exists()


@pytest.mark.parametrize("broken", ["replace", "fsync"])
def test_failing_disk_keeps_the_old_file(simulation, tmp_path, monkeypatch, broken):
    path = tmp_path / "a.vtkhdf"
    write_snapshot(path, simulation, fields=["J"])
    before = path.read_bytes()

    def fail(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, broken, fail)
    with pytest.raises(OSError, match="No space left"):
        write_snapshot(path, simulation)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["a.vtkhdf"]


def test_failure_while_writing_leaves_nothing(simulation, tmp_path, monkeypatch):
    def fail(*arguments, **keywords):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(h5py.Group, "create_dataset", fail)
    with pytest.raises(OSError, match="No space left"):
        write_snapshot(tmp_path / "a.vtkhdf", simulation)
    assert list(tmp_path.iterdir()) == []


def test_foreign_file_is_refused(tmp_path):
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["x"] = np.zeros(3)
    with pytest.raises(ValueError, match="is not a snapshot"):
        read_snapshot(tmp_path / "b.h5")


def test_float32_run_keeps_time_in_float64(tmp_path):
    simulation = simulate(2, wp.float32)
    write_snapshot(tmp_path / "a.vtkhdf", simulation)
    snapshot = read_snapshot(tmp_path / "a.vtkhdf")
    assert snapshot.time == simulation.t == 1e-3
    np.testing.assert_array_equal(snapshot.x, simulation.x)


def test_run_writes_a_series(tmp_path):
    simulation = simulate(1)
    writer = SnapshotWriter(tmp_path / "run", fields=["velocity"])
    assert writer.last is None
    simulation.run(until=2e-3, every=5e-4, output=writer)
    listing = json.loads(writer.series.read_text())
    assert listing["file-series-version"] == "1.0"
    assert [entry["time"] for entry in listing["files"]] == pytest.approx([1e-3, 1.5e-3, 2e-3])
    for entry in listing["files"]:
        snapshot = read_snapshot(tmp_path / "run" / entry["name"])
        assert snapshot.time == entry["time"] and entry["name"] == f"snap/{snapshot.step:010d}.vtkhdf"
    assert writer.last == tmp_path / "run" / listing["files"][-1]["name"]
    writer.write(simulation)  # the same frame again
    assert len(json.loads(writer.series.read_text())["files"]) == 3


def test_run_takes_a_directory(tmp_path):
    simulation = simulate(1)
    simulation.run(until=1.1e-3, output=tmp_path / "run")
    names = sorted(file.name for file in (tmp_path / "run" / "snap").iterdir())
    assert len(names) == 2 and (tmp_path / "run" / "run.vtkhdf.series").exists()


def test_fields_that_are_asked_for(simulation, tmp_path):
    write_snapshot(tmp_path / "a.vtkhdf", simulation, fields=FIELDS, dtype=np.float64)
    fields = read_snapshot(tmp_path / "a.vtkhdf").fields
    asked = ["displacement", "acceleration", "force", "first_piola", "strain_energy_density", "mismatch"]
    assert list(FIELDS)[-7:] == [*asked, "interaction_force"] and not {*list(FIELDS)[-7:]} & {*DEFAULT_FIELDS}
    for name in asked:
        np.testing.assert_array_equal(fields[name], getattr(simulation, name))
        assert fields[name].any()
    mass = DENSITY * 0.25**simulation.space.dim
    np.testing.assert_allclose(fields["acceleration"] * mass, fields["force"], rtol=1e-14)


def test_fields_that_are_asked_for_are_of_the_particles_chosen_and_drawn(tmp_path):
    simulation = simulate(2)
    chosen = [3, 17, 20]
    record(simulation, tmp_path, 2e-3, Recording(fields=FIELDS, region=chosen, dtype=np.float64))
    run = Run(tmp_path)
    for name in ("displacement", "force", "first_piola", "mismatch"):
        np.testing.assert_array_equal(run[-1].field(name), getattr(simulation, name)[chosen])
    assert len(run.fields) == len(set(run.fields)) and run.units["first_piola"] == "Pa"
    assert {"displacement", "first_piola"} <= {*run.to_xarray()}
    assert quantity(run[-1], "displacement.x").label == "displacement x [m]"


def test_default_fields_stay_small(tmp_path):
    """What a file holds of a particle besides its position, in single precision."""
    simulation = simulate(2)
    write_snapshot(tmp_path / "a.vtkhdf", simulation)
    with h5py.File(tmp_path / "a.vtkhdf") as file:
        stored = sum(data.nbytes for data in file["VTKHDF/PointData"].values())
    assert stored == 116 * len(simulation.x)  # 29 numbers, vectors and tensors of three components as VTK has them
