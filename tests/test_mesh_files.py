"""Meshes as other programs write them: repeated, split, jittered, merged, of second order; against known volumes."""

import itertools

import meshio
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import brick, write

from warp_eulsph.geometry import Patch, mesh, outline
from warp_eulsph.geometry.faces import SOLIDS, outer_triangles
from warp_eulsph.geometry.surface import Surface, read_surface
from warp_eulsph.geometry.union import united

sides = st.tuples(*[st.floats(0.3, 3.0)] * 3)
MUTATIONS = ["split", "shuffle", "turn", "twice", "jitter", "rotate", "unused"]


def mutated(points, triangles, names, rng):
    """The same surface, written otherwise."""
    for name in names:
        if name == "split":  # every facet by itself, as STL has them
            points, triangles = points[triangles].reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)
        elif name == "shuffle":
            order = rng.permutation(len(points))
            points, triangles = points[order], np.argsort(order)[triangles][rng.permutation(len(triangles))]
        elif name == "turn":
            triangles = triangles[:, ::-1]
        elif name == "twice":
            triangles = np.concatenate([triangles, triangles[rng.integers(0, len(triangles), 3)]])
        elif name == "rotate":
            triangles = np.array([np.roll(corners, rng.integers(3)) for corners in triangles])
        elif name == "unused":
            points = np.concatenate([points, 100.0 + rng.random((5, 3))])
        else:  # as rounded to single precision, facet by facet
            points = points + 2e-8 * np.ptp(points[np.unique(triangles)], axis=0).max() * rng.uniform(
                -1, 1, points.shape
            )
    return points, triangles


@settings(max_examples=60, deadline=None)
@given(sides, st.lists(st.sampled_from(MUTATIONS), max_size=5), st.integers(0, 10**6))
def test_a_brick_keeps_its_volume_however_it_is_written(tmp_path_factory, lengths, names, seed):
    rng = np.random.default_rng(seed)
    corner = rng.uniform(-5.0, 5.0, 3)
    points, triangles = mutated(*brick(corner, corner + lengths), names, rng)
    file = write(tmp_path_factory.mktemp("brick") / "brick.vtk", points, triangles)
    surface = read_surface(file)
    surface.check_closed("brick")
    surface = united(surface, "brick")
    assert len(surface.triangles) == 12 and len(np.unique(surface.triangles)) == 8
    assert abs(surface.volume) == pytest.approx(np.prod(lengths), rel=1e-6)


@settings(max_examples=25, deadline=None)
@given(sides, st.floats(0.3, 3.0), st.lists(st.sampled_from(MUTATIONS), max_size=3), st.integers(0, 10**6))
def test_solids_that_share_a_face_are_one(tmp_path_factory, lengths, more, names, seed):
    rng = np.random.default_rng(seed)
    a, b = np.array(lengths), np.array([more, *lengths[1:]])
    pieces = [brick(np.zeros(3), a), brick(np.array([a[0], 0.0, 0.0]), np.array([a[0], 0.0, 0.0]) + b)]
    points = np.concatenate([points for points, _ in pieces])
    triangles = np.concatenate([triangles + 8 * k for k, (_, triangles) in enumerate(pieces)])
    # The faces they share are cut along the same diagonal only if both are the same triangles
    surface = read_surface(write(tmp_path_factory.mktemp("two") / "two.vtk", *mutated(points, triangles, names, rng)))
    surface.check_closed("two")
    surface = united(surface, "two")
    assert abs(surface.volume) == pytest.approx(np.prod(a) + np.prod(b), rel=1e-6)


def solid(kind):
    """Corners and cells of a unit cube of solid elements."""
    cube = np.array(list(itertools.product((0.0, 1.0), repeat=3)))[[0, 4, 6, 2, 1, 5, 7, 3]]  # as VTK numbers them
    plain = kind.rstrip("0123456789")
    if plain == "hexahedron":
        points, cells = cube, [list(range(8))]
    elif plain == "wedge":
        points, cells = cube, [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]
    elif plain == "pyramid":
        points = np.concatenate([cube, [[0.5, 0.5, 0.5]]])
        cells = [[*face[::-1], 8] for face in SOLIDS["hexahedron"]]
    else:
        points, cells = cube, [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]
    if kind == plain:
        return points, np.array(cells)
    from warp_eulsph.geometry.faces import _EDGES

    numbers, middle = {}, list(points)
    full = []
    for cell in cells:
        nodes = list(cell)
        for a, b in _EDGES[plain]:
            key = frozenset((cell[a], cell[b]))
            if key not in numbers:
                numbers[key] = len(middle)
                middle.append(0.5 * (points[cell[a]] + points[cell[b]]))
            nodes.append(numbers[key])
        full.append(nodes)
    return np.array(middle), np.array(full)


KINDS = ["tetra", "tetra10", "pyramid", "pyramid13", "wedge", "wedge15", "hexahedron", "hexahedron20"]


@pytest.mark.parametrize("kind", KINDS)
def test_solid_elements_of_both_orders_have_their_outer_faces(kind, tmp_path):
    points, cells = solid(kind)
    surface = Surface(points, outer_triangles(points, {kind: cells}), {})
    surface.check_closed(kind)
    assert surface.volume == pytest.approx(1.0, rel=1e-12)
    if kind in ("pyramid13", "wedge15"):  # which meshio cannot hold
        return
    meshio.Mesh(points, [(kind, cells)]).write(tmp_path / "solid.vtu")
    turned = cells.copy()
    if kind == "hexahedron":
        turned = cells[:, [4, 5, 6, 7, 0, 1, 2, 3]]
    elif kind == "tetra":
        turned = cells[:, [0, 2, 1, 3]]
    triangles = outer_triangles(points + 1e4, {kind: turned})
    assert Surface(points, triangles, {}).volume == pytest.approx(1.0, rel=1e-12)  # outwards even so
    x, volume = mesh(tmp_path / "solid.vtu", 0.25)
    assert len(x) == 64 and volume.sum() == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(("kind", "corners"), [("triangle6", 3), ("quad", 4), ("quad8", 4)])
def test_surfaces_of_second_order_follow_their_midside_nodes(kind, corners, tmp_path):
    points, triangles = brick((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    cells, places, numbers = (triangles.tolist() if corners == 3 else quads), list(points), {}
    if kind != "quad":
        full = []
        for cell in cells:
            for a, b in zip(cell, [*cell[1:], cell[0]], strict=True):
                if frozenset((a, b)) not in numbers:
                    numbers[frozenset((a, b))] = len(places)
                    places.append(0.5 * (points[a] + points[b]))
            full.append([*cell, *(numbers[frozenset(e)] for e in zip(cell, [*cell[1:], cell[0]], strict=True))])
        cells = full
    meshio.Mesh(np.array(places), [(kind, np.array(cells))]).write(tmp_path / "surface.vtu")
    surface = read_surface(tmp_path / "surface.vtu")
    surface.check_closed(kind)
    assert surface.volume == pytest.approx(1.0, rel=1e-12)


def test_a_tetrahedral_mesh_with_one_surface_group_is_closed_and_groups_go_by_dimension(tmp_path):
    points, cells = solid("tetra")
    clamp = np.array([[0, 4, 7], [0, 7, 3]])  # of x = 0
    meshio.Mesh(
        points,
        [("triangle", clamp), ("tetra", cells)],
        cell_data={
            "gmsh:physical": [np.array([1, 1]), np.ones(6, dtype=int)],
            "gmsh:geometrical": [np.array([1, 1]), np.ones(6, dtype=int)],
        },
        field_data={"clamp": np.array([1, 2]), "solid": np.array([1, 3])},
    ).write(tmp_path / "part.msh", file_format="gmsh22")
    x, volume = mesh(tmp_path / "part.msh", 0.25)
    assert len(x) == 64 and volume.sum() == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_array_equal(Patch(tmp_path / "part.msh", 0.2, "clamp")(x), x[:, 0] < 0.25)
    with pytest.raises(ValueError, match=r"must be one of \['clamp'\], got 'solid'"):
        Patch(tmp_path / "part.msh", 0.2, "solid")(x)


OBJ = """
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
v 1 1 1
v 0 1 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vt 0.5 0.1
vt 0.5 0.2
vt 0.5 0.3
vt 0.5 0.4
vt 0.5 0.5
vt 0.5 0.6
f 1/1 4/2 3/3 2/4
f 5/5 6/6 7/7 8/8
f 1/9 2/10 6/1 5/2
f 2/1 3/2 7/3 6/4
f 3/1 4/2 8/3 7/4
f 4/1 1/2 5/3 8/4
"""


def test_files_that_meshio_cannot_read_are_read_otherwise(tmp_path, capfd):
    import trimesh

    (tmp_path / "textured.obj").write_text(OBJ)
    made = trimesh.Trimesh(*brick((0, 0, 0), (1, 1, 1)), process=False)
    made.visual.vertex_colors = np.full((8, 4), 200, dtype=np.uint8)
    for ending in ("ply", "off", "glb", "stl"):
        made.export(tmp_path / f"part.{ending}")
    for name in ("textured.obj", "part.ply", "part.off", "part.glb", "part.stl"):
        x, volume = mesh(tmp_path / name, 0.25)
        assert len(x) == 64 and volume.sum() == pytest.approx(1.0, rel=1e-6), name
    said = capfd.readouterr()
    assert "meshio" not in said.err + said.out and "Warning" not in said.err + said.out


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("empty.stl", b"solid nothing\nendsolid nothing\n"),
        ("zero.stl", b"\0" * 84),
        ("none.stl", b""),
        ("part.obj", b"v 0 0 0\n"),
        ("part.ply", b"ply\nformat ascii 1.0\nend_header\n"),
        ("part.msh", b"nothing"),
        ("part.xyz", b"1 2 3"),
    ],
)
def test_files_without_a_mesh_are_refused(tmp_path, name, content, capfd):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=r"not a mesh that meshio reads|must have"):
        mesh(tmp_path / name, 0.1)
    said = capfd.readouterr()
    assert not said.out and "Error" not in said.err


def test_outlines_of_second_order_and_with_corners_that_miss_each_other(tmp_path):
    angle = 2 * np.pi * np.arange(12) / 12
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)  # corners and midside nodes in turn
    area = 0.5 * 12 * np.sin(2 * np.pi / 12)
    curved = np.array([[2 * k, (2 * k + 2) % 12, 2 * k + 1] for k in range(6)])
    hexagon = [("triangle6", np.array([[0, 4, 8, 2, 6, 10]])), ("line3", curved)]
    for cells in ([("line3", curved)], hexagon[:1]):
        meshio.Mesh(rim, cells).write(tmp_path / "curved.vtu")
        x, volume = outline(tmp_path / "curved.vtu", 0.1)
        right = area if cells[0][0] == "line3" else 0.5 * 6 * np.sin(2 * np.pi / 6)
        assert volume.sum() == pytest.approx(right, rel=1e-12) and len(x) == pytest.approx(right / 0.01, rel=0.05)
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    for apart, tolerance, whole in ((1e-8, None, True), (1e-8, 0.0, False), (1e-3, None, False), (1e-3, 1e-2, True)):
        ends = np.concatenate([square, np.roll(square, -1, axis=0) + np.array([apart, 0.0, 0.0])])
        lines = np.array([[k, k + 4] for k in range(4)])
        meshio.Mesh(ends, [("line", lines)]).write(tmp_path / "apart.vtk")
        if whole:
            assert outline(tmp_path / "apart.vtk", 0.25, weld=tolerance)[1].sum() == pytest.approx(1.0, rel=2e-3)
        else:
            with pytest.raises(ValueError, match=r"8 loose ends.*join them by weld=\.\.\."):
                outline(tmp_path / "apart.vtk", 0.25, weld=tolerance)
