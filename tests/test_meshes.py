"""Mesh files as bodies and regions: surfaces in 3-D, outlines in 2-D."""

import numpy as np
import pytest
from surfaces import angle_profile, brick, write

from warp_eulsph.geometry import (
    BodyCentred,
    Lattice,
    Patch,
    Relaxation,
    Staggered,
    mesh,
    outline,
)

FILLINGS = [Lattice(), BodyCentred(), Staggered()]


def nearest(x):
    """Distance from each particle to its nearest neighbour, (n,)."""
    from scipy.spatial import cKDTree

    return cKDTree(x).query(x, 2)[0][:, 1]


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "vtk", "vtu", "msh"])
def test_concave_mesh_is_filled_with_its_volume(tmp_path, suffix):
    options = {"msh": {"file_format": "gmsh22"}}.get(suffix, {})
    file = write(tmp_path / f"angle.{suffix}", *angle_profile(), **options)
    x, volume = mesh(file, 0.05)
    # The lattice of 20³ cells fits the angle exactly: three quarters of it are inside, none in the notch.
    assert len(x) == 6000 and volume.sum() == pytest.approx(0.75, rel=1e-6)
    np.testing.assert_allclose(np.unique(np.round(x[:, 2], 6)), (np.arange(20) + 0.5) / 20, atol=1e-6)
    assert not ((x[:, 0] > 0.5) & (x[:, 1] > 0.5)).any()


@pytest.mark.parametrize("filling", FILLINGS, ids=lambda f: type(f).__name__)
def test_every_filling_of_a_mesh(tmp_path, filling):
    file = write(tmp_path / "angle.vtk", *angle_profile())
    for relaxation in (None, Relaxation(sweeps=20)):
        x, volume = mesh(file, 0.1, filling=filling, relaxation=relaxation)
        assert volume.sum() == pytest.approx(0.75, rel=1e-12)
        assert len(x) == pytest.approx(750, rel=0.1)
        assert x.min() > 0.0 and x.max() < 1.0 and not ((x[:, 0] > 0.5) & (x[:, 1] > 0.5)).any()


def test_triangles_may_all_face_inwards_and_lengths_be_millimetres(tmp_path):
    points, triangles = angle_profile()
    file = write(tmp_path / "inwards.vtk", 1e3 * points, triangles[:, ::-1])
    x, volume = mesh(file, 0.1, scale=1e-3)
    assert volume.sum() == pytest.approx(0.75, rel=1e-12) and x.max() < 1.0


def test_tetrahedra_and_a_patch_of_gmsh(tmp_path):
    import meshio

    points, triangles = brick((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    cut = np.array([[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]])
    meshio.Mesh(points, [("tetra", cut)]).write(tmp_path / "tetrahedra.vtk")
    x, volume = mesh(tmp_path / "tetrahedra.vtk", 0.25)
    assert len(x) == 64 and volume.sum() == pytest.approx(1.0, rel=1e-12)
    # The first two triangles are the face x = 0, here a physical group with a name, the others a second group.
    groups = np.array([7, 7] + [8] * 10)
    meshio.Mesh(
        points,
        [("triangle", triangles)],
        cell_data={"gmsh:physical": [groups], "gmsh:geometrical": [groups]},
        field_data={"clamp": np.array([7, 2])},
    ).write(tmp_path / "groups.msh", file_format="gmsh22")
    np.testing.assert_array_equal(Patch(tmp_path / "groups.msh", 0.2, "clamp")(x), x[:, 0] < 0.25)
    np.testing.assert_array_equal(Patch(tmp_path / "groups.msh", 0.2, "8")(x).sum(), 64 - 2 * 2 * 3)
    assert Patch(tmp_path / "groups.msh", 0.2)(x).sum() == 64 - 8
    with pytest.raises(ValueError, match=r"patch of the mesh must be one of \['8', 'clamp'\], got 'clmp'"):
        Patch(tmp_path / "groups.msh", 0.2, "clmp")(x)


def test_bad_meshes_are_named(tmp_path):
    points, triangles = angle_profile()
    with pytest.raises(ValueError, match=r"surface must be closed .* got 3 edges .* first at \["):
        mesh(write(tmp_path / "open.vtk", points, triangles[1:]), 0.1)
    turned = np.concatenate([triangles[:1, ::-1], triangles[1:]])
    with pytest.raises(ValueError, match="turn the same way"):
        mesh(write(tmp_path / "turned.vtk", points, turned), 0.1)
    closed = write(tmp_path / "closed.vtk", points, triangles)
    with pytest.raises(ValueError, match=r"too coarse|at least one cell"):
        mesh(closed, 0.9)
    with pytest.raises(FileNotFoundError, match=r"nowhere\.stl"):
        mesh(tmp_path / "nowhere.stl", 0.1)
    (tmp_path / "noise.stl").write_bytes(b"no mesh")
    with pytest.raises(ValueError, match=r"noise\.stl: "):
        mesh(tmp_path / "noise.stl", 0.1)
    import meshio

    meshio.Mesh(points, [("line", np.array([[0, 1]]))]).write(tmp_path / "lines.vtk")
    with pytest.raises(ValueError, match=r"must have triangles, quadrangles or tetrahedra, got cells \['line'\]"):
        mesh(tmp_path / "lines.vtk", 0.1)


def test_missing_meshio_is_named(tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'warp_eulsph\[mesh\]'"):
        mesh(tmp_path / "a.stl", 0.1)


# outlines

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)


def loops(*outlines):
    """Corners (k, 3) and lines of closed outlines."""
    points = np.concatenate(outlines)
    first = np.cumsum([0, *(len(o) for o in outlines)])
    lines = [
        np.stack([np.arange(len(o)), np.roll(np.arange(len(o)), -1)], axis=1) + f
        for o, f in zip(outlines, first[:-1], strict=True)
    ]
    return np.pad(points, ((0, 0), (0, 1))), np.concatenate(lines)


def write_lines(path, points, lines, **options):
    import meshio

    meshio.Mesh(points, [("line", lines)], **options.pop("mesh", {})).write(path, **options)
    return path


@pytest.mark.parametrize("suffix", ["vtk", "vtu", "msh", "obj"])
@pytest.mark.parametrize("turned", [False, True])
def test_square_with_a_square_hole(tmp_path, suffix, turned):
    """Whichever way the outlines turn, what lies in the hole is outside."""
    import meshio

    hole = 0.25 + 0.5 * SQUARE
    points, lines = loops(SQUARE, hole[::-1] if turned else hole)
    options = {"msh": {"file_format": "gmsh22"}}.get(suffix, {})
    file = tmp_path / f"hole.{suffix}"
    if suffix == "obj":  # which meshio writes faces to only
        corners = np.concatenate([points[:4], points[4:]])
        quads = [[k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k] for k in range(4)]
        if turned:
            corners[4:] = corners[4:][::-1]
        meshio.Mesh(corners, [("quad", quads)]).write(file)
    else:
        write_lines(file, points, lines, **options)
    x, volume = outline(file, 0.05)
    assert len(x) == 300 and volume.sum() == pytest.approx(0.75, rel=1e-12)
    assert not (np.abs(x - 0.5).max(axis=1) < 0.25).any()


@pytest.mark.parametrize("filling", FILLINGS, ids=lambda f: type(f).__name__)
def test_gear_is_filled_and_relaxed_with_its_area(tmp_path, filling):
    angle = np.linspace(0, 2 * np.pi, 240, endpoint=False)
    radius = 1.0 + 0.2 * np.sin(6 * angle)
    rim = np.stack([3 + radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    x1, y1 = np.roll(rim, -1, axis=0).T
    area = 0.5 * np.sum(rim[:, 0] * y1 - x1 * rim[:, 1])
    file = write_lines(tmp_path / "gear.vtk", *loops(1e3 * rim))
    for relaxation in (None, Relaxation(sweeps=60)):
        x, volume = outline(file, 0.07, scale=1e-3, filling=filling, relaxation=relaxation)
        assert volume.sum() == pytest.approx(area, rel=1e-12) and len(x) == pytest.approx(area / 0.07**2, rel=0.06)
        r, phi = np.hypot(x[:, 0] - 3, x[:, 1]), np.arctan2(x[:, 1], x[:, 0] - 3)
        beneath = 1.0 + 0.2 * np.sin(6 * phi) - r
        assert beneath.min() > (-1e-3 if relaxation is None else 0.2 * 0.07)
    assert nearest(x).min() > 0.75 * 0.07


def test_flat_triangles_and_named_lines_of_gmsh(tmp_path):
    """Area of the triangles; lines inside them, and their names, are regions but no edges."""
    import meshio

    points = np.array([[0, 0, 5], [2, 0, 5], [2, 1, 5], [0, 1, 5], [1, 0.5, 5]], dtype=float)
    triangles = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    lines = np.array([[3, 0], [0, 4]])
    tags = [np.full(4, 1), np.array([7, 8])]
    meshio.Mesh(
        points,
        [("triangle", triangles), ("line", lines)],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"clamp": np.array([7, 1])},
    ).write(tmp_path / "plate.msh", file_format="gmsh22")
    x, volume = outline(tmp_path / "plate.msh", 0.1)
    assert len(x) == 200 and volume.sum() == pytest.approx(2.0, rel=1e-12)
    np.testing.assert_array_equal(Patch(tmp_path / "plate.msh", 0.12, "clamp")(x), x[:, 0] < 0.12)
    s = np.clip((x @ [1.0, 0.5]) / 1.25, 0.0, 1.0)
    near = np.linalg.norm(x - s[:, None] * [1.0, 0.5], axis=1) <= 0.06
    np.testing.assert_array_equal(Patch(tmp_path / "plate.msh", 0.06, "8")(x), near)
    assert Patch(tmp_path / "plate.msh", 0.06)(x).sum() == 200 - 18 * 8
    with pytest.raises(ValueError, match=r"patch of the mesh must be one of \['8', 'clamp'\], got 'clmp'"):
        Patch(tmp_path / "plate.msh", 0.2, "clmp")(x)
    with pytest.raises(ValueError, match="needs particles in 2-D or 3-D"):
        Patch(tmp_path / "plate.msh", 0.2)(x[:, :1])


def test_thin_wedges_keep_all_particles_inside(tmp_path):
    """Where a shape is thinner than particles are put beneath one side, they do not come out on the other."""
    wedge = np.array([[0, 0], [3, -0.15], [3, 0.15]])
    x, volume = outline(write_lines(tmp_path / "wedge.vtk", *loops(wedge)), 0.06, relaxation=Relaxation(sweeps=50))
    assert volume.sum() == pytest.approx(0.45, rel=1e-12)
    assert (np.abs(x[:, 1]) <= 0.05 * x[:, 0] + 1e-6).mean() > 0.97


def test_bad_outlines_are_named(tmp_path):
    points, lines = loops(SQUARE)
    with pytest.raises(ValueError, match=r"outline must be closed, got 2 loose ends, the first at \["):
        outline(write_lines(tmp_path / "open.vtk", points, lines[1:]), 0.1)
    bow = loops(SQUARE[[0, 2, 1, 3]])
    with pytest.raises(ValueError, match="must not cross itself, it does at y from 0 to 1 m"):
        outline(write_lines(tmp_path / "bow.vtk", *bow), 0.1)
    with pytest.raises(ValueError, match="must lie in a plane of constant z, got z over 1 m"):
        outline(write(tmp_path / "angle.vtk", *angle_profile()), 0.1)
    with pytest.raises(ValueError, match="must enclose an area"):
        outline(write_lines(tmp_path / "flat.vtk", *loops(SQUARE * [1, 0])), 0.1)
    import meshio

    meshio.Mesh(points, [("vertex", np.array([[0]]))]).write(tmp_path / "dots.vtk")
    with pytest.raises(ValueError, match=r"must have triangles, quadrangles or lines, got cells \['vertex'\]"):
        outline(tmp_path / "dots.vtk", 0.1)


def test_outlines_in_a_case_file(tmp_path):
    from warp_eulsph.cases import parse_case

    write_lines(tmp_path / "plate.vtk", *loops(SQUARE))
    data = {
        "until": 1,
        "body": {
            "a": {
                "shape": {"kind": "outline", "file": "plate.vtk", "spacing": 0.125},
                "material": {"kind": "NeoHookean", "density": 1, "young": 1, "poisson": 0},
            }
        },
        "boundary": [{"kind": "Fixed", "region": {"file": "plate.vtk", "depth": 0.1}}],
    }
    case = parse_case(data, directory=tmp_path)
    assert case.dim == 2 and len(case.build().conditions[0].indices) == 64 - 36
