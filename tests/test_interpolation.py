"""Values at points of a run that is read back: exact for linear fields, told where there is no matter."""

import numpy as np
import pytest
import warp as wp
from bodies import COMPRESSIBLE

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.output import Recording, Run, SnapshotWriter, points_on_line, record
from warp_eulsph.output.shape_functions import shape_functions

SPACING = 0.2


def block(dim, shift=0.0, **options):
    """A unit block of jittered particles."""
    x, volume = box((0.0,) * dim, (1.0,) * dim, SPACING, jitter=0.2)
    return es.Body(x=x + shift, volume=volume, material=COMPRESSIBLE, **options)


def frame_of(simulation, directory, **options):
    """The present state of a simulation, written and read back."""
    SnapshotWriter(directory, dtype=np.float64, **options).write(simulation)
    return Run(directory)[-1]


def deform(simulation, F):
    """Put the particles where a homogeneous deformation takes them."""
    U, x = simulation.stepper.U, simulation.x
    U.x.assign(x @ F.T)
    U.F.assign(np.broadcast_to(F, (len(x), *F.shape)))


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("weight", [es.CubicSpline(), es.WendlandC4()], ids=["cubic", "C4"])
def test_linear_fields_are_exact_in_the_present_configuration(dim, weight, tmp_path):
    rng = np.random.default_rng(dim)
    A, F = rng.normal(size=(dim, dim)), np.eye(dim) + 0.2 * rng.uniform(-1, 1, (dim, dim))
    simulation = es.Simulation(block(dim), weight=weight)
    deform(simulation, F)
    simulation.stepper.U.v.assign(3.0 + simulation.x @ A.T)
    frame = frame_of(simulation, tmp_path)
    points = rng.uniform(0.0, 1.0, (200, dim)) @ F.T
    assert frame.interpolate(points, "x") == pytest.approx(points, abs=1e-13)
    assert frame.interpolate(points, "velocity") == pytest.approx(3.0 + points @ A.T, abs=1e-12)
    stress = frame.interpolate(points, "cauchy_stress")
    assert stress.shape == (200, 3, 3) and stress == pytest.approx(frame.cauchy_stress[:1].repeat(200, 0), rel=1e-11)
    mises = frame.interpolate(points, "von_mises")
    assert mises.shape == (200,) and mises == pytest.approx(frame.von_mises[0], rel=1e-9)


def test_shares_are_the_sums_written_out():
    """α (1 + β·(p − x_b)) V_b W(|p − x_b|, h_b), by hand in 1-D with the cubic spline."""
    rng = np.random.default_rng(3)
    x, volume = np.sort(rng.uniform(0, 1, 12))[:, None], rng.uniform(0.05, 0.1, 12)
    h = rng.uniform(0.12, 0.2, 12)
    p = 0.47
    q = np.abs(x[:, 0] - p) / h
    w = np.where(q < 1, 1 - 1.5 * q**2 + 0.75 * q**3, np.where(q < 2, 0.25 * (2 - q) ** 3, 0.0))
    VW = volume * w * 2 / (3 * h)
    S0, S1, S2 = (float((VW * (p - x[:, 0]) ** k).sum()) for k in range(3))
    beta = -S1 / S2
    wanted = VW * (1 + beta * (p - x[:, 0])) / (S0 + beta * S1)
    found = shape_functions(np.array([[p]]), x, volume, h, es.CubicSpline())
    assert found.particle.tolist() == np.flatnonzero(q < 2).tolist()
    assert found.share == pytest.approx(wanted[q < 2], rel=1e-12)


def test_many_points_go_block_by_block(tmp_path, monkeypatch):
    frame = frame_of(es.Simulation(block(2, velocity=[1.0, 2.0])), tmp_path)
    points = np.random.default_rng(0).uniform(0, 1, (10, 2))
    whole = frame.interpolate(points, "x")
    monkeypatch.setattr("warp_eulsph.output.reader._BLOCK", 4)
    assert np.array_equal(frame.interpolate(points, "x"), whole) and whole == pytest.approx(points, abs=1e-13)


def test_outside_is_not_a_number(tmp_path):
    frame = frame_of(es.Simulation(block(2)), tmp_path)
    points = np.array([[0.5, 0.5], [1.0, 1.0], [1.0 + 2 * SPACING, 0.5], [50.0, -1e9], [0.5, 0.3]])
    density = frame.interpolate(points, "density")
    assert np.isnan(density).tolist() == [False, False, True, True, False]
    assert density[[0, 1, 4]] == pytest.approx(1100.0, rel=1e-12)
    assert np.isnan(frame.interpolate(points, "velocity")[2]).all()
    assert np.isnan(frame.interpolate([[9.0, 9.0]], "velocity")).all()
    assert frame.interpolate(np.zeros((0, 2)), "velocity").shape == (0, 2)


def test_neighbours_in_a_row_do_not_span_a_plane():
    x = np.stack([np.arange(8.0), np.zeros(8)], axis=1)
    found = shape_functions(np.array([[3.5, 0.0]]), x, np.ones(8), np.full(8, 1.3), es.CubicSpline())
    assert not found.inside[0] and len(found.share) == 0


def test_bodies_of_very_different_resolution():
    """Whether neighbours span the space does not depend on the unit of length, nor on what else there is."""
    coarse, fine = box((0.0, 0.0), (8.0, 8.0), 1.0)[0], box((0.0, 0.0), (8.0, 8.0), 1.0)[0] * 1e-5 + [10.0, 0.0]
    x, h = np.concatenate([coarse, fine]), np.repeat([1.3, 1.3e-5], 64)
    body, points = np.repeat([0, 1], 64), np.array([[4.1, 4.2], [10.0 + 4.1e-5, 4.2e-5]])
    found = shape_functions(points, x, h**2, h, es.CubicSpline(), body=body)
    assert found.inside.all() and found.apply(x) == pytest.approx(points, abs=1e-13)


def test_only_the_nearest_body_counts(tmp_path):
    """Two blocks that touch and slide along each other: the velocity jumps where they touch and is exact beside it."""
    up, down = block(2, velocity=[0.0, 1.0], name="left"), block(2, [1.0, 0.0], velocity=[0.0, -1.0], name="right")
    frame = frame_of(es.Simulation([up, down]), tmp_path)
    found = frame.interpolate(points_on_line((0.05, 0.5), (1.95, 0.5), 39), "velocity")[:, 1]
    assert found[:18] == pytest.approx(1.0, abs=1e-13) and found[-18:] == pytest.approx(-1.0, abs=1e-13)
    assert np.abs(found) == pytest.approx(1.0, abs=1e-13)


def test_periodic_boxes_have_no_surface(tmp_path):
    x, volume = box((0.0, 0.0), (1.0, 1.0), 0.05)
    speed = np.sin(2 * np.pi * x[:, :1])
    body = es.Body(x=x, volume=volume, material=COMPRESSIBLE, velocity=speed * [0.0, 1.0], surface=0.0)
    simulation = es.Simulation(body, periodic=(1.0, 0.0))
    record(simulation, tmp_path, 1e-9, Recording(dtype=np.float64))
    points = points_on_line((-0.5, 0.5), (1.5, 0.5), 81)
    found = Run(tmp_path)[0].interpolate(points, "velocity")[:, 1]
    assert found == pytest.approx(np.sin(2 * np.pi * points[:, 0]), abs=0.04)  # h² |u''| / 2 is 0.08
    assert found[20:40] == pytest.approx(found[60:80], abs=1e-13) and found[:21] == pytest.approx(
        found[40:61], abs=1e-13
    )
    assert np.abs(found[20]) < 1e-12  # at the seam the sine is odd about it


def test_the_weight_is_that_of_the_run(tmp_path):
    simulation = es.Simulation(block(2, velocity=np.random.default_rng(0).normal(size=(25, 2))), weight=es.WendlandC4())
    record(simulation, tmp_path, 1e-9, Recording(dtype=np.float64))
    frame, points = Run(tmp_path)[0], np.array([[0.5, 0.47]])
    volume, h = frame["volume"], frame["smoothing_length"]
    by_hand = [
        shape_functions(points, frame.x, volume, h, w).apply(frame.v) for w in (es.WendlandC4(), es.CubicSpline())
    ]
    assert np.array_equal(frame.interpolate(points, "velocity"), by_hand[0])
    assert np.abs(by_hand[0] - by_hand[1]).max() > 1e-3


def test_frames_of_a_run_with_a_damaged_description_open(tmp_path):
    record(es.Simulation(block(2)), tmp_path, 1e-9)
    (tmp_path / "run.json").write_text("{")
    frame = Run(tmp_path)[0]
    assert frame.x.shape == (25, 2)
    with pytest.raises(ValueError, match=r"run\.json is damaged"):
        frame.interpolate([[0.5, 0.5]], "velocity")


def test_cells_find_the_neighbours_that_all_pairs_give():
    rng = np.random.default_rng(7)
    x, points = rng.normal(size=(300, 3)), rng.normal(size=(40, 3))
    found = shape_functions(points, x, np.ones(300), np.full(300, 0.35), es.WendlandC2())
    r = np.linalg.norm(points[:, None] - x[None], axis=2)
    i, b = np.nonzero((r < 0.7) & found.inside[:, None])
    assert found.point.tolist() == i.tolist() and found.particle.tolist() == b.tolist()
    assert found.inside.sum() > 10 and not found.inside[r.min(axis=1) >= 0.35].any()


def test_single_precision_runs_and_points_in_one_dimension(tmp_path):
    simulation = es.Simulation(block(1, velocity=2.0), dtype=wp.float32)
    SnapshotWriter(tmp_path).write(simulation)
    found = Run(tmp_path)[0].interpolate([0.1, 0.77], "velocity")
    assert found.shape == (2, 1) and found == pytest.approx(2.0, rel=1e-14)


def test_what_is_wrong_is_named(tmp_path):
    simulation = es.Simulation(block(2))
    frame = frame_of(simulation, tmp_path / "all")
    with pytest.raises(ValueError, match=r"points must be \(m, 2\) finite numbers \[m\], got shape \(3,\)"):
        frame.interpolate([0.1, 0.2, 0.3], "velocity")
    with pytest.raises(ValueError, match=r"finite numbers .* nan"):
        frame.interpolate([[0.1, np.nan]], "velocity")
    with pytest.raises(KeyError, match="holds no 'vellocity'"):
        frame.interpolate([[0.1, 0.2]], "vellocity")
    few = frame_of(simulation, tmp_path / "few", fields=["velocity", "body"])
    with pytest.raises(ValueError, match=r"it lacks \['volume', 'smoothing_length'\]; write snapshots with these"):
        few.interpolate([[0.1, 0.2]], "velocity")


def test_points_on_a_line():
    assert points_on_line((0, 1), (1, 3), 3).tolist() == [[0.0, 1.0], [0.5, 2.0], [1.0, 3.0]]
