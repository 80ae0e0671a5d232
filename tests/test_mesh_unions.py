"""Closed surfaces in one file that lie in each other, meet or are hollows; against volumes counted otherwise."""

import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import CUBE, brick, write, written

from warp_eulsph.geometry import Patch, mesh
from warp_eulsph.geometry.surface import read_surface
from warp_eulsph.geometry.union import united


def bricks_contain(x, boxes):
    """How many of the boxes each point lies in, (n,)."""
    return sum((((x > lower) & (x < upper)).all(axis=1)).astype(int) for lower, upper in boxes)


@pytest.mark.parametrize("offset", [(0.5, 0.0, 0.0), (0.5, 0.5, 0.5), (0.75, 0.25, 0.0), (0.0, 0.0, 0.0)])
def test_matter_that_two_closed_surfaces_enclose_counts_once(tmp_path, offset, caplog):
    """Two unit cubes: 2 less what they share; half apart along x it is 1.5."""
    other = (np.array(offset), np.array(offset) + 1.0)
    x, volume = mesh(written(tmp_path, CUBE, other), 1.0 / 16)
    shared = np.prod(1.0 - np.abs(offset))
    assert volume.sum() == pytest.approx(2.0 - shared, rel=1e-12)
    assert len(x) == round((2.0 - shared) * 16**3) and (bricks_contain(x, [CUBE, other]) > 0).all()
    assert ("closed surfaces lie in each other" in caplog.text) == any(offset)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(*[st.integers(0, 7)] * 3, *[st.integers(1, 6)] * 3), min_size=2, max_size=4), st.booleans())
def test_unions_have_the_volume_of_the_cells_that_any_brick_holds(tmp_path_factory, boxes, shifted):
    """Bricks on a lattice of integers, so that cells counted one by one are an independent volume."""
    corners = [(np.array(b[:3], dtype=float), np.array(b[:3], dtype=float) + b[3:]) for b in boxes]
    cells = np.stack(np.meshgrid(*[np.arange(14) + 0.5] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    right = (bricks_contain(cells, corners) > 0).sum()
    moved = [(lower + 100.3 * shifted, upper + 100.3 * shifted) for lower, upper in corners]
    surface = read_surface(written(tmp_path_factory.mktemp("union"), *moved))
    try:
        made = united(surface, "bricks")
    except ValueError as error:  # bricks that share an edge or corners hang together: said, never wrong
        assert "must not pass through itself" in str(error) or "border one other along each edge" in str(error)
        assert "repair=Repair(take=True)" in str(error)
        return
    assert made.volume == pytest.approx(right, rel=1e-9)
    inside = made.query(winding=0.5)(cells + 100.3 * shifted)[0] > 0.0
    assert inside.sum() == right


def test_one_inside_another_is_a_hollow_if_it_faces_inwards(tmp_path):
    inner, core = ((0.25,) * 3, (0.75,) * 3), ((0.375,) * 3, (0.625,) * 3)
    for boxes, inwards, right in (
        ((CUBE, inner), (), 1.0),  # the same sense: matter that is there twice is there once
        ((CUBE, inner), (1,), 1.0 - 0.125),
        ((CUBE, inner), (0,), 1.0 - 0.125),  # all of it inside out
        ((CUBE, inner, core), (1,), 1.0 - 0.125 + 0.25**3),  # a core in the hollow
        ((CUBE, inner, core), (1, 2), 1.0 - 0.125),
        ((CUBE, inner, ((0.5, 0.25, 0.25), (2.0, 0.75, 0.75))), (1,), 1.0 + 0.25 - 0.125 / 2),  # half filled by a third
        ((CUBE, ((2, 0, 0), (3, 1, 1))), (), 2.0),
        ((CUBE, ((1, 0, 0), (2, 0.5, 0.5))), (), 1.25),  # touching, cut otherwise
    ):
        x, volume = mesh(written(tmp_path, *boxes, inwards=inwards), 1.0 / 16)
        assert volume.sum() == pytest.approx(right, rel=1e-12), (boxes, inwards)
        assert len(x) == round(right * 16**3)
    with pytest.raises(ValueError, match="nor face inwards where there is no matter"):
        mesh(written(tmp_path, CUBE, ((2, 0, 0), (3, 0.5, 1)), inwards=(1,)), 0.125)
    with pytest.raises(ValueError, match="must be a hollow within one that faces outwards"):
        mesh(written(tmp_path, CUBE, ((0.5, 0.25, 0.25), (1.5, 0.5, 0.5)), inwards=(1,)), 0.125)


def test_regions_on_a_union_know_no_surface_within_it(tmp_path):
    file = written(tmp_path, CUBE, ((0.5, 0.0, 0.0), (1.5, 1.0, 1.0)))
    x, _ = mesh(file, 0.125)
    outside = np.minimum(x, [1.5, 1.0, 1.0] - x).min(axis=1) < 0.125
    np.testing.assert_array_equal(Patch(file, 0.124)(x), outside)


def test_a_surface_that_passes_through_itself_is_refused(tmp_path):
    points, triangles = brick(*CUBE)
    points[points[:, 2] == 1.0, 0] = 0.75 - 0.5 * points[points[:, 2] == 1.0, 0]  # the top turned inside out
    with pytest.raises(ValueError, match="must not pass through itself"):
        mesh(write(tmp_path / "pulled.vtk", points, triangles), 0.1)


def test_pieces_that_meet_need_manifold3d(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "manifold3d", None)
    assert len(mesh(written(tmp_path, CUBE, ((2, 0, 0), (3, 1, 1))), 0.25)[0]) == 128
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'warp_eulsph\[mesh\]'"):
        mesh(written(tmp_path, CUBE, ((0.5, 0, 0), (1.5, 1, 1))), 0.25)
