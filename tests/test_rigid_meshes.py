"""Rigid bodies from mesh files, against the shapes that they are meshes of."""

import itertools

import numpy as np
import pytest
import warp as wp
from bodies import block
from test_rigid import rigid
from test_rigid_shapes import distance_of

import warp_eulsph as es
from warp_eulsph.interactions import Box, Free, RigidBody, TriangleMesh
from warp_eulsph.interactions.rigid_motion import rotation_matrix
from warp_eulsph.interactions.triangle_mesh import mass_properties

pytest.importorskip("meshio")
SIDES = np.array([0.6, 0.3, 0.2])


def box_file(path, place=(0.0, 0.0, 0.0), R=np.eye(3), sides=SIDES):
    """A box of twelve triangles about ``place``, as OBJ."""
    corners = (np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * sides) @ R.T + place
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [three for a, b, c, d in faces for three in ((a, b, c), (a, c, d))]
    lines = [f"v {x:.17g} {y:.17g} {z:.17g}" for x, y, z in corners]
    lines += ["f " + " ".join(str(k + 1) for k in three) for three in triangles]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_distances_are_those_of_the_box(tmp_path):
    """To round-off on faces, whose planes are in double precision; at edges as the places found on them."""
    place, R = np.array([3.0, -2.0, 1.0]), rotation_matrix(np.array([0.3, -0.8, 0.5]))
    of_mesh, of_box = TriangleMesh(box_file(tmp_path / "a.obj", place, R)), Box(SIDES)
    rng = np.random.default_rng(1)
    for x in rng.uniform(-0.6, 0.6, (60, 3)):
        expected = distance_of(of_box, 3, x)
        found = distance_of(of_mesh, 3, R @ x + place)
        depths = np.sort(0.5 * SIDES - np.abs(x))
        if depths[0] > 0.0 and depths[1] - depths[0] < 1e-3:
            continue  # two faces are as near
        assert found[3] == pytest.approx(expected[3], abs=1e-12 if (depths > 0.0).sum() > 1 else 1e-7)
        np.testing.assert_allclose(R.T @ found[:3], expected[:3], atol=1e-6)


def test_mass_properties():
    """Of a cube between 0 and 2, turned: volume 8, centre, moments 2/3; and of the box, along its sides."""
    R = rotation_matrix(np.array([0.1, 0.7, -0.4]))
    corners = np.array(list(itertools.product((0.0, 2.0), repeat=3))) @ R.T
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([three for a, b, c, d in faces for three in ((a, b, c), (a, c, d))])
    volume, centre, moments, axes = mass_properties(corners[triangles])
    assert volume == pytest.approx(8.0, rel=1e-13)
    np.testing.assert_allclose(centre, R @ [1.0, 1.0, 1.0], rtol=1e-13)
    np.testing.assert_allclose(moments, 2.0 / 3.0, rtol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)


@pytest.mark.parametrize("dtype", [wp.float64, wp.float32])
def test_a_thrown_mesh_goes_as_the_box(tmp_path, dtype):
    """A corner first, onto a block: the same path and spin, by double precision to that of the search."""
    R, start = np.array([0.5, 0.6, 0.0]), np.array([0.5, 0.5, 1.4])
    motion = Free(density=2000.0, velocity=(0.0, 0.5, -5.0), spin=(3.0, 1.0, 0.0))
    place = np.array([0.2, 0.1, -0.3])
    by_file = TriangleMesh(box_file(tmp_path / "a.obj", place))
    centre = start - rotation_matrix(R) @ place
    found = []
    for option in (RigidBody(Box(SIDES), start, R, motion), RigidBody(by_file, centre, R, motion)):
        simulation = es.Simulation(block(3, 6), interactions=[option], dtype=dtype)
        body, pushed = rigid(simulation), 0.0
        assert body.motion.inverse_mass == pytest.approx(1.0 / 72.0)
        np.testing.assert_allclose(body.x, start, rtol=1e-12)
        for _ in range(40):
            simulation.step(4)
            pushed = max(pushed, np.linalg.norm(body.force))
        assert pushed > 1e3
        found.append(np.concatenate([body.x, body.v, body.spin, body.angular_momentum, body.R.ravel()]))
    np.testing.assert_allclose(found[1], found[0], atol=1e-4)


def test_mistakes_are_told(tmp_path):
    with pytest.raises(ValueError, match="is for 3-D, got bodies in 2-D"):
        es.Simulation(block(2, 4), interactions=[RigidBody(TriangleMesh("any.stl"))])
    path = box_file(tmp_path / "open.obj", (5.0, 0.0, 0.0))
    path.write_text("\n".join(path.read_text().splitlines()[:-1]) + "\n")
    with pytest.raises(ValueError, match="surface must be closed"):
        es.Simulation(block(3, 4), interactions=[RigidBody(TriangleMesh(path))])
    with pytest.raises(FileNotFoundError):
        es.Simulation(block(3, 4), interactions=[RigidBody(TriangleMesh(tmp_path / "none.stl"))])
