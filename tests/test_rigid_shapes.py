"""Shapes of rigid bodies, what they weigh, and what is said of those that do not fit."""

import numpy as np
import pytest
import warp as wp
from bodies import block

import warp_eulsph as es
from warp_eulsph.interactions import Box, Cylinder, Driven, Free, Plane, RigidBody, Sphere


@pytest.mark.parametrize(
    ("shape", "dim", "place", "normal", "distance"),
    [
        (Plane((0.0, 2.0)), 2, (3.0, 0.5), (0.0, 1.0), 0.5),
        (Sphere(1.0), 3, (0.0, 0.0, -1.5), (0.0, 0.0, -1.0), 0.5),
        (Sphere(1.0), 1, (0.75,), (1.0,), -0.25),
        (Box((2.0, 4.0)), 2, (1.3, 0.5), (1.0, 0.0), 0.3),
        (Box((2.0, 4.0)), 2, (1.3, -2.4), (0.6, -0.8), 0.5),
        (Box((2.0, 4.0)), 2, (0.5, 1.9), (0.0, 1.0), -0.1),
        (Box((2.0, 2.0, 2.0)), 3, (2.0, 3.0, 3.0), (1 / 3, 2 / 3, 2 / 3), 3.0),
        (Cylinder(1.0, 2.0), 3, (0.0, 1.3, 0.2), (0.0, 1.0, 0.0), 0.3),
        (Cylinder(1.0, 2.0), 3, (1.3, 0.0, 1.4), (0.6, 0.0, 0.8), 0.5),
        (Cylinder(1.0, 2.0), 3, (0.2, 0.0, -0.95), (0.0, 0.0, -1.0), -0.05),
        (Cylinder(1.0, 4.0, axis=(1.0, 0.0, 0.0)), 3, (1.8, 0.0, 1.25), (0.0, 0.0, 1.0), 0.25),
    ],
)
def test_distances(shape, dim, place, normal, distance):
    found = distance_of(shape, dim, place)
    np.testing.assert_allclose(found, [*normal, *[0.0] * (3 - dim), distance], atol=1e-12)


def distance_of(shape, dim, place):
    """Normal and distance [m] at a place in the frame that the user gave, (4,)."""
    from warp_eulsph.interactions.shapes import Numbers, Triangles

    solid, function = shape.solid(dim, "cpu"), shape.distance

    @wp.kernel(module="unique", enable_backward=False)
    def ask(p: wp.vec3d, numbers: Numbers, triangles: Triangles, out: wp.array(dtype=wp.vec4d)):
        out[0] = function(p, numbers, triangles)

    p = np.zeros(3)
    p[:dim] = place
    out = wp.zeros(1, dtype=wp.vec4d, device="cpu")
    local = solid.axes.T @ (p - solid.home)
    numbers = Numbers(*[*solid.numbers, *[0.0] * 6][:6])
    wp.launch(ask, 1, [wp.vec3d(*local), numbers, solid.triangles, out], device="cpu")
    found = out.numpy()[0]
    return np.concatenate([solid.axes @ found[:3], found[3:]])


def test_moments_of_inertia():
    """Against sums over a fine lattice in each shape."""
    grid = (np.indices((60, 60, 60)).reshape(3, -1).T + 0.5) / 30.0 - 1.0
    inside = {
        Sphere(0.9): np.linalg.norm(grid, axis=1) < 0.9,
        Box((1.0, 1.6, 0.8)): (np.abs(grid) < [0.5, 0.8, 0.4]).all(axis=1),
        Cylinder(0.7, 1.2): (np.hypot(grid[:, 0], grid[:, 1]) < 0.7) & (np.abs(grid[:, 2]) < 0.6),
    }
    for shape, chosen in inside.items():
        square = (grid[chosen] ** 2).mean(axis=0)
        solid = shape.solid(3, "cpu")
        np.testing.assert_allclose(np.sort(solid.inertia), np.sort(square.sum() - square), rtol=0.01)
        assert solid.volume == pytest.approx(chosen.sum() / 30.0**3, rel=0.01)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Free(), "needs either a mass or a density, got neither"),
        (lambda: Free(mass=1.0, density=2.0), "got both"),
        (lambda: Free(mass=-1.0), "mass must be positive and finite, got -1"),
        (lambda: Sphere(0.0), "Sphere: radius must be positive"),
        (lambda: Box((1.0, -1.0)), "Box: sides must be positive"),
        (lambda: built(RigidBody(Plane((0.0, 1.0)), motion=Free(mass=1.0))), "a plane without end cannot move freely"),
        (lambda: built(RigidBody(Plane((0.0, 0.0)))), "Plane: normal must be"),
        (
            lambda: built(RigidBody(Plane((0.0, 1.0)), centre=(0.0, 0.3), name="table")),
            "rigid body 'table': bodies must",
        ),
        (lambda: built(RigidBody(Sphere(0.3), centre=(0.5, 0.5))), "particles of .'body'. inside, the deepest"),
        (lambda: built(RigidBody(Plane((0.0, 1.0)), bodies=["bodi"])), "body must be one of"),
        (lambda: built(RigidBody(Box((1.0, 1.0, 1.0)))), "sides must be 2 lengths in 2-D"),
        (lambda: built(RigidBody(Cylinder(1.0, 1.0))), "is for 3-D"),
        (lambda: built(RigidBody(Plane((0.0, 1.0)), centre=(0.0,))), "centre must be 2 numbers"),
        (
            lambda: built(RigidBody(Sphere(1.0), centre=(9.0, 0.0), rotation=(0.0, 0.0, 1.0))),
            "rotation must be 1 numbers",
        ),
        (lambda: built(RigidBody(Sphere(1.0), hollow=True, motion=Free(mass=1.0))), "a hollow one has no mass"),
        (lambda: built(RigidBody(Plane((0.0, 1.0)), motion=Driven((1.0, 0.0)))), "must be a function"),
    ],
)
def test_mistakes_are_told(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def built(option):
    return es.Simulation(block(2, 6), interactions=[option])
