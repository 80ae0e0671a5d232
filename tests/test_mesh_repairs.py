"""Surfaces that are open, turned, split or of one side: refused with what mends them, and mended on demand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import CUBE, brick, write, written

from warp_eulsph.geometry import Repair, mesh
from warp_eulsph.geometry.faces import weld
from warp_eulsph.geometry.repair import turned_alike


def test_openings_are_closed_on_demand(tmp_path, caplog):
    points, triangles = brick(*CUBE)
    for gone in ([0], [0, 1], [0, 5], [3, 4, 7], [0, 1, 2, 3]):
        file = write(tmp_path / "open.vtk", points, np.delete(triangles, gone, axis=0))
        with pytest.raises(ValueError, match=r"at an opening.*mend it by repair=Repair\(close=True\)"):
            mesh(file, 0.125)
        caplog.clear()
        x, volume = mesh(file, 0.125, repair=Repair(close=True))
        whole = gone != [0, 1, 2, 3] and gone != [3, 4, 7]  # rims in a plane give back what was there
        assert "closed, the widest of" in caplog.text and len(x)
        if whole:
            assert volume.sum() == pytest.approx(1.0, rel=1e-12) and len(x) == 512
        assert 0.5 < volume.sum() <= 1.0 + 1e-12
    pipe = np.array([[np.cos(a), np.sin(a), z] for z in (0, 2) for a in 2 * np.pi * np.arange(40) / 40])
    sides = [t for k in range(40) for t in ([k, (k + 1) % 40, k + 40], [(k + 1) % 40, (k + 1) % 40 + 40, k + 40])]
    both = np.concatenate([pipe, pipe * [0.5, 0.5, 1.0]]), np.concatenate([sides, np.array(sides)[:, ::-1] + 80])
    _, volume = mesh(write(tmp_path / "pipe.vtk", *both), 0.1, repair=Repair(close=True))
    area = 0.5 * 40 * np.sin(2 * np.pi / 40)
    assert volume.sum() == pytest.approx(2.0 * area * (1.0 - 0.25), rel=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, 11), min_size=1, max_size=12, unique=True), st.booleans())
def test_facets_that_face_the_wrong_way_are_turned_on_demand(tmp_path_factory, flipped, split):
    points, triangles = brick(*CUBE)
    triangles[flipped] = triangles[flipped][:, ::-1]
    if split:
        points, triangles = points[triangles].reshape(-1, 3), np.arange(36).reshape(-1, 3)
    file = write(tmp_path_factory.mktemp("flip") / "flip.vtk", points, triangles)
    if len(flipped) < 12:
        with pytest.raises(ValueError, match=r"mend it by repair=Repair\(turn=True\)"):
            mesh(file, 0.25)
    x, volume = mesh(file, 0.25, repair=Repair(turn=True))
    assert volume.sum() == pytest.approx(1.0, rel=1e-12) and len(x) == 64


def test_a_surface_can_be_taken_as_it_is(tmp_path):
    points, triangles = brick(*CUBE)
    for surface in ((points, np.delete(triangles, 3, axis=0)), (points, np.delete(triangles, 3, axis=0)[:, ::-1])):
        x, volume = mesh(write(tmp_path / "open.vtk", *surface), 0.0625, repair=Repair(take=True))
        assert volume.sum() == pytest.approx(1.0, rel=0.15) and ((x > 0) & (x < 1)).all()
    for second, right in (((0.5, 0, 0), (1.5, 1, 1)), 1.5), (((0.25,) * 3, (0.75,) * 3), 1.0):
        file = written(tmp_path, CUBE, second)
        assert mesh(file, 0.0625, repair=Repair(take=True))[1].sum() == pytest.approx(right, rel=1e-12)
    with pytest.raises(ValueError, match="0 particles would have to hold what is inside"):
        mesh(write(tmp_path / "sheet.vtk", points, triangles[[0, 2]]), 0.25, repair=Repair(take=True))


def test_a_band_of_one_side_is_refused():
    band = np.array([[k, k + 1, k + 2] for k in range(8)] + [[8, 9, 1], [9, 1, 0]])
    with pytest.raises(ValueError, match="one side only"):
        turned_alike(np.random.default_rng(0).random((10, 3)), band, "band")


def test_the_tolerance_of_welding_can_be_said(tmp_path):
    points, triangles = brick(*CUBE)
    split = points[triangles].reshape(-1, 3), np.arange(36).reshape(-1, 3)
    file = write(tmp_path / "split.vtk", split[0] + 1e-4 * np.random.default_rng(0).uniform(-1, 1, (36, 3)), split[1])
    with pytest.raises(ValueError, match=r"where corners miss each other by repair=Repair\(weld=\.\.\.\)"):
        mesh(file, 0.125)
    x, volume = mesh(file, 0.125, repair=Repair(weld=1e-3))
    assert volume.sum() == pytest.approx(1.0, rel=1e-3) and len(x) == 512
    near = split[0] + 1e-8 * np.random.default_rng(0).uniform(-1, 1, (36, 3))
    file = write(tmp_path / "near.vtk", near, split[1])
    assert len(mesh(file, 0.125)[0]) == 512
    with pytest.raises(ValueError, match="must be closed"):
        mesh(file, 0.125, repair=Repair(weld=0.0))
    with pytest.raises(ValueError, match=r"weld must be a length \[m\], at least 0, got -1"):
        Repair(weld=-1.0)
    with pytest.raises(ValueError, match="without"):
        mesh(file, 0.125, repair=Repair(weld=5.0))


def test_welding_joins_what_is_near_and_nothing_else():
    rng = np.random.default_rng(0)
    apart = np.stack(np.meshgrid(*[np.arange(6.0)] * 3), axis=-1).reshape(-1, 3)
    points = np.concatenate([apart, apart + 1e-3 * rng.uniform(-0.5, 0.5, apart.shape)])
    assert np.array_equal(weld(points, 1e-3)[:216], weld(points, 1e-3)[216:])
    assert len(np.unique(weld(points, 1e-3))) == 216 and len(np.unique(weld(points, 0.0))) == 432
    line = np.zeros((5000, 3))
    line[:, 0] = np.linspace(0.0, 1.0, 5000)  # spaced by 200 times the tolerance: a chain of none
    assert len(np.unique(weld(line, 1e-6))) == 5000
