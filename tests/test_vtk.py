"""Snapshots and the index over them, read bit for bit by VTK: the one installed, and an older one where there is one.

The environment variable WARP_EULSPH_OLDER_VTK names a Python interpreter with an older VTK and numpy; ``.ci/run`` makes
one from ``.ci/older-vtk.txt``.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from test_snapshots import pad, simulate

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.output import Recording, Run, SnapshotWriter, read_snapshot, record, write_snapshot
from warp_eulsph.schedule import EverySteps

READER = Path(__file__).with_name("read_by_vtk.py")
OLDER = os.environ.get("WARP_EULSPH_OLDER_VTK")


@pytest.fixture(
    params=[
        "current",
        pytest.param("older", marks=pytest.mark.skipif(not OLDER, reason="WARP_EULSPH_OLDER_VTK names no interpreter")),
    ]
)
def read(request, tmp_path):
    """Function of a path -> what that VTK reads there, by name."""
    python = sys.executable if request.param == "current" else OLDER

    def reading(path):
        # -I: another environment must not see this one's packages, nor this folder
        subprocess.run([python, "-I", READER, path, tmp_path / "read.npz"], check=True, cwd="/")
        with np.load(tmp_path / "read.npz") as found:
            held = dict(found)
        assert (tuple(map(int, str(held["version"]).split(".")[:2])) < (9, 6)) == (request.param == "older")
        return held

    return reading


def same(held, k, x, fields, time, step):
    """Step ``k`` of what was read is this state, to the last bit."""
    assert held[f"{k}/points"].dtype == x.dtype
    np.testing.assert_array_equal(held[f"{k}/points"], pad(x))
    np.testing.assert_array_equal(held[f"{k}/cells"], np.arange(len(x)))
    assert {name.split("/")[2] for name in held if name.startswith(f"{k}/point/")} == set(fields)
    for name, values in fields.items():
        array = held[f"{k}/point/{name}"]
        assert array.dtype == values.dtype
        np.testing.assert_array_equal(array, pad(values))
    assert held["times"][k] == time and held[f"{k}/field/Step"].tolist() == [step]
    # Readers before 9.7 (9.3.1 to 9.6.2) leave active vectors and tensors unset; choose them by name.
    known = tuple(map(int, str(held["version"]).split(".")[:2])) >= (9, 7)
    assert held[f"{k}/active"].tolist() == (["velocity", "deformation_gradient"] if known else ["", ""])


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_every_array_of_a_snapshot(read, dim, dtype, tmp_path):
    simulation = simulate(dim)
    write_snapshot(tmp_path / "a.vtkhdf", simulation, dtype=dtype)
    snapshot = read_snapshot(tmp_path / "a.vtkhdf")
    held = read(tmp_path / "a.vtkhdf")
    same(held, 0, snapshot.x, snapshot.fields, simulation.t, simulation.steps)
    # Rows first: component 3 i + j is F_ij. The state is not symmetric, so a transposed order would show.
    F = held["0/point/deformation_gradient"]
    if dim > 1:
        np.testing.assert_array_equal(F[:, 1], snapshot.fields["deformation_gradient"][:, 0, 1])
        assert (F[:, 1] != F[:, 3]).any()


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_every_array_of_the_index_after_a_move(read, dim, dtype, tmp_path):
    simulation = simulate(dim)
    record(simulation, tmp_path / "here", 3e-3, Recording(snapshots=EverySteps(1), dtype=dtype))
    (tmp_path / "here").rename(tmp_path / "there")
    run = Run(tmp_path / "there")
    held = read(tmp_path / "there" / "run.vtkhdf")
    assert held["times"].tolist() == run.times.tolist() and len(run) >= 3
    for k, frame in enumerate(run):
        same(held, k, frame.x, {name: frame[name] for name in frame.units if name != "x"}, frame.time, frame.step)


def test_an_index_over_changing_numbers_of_particles(read, tmp_path):
    writer, sizes = SnapshotWriter(tmp_path, fields=["velocity", "deformation_gradient"]), [5, 6, 4, 4, 7]
    for step, n in enumerate(sizes):
        x, volume = box((0.0, 0.0), (1.0, 1.0), 1.0 / n)
        body = es.Body(x=x, volume=volume, material=es.NeoHookean(density=1.0, young=1.0, poisson=0.3), velocity=x)
        simulation = es.Simulation(body)
        simulation.stepper.steps = step
        writer.write(simulation)
    writer.finish()
    held = read(writer.index)
    for k, (frame, n) in enumerate(zip(Run(tmp_path), sizes, strict=True)):
        assert n**2 == frame.N
        same(held, k, frame.x, {"velocity": frame.v, "deformation_gradient": frame.F}, 0.0, k)


def test_a_lost_snapshot_reads_as_not_a_number(read, tmp_path):
    record(simulate(2), tmp_path, 3e-3, Recording(snapshots=EverySteps(1)))
    Run(tmp_path)[2].path.unlink()
    held = read(tmp_path / "run.vtkhdf")
    for k in range(len(Run(tmp_path))):
        assert np.isnan(held[f"{k}/points"]).all() == (k == 2)
        assert (held[f"{k}/point/body"] == -1).all() == (k == 2)
