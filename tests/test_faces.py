"""Traction and Pressure on faces: the whole force for any region that names the face, and words where it is unclear."""

import numpy as np
import pytest
import warp as wp
from bodies import COMPRESSIBLE
from loads import external, forces_of

import warp_eulsph as es
from warp_eulsph.geometry import BodyCentred, Relaxation, Staggered, box, disc, nodes, sphere

REGIONS = {  # of a unit box with n across
    "one layer": lambda n: lambda X: X[:, 0] > 1 - 1 / n,
    "three layers": lambda n: lambda X: X[:, 0] > 1 - 3 / n,
    "half": lambda n: lambda X: X[:, 0] > 0.5,
}


@pytest.mark.parametrize("region", REGIONS.values(), ids=REGIONS)
@pytest.mark.parametrize(("dim", "n", "jitter"), [(1, 8, 0.0), (2, 6, 0.0), (2, 12, 0.1), (2, 6, 0.2), (3, 8, 0.1)])
def test_any_region_that_names_a_face_gives_the_whole_force(dim, n, jitter, region):
    cube = box((0,) * dim, (1,) * dim, 1 / n, jitter=jitter, seed=n)
    along, force = np.eye(dim)[0], np.arange(1.0, dim + 1)
    held = region(n)
    np.testing.assert_allclose(forces_of(cube, es.Traction(force, along, held)).sum(axis=0), force, rtol=1e-13)
    np.testing.assert_allclose(forces_of(cube, es.Pressure(2.0, held)).sum(axis=0), -2.0 * along, atol=1e-13)
    alone = forces_of(cube, es.Pressure(2.0, held, normal=along))
    np.testing.assert_allclose(alone.sum(axis=0), -2.0 * along, atol=1e-13)
    assert not alone[:, 1:].any()  # particles at edges and corners too


def test_one_layer_and_the_whole_surface_load_in_the_same_distribution():
    square = box((0, 0), (1, 1), 1 / 16)
    layer, whole = forces_of(square, es.Pressure(1.0, REGIONS["one layer"](16))), forces_of(square, es.Pressure(1.0))
    # a column of a body that is thick enough: the outermost particle has more than its share, those beneath less
    middle = (square[0][:, 0] > 0.5) & (np.abs(square[0][:, 1] - 0.5) < 1 / 16)
    np.testing.assert_allclose(layer[middle], whole[middle], atol=1e-14)
    assert -layer[middle][-1, 0] * 16 == pytest.approx(1.589, abs=1e-3)


@pytest.mark.parametrize("n", [6, 9, 12])
def test_an_l_shaped_block_has_its_faces(n):
    x, volume = box((0, 0, 0), (6, 6, 1.5), 6 / n)
    x = x[~((x[:, 0] > 3) & (x[:, 1] > 3))]
    force = forces_of((x, volume), es.Traction((0.0, 1.0, 0.0), (0, 1, 0))).sum(axis=0)
    np.testing.assert_allclose(force, (0.0, 9.0, 0.0), rtol=1e-13)


@pytest.mark.parametrize("filling", [Staggered(), BodyCentred()], ids=repr)
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_faces_across_other_fillings(filling, axis):
    cube, along = box((0, 0, 0), (1, 1, 1), 1 / 16, filling=filling), np.eye(3)[axis]
    force = forces_of(cube, es.Pressure(1.0, lambda X: X @ along > 0.92, normal=along)).sum(axis=0)
    np.testing.assert_allclose(force, -along, atol=2.5e-3 if (filling, axis) == (Staggered(), 1) else 1e-13)


@pytest.mark.parametrize("shell", [False, True], ids=["half", "layer"])
@pytest.mark.parametrize(
    ("shape", "area", "tolerance"),
    [
        (disc((0, 0), 1, 0.05, relaxation=Relaxation()), 2.0, 0.01),
        (disc((0, 0), 1, 0.05), 2.0, 0.012),  # whose steps are of that size
        (sphere((0, 0, 0), 1, 1 / 12, relaxation=Relaxation()), np.pi, 0.01),
        (sphere((0, 0, 0), 1, 1 / 12), np.pi, 0.015),
    ],
    ids=["disc", "cut disc", "sphere", "cut sphere"],
)
def test_curved_faces(shape, area, tolerance, shell):
    for n in np.eye(shape[0].shape[1])[0], np.arange(1.0, 1.0 + shape[0].shape[1]):
        n = n / np.linalg.norm(n)
        least = 0.88 if shell else 0.0

        def region(X, n=n, least=least):
            return (X @ n > 0) & (np.linalg.norm(X, axis=1) > least)

        pressure = -forces_of(shape, es.Pressure(1.0, region)).sum(axis=0) @ n
        assert pressure == pytest.approx(area, rel=tolerance)
        traction = forces_of(shape, es.Traction(n, n, region)).sum(axis=0) @ n
        assert traction == pytest.approx(area, rel=tolerance)
        everywhere = forces_of(shape, es.Traction(n, n)).sum(axis=0) @ n
        assert everywhere == pytest.approx(area, rel=tolerance)


def test_a_turned_box_needs_no_normal():
    x, volume = box((0, 0), (1, 1), 0.1)
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    force = forces_of((x @ turn.T, volume), es.Pressure(1.0, x[:, 0] > 0.9)).sum(axis=0)
    np.testing.assert_allclose(force, -turn[:, 0], atol=1e-13)


def test_true_area_vectors_are_taken_as_they_are():
    x, volume, surface = nodes((0, 0), (1, 2), 0.1)
    body = es.Body(x=x, volume=volume, material=COMPRESSIBLE, surface=surface)
    for condition in (
        es.Pressure(1.0, lambda X: X[:, 0] > 0.95, normal=(1, 0)),
        es.Pressure(1.0, lambda X: X[:, 0] > 0.95),
        es.Traction((-1.0, 0.0), (1, 0), lambda X: X[:, 0] > 0.5),
    ):
        forces = external(es.Simulation(body, boundaries=[condition], reference=es.Never()))
        np.testing.assert_allclose(forces.sum(axis=0), (-2.0, 0.0), atol=1e-13)
        assert not forces[x[:, 0] < 0.95].any()


@pytest.mark.parametrize("condition", [es.Pressure(1e5, lambda X: X[:, 0] > 0.9), None], ids=["region", "normal"])
def test_pressure_follows_the_face(condition):
    """Nanson's rule: the force of a body that is turned, stretched and sheared by A is p cof(A) n."""
    condition = condition or es.Pressure(1e5, lambda X: X[:, 0] > 0.5, normal=(1, 0, 0))
    x, volume = box((0, 0, 0), (1, 1, 1), 1 / 8)
    simulation = es.Simulation(es.Body(x=x, volume=volume, material=COMPRESSIBLE), boundaries=[condition])
    A = np.array([[0.9, -0.5, 0.1], [0.6, 1.1, 0.0], [0.0, 0.3, 1.2]])
    cofactor = np.linalg.det(A) * np.linalg.inv(A).T
    U = simulation.stepper.U
    U.F.assign(np.broadcast_to(A, (len(x), 3, 3)))
    U.surface.assign(U.surface.numpy() @ cofactor.T)
    np.testing.assert_allclose(external(simulation).sum(axis=0), -1e5 * cofactor[:, 0], rtol=1e-12)


@pytest.mark.parametrize("reference", [es.Never(), es.Every(3), es.Always()], ids=repr)
@pytest.mark.parametrize(("dtype", "closes"), [(wp.float64, 1e-11), (wp.float32, 2e-4)])
def test_books_close_under_loads_on_faces(reference, dtype, closes):
    x, volume = box((0, 0), (1, 0.6), 0.1, jitter=0.1)
    conditions = [
        es.Clamped((0, 0), (-1, 0)),
        es.Pressure(1e5, lambda X: X[:, 1] > 0.5),
        es.Traction((2e5, 1e5), (1, 0), lambda X: X[:, 0] > 0.9),
    ]
    body = es.Body(x=x, volume=volume, material=COMPRESSIBLE)
    simulation = es.Simulation(body, boundaries=conditions, reference=reference, dtype=dtype)
    simulation.step(60)
    energy = simulation.energy()
    assert energy["external"] > 0.0
    assert abs(energy["residual"]) <= closes * energy["external"]
    assert abs(energy["constraint"]) <= closes * energy["external"]


def test_a_load_varies_along_the_face():
    """The value is that of the outermost particle, whatever the depth of the column."""
    cube = box((0, 0), (1, 1), 0.1)
    forces = forces_of(cube, es.Traction(lambda x, t: x * (0, 1.0), (1, 0), lambda X: X[:, 0] > 0.9))
    np.testing.assert_allclose(forces.sum(axis=0), (0.0, 0.5), atol=1e-14)
    top = np.zeros(100)
    top[9::10] = 3.0  # of one particle each
    forces = forces_of(cube, es.Pressure(top[cube[0][:, 1] > 0.9], lambda X: X[:, 1] > 0.9))
    held = np.count_nonzero(top[cube[0][:, 1] > 0.9])
    np.testing.assert_allclose(forces.sum(axis=0), (0.0, -3.0 * held / 10), atol=1e-14)


def test_ghosts_carry_no_load():
    x, volume = box((0, 0), (1, 1), 0.1)
    body, wall = es.mirror(
        es.Body(x=x, volume=volume, material=COMPRESSIBLE), point=(0, 0), normal=(0, -1), depth=5.2 * 0.1
    )
    simulation = es.Simulation(body, boundaries=[wall, es.Traction((1.0, 0.0), (1, 0), lambda X: X[:, 0] > 0.9)])
    np.testing.assert_allclose(external(simulation).sum(axis=0), (1.0, 0.0), rtol=1e-13)


def test_two_bodies_have_a_face_each():
    x, volume = box((0, 0), (1, 1), 0.1)
    bodies = [es.Body(x=x + 2.0 * k, volume=volume, material=COMPRESSIBLE, name=str(k)) for k in range(2)]
    simulation = es.Simulation(bodies, boundaries=[es.Traction((1.0, 0.0), (1, 0))])
    np.testing.assert_allclose(external(simulation)[:100].sum(axis=0), (1.0, 0.0), rtol=1e-13)
    np.testing.assert_allclose(external(simulation)[100:].sum(axis=0), (1.0, 0.0), rtol=1e-13)


def test_unclear_regions_are_named(caplog):
    square = box((0, 0), (1, 1), 0.1)
    forces_of(
        square, es.Pressure(1.0, lambda X: X[:, 0] > 0.9), es.Pressure(1.0, lambda X: X[:, 1] < 0.35, None, (0, -1))
    )
    assert not caplog.text
    forces_of(square, es.Pressure(1.0, lambda X: X[:, 0] > 0.7))
    assert "whole of the faces along (1, 0) and parts of those along" in caplog.text
    caplog.clear()
    forces_of(square, es.Traction((1.0, 0.0), (1, 0), lambda X: (X[:, 0] > 0.9) & (np.abs(X[:, 1] - 0.45) > 0.01)))
    assert "leaves out 1 outermost particles between those it holds" in caplog.text
    caplog.clear()
    forces_of(square, es.Traction((1.0, 0.0), (1, 0), lambda X: X[:, 0] + X[:, 1] > 1.1))  # cut along a diagonal
    assert not caplog.text
    forces_of(square, es.Traction((1.0, 0.0), (1, 0), lambda X: np.hypot(X[:, 0] - 0.75, X[:, 1] - 0.5) < 0.28))
    assert "beneath ones it leaves out" in caplog.text


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        (es.Traction((1.0, 0.0), (1, 0), lambda X: X[:, 0] < 0.5), r"along \(1, 0\), it holds none of the body's 10; "),
        (
            es.Pressure(1.0, lambda X: np.abs(X - 0.5).max(axis=1) < 0.3),
            "outermost particles of the body, it holds none",
        ),
        (es.Pressure(1.0, lambda X: X[:, 0] > 0.9, normal=(-1, 0)), r"lie at -0.05 to -0.05 m.*sign of the normal"),
        (es.Pressure(1.0, normal=(0, 0)), "Pressure: normal must be"),
        (es.Clamped((0.2, 0), (-1, 0)), "Clamped: the plane must close the body, got 10 particles"),
        (es.Clamped((-0.2, 0), (-1, 0)), "Clamped: the plane must lie within 1.5 spacings .* 0.25 m away"),
        (es.Clamped((0, 0, 0), (-1, 0)), r"Clamped: point must be \(2,\) finite numbers"),
        (es.Clamped((0, 0), (1, 0)), "Clamped: the plane must close the body"),
    ],
)
def test_errors(condition, message):
    with pytest.raises(ValueError, match=message):
        forces_of(box((0, 0), (1, 1), 0.1), condition)
