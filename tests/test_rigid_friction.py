"""Friction on rigid bodies: blocks that slide, stick and are dragged along."""

import numpy as np
import pytest
from bodies import RUBBER
from test_rigid import bits, rigid

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.interactions import Box, Free, Moving, Plane, RigidBody

G, ANGLE = 9.81, np.radians(30.0)
FORMS = {
    "default": {},
    "Eulerian": {"arrangement": es.Current()},
    "Lax-Wendroff": {"scheme": es.LaxWendroff(), "reference": es.Never()},
    "3-D": {"dim": 3},
}


def on_incline(friction, dim=2, **options):
    """A block of rubber on a plane, whose weight comes on within 0.1 s, so that it does not bounce."""
    x, volume = box(lower=(0.0,) * dim, upper=(1.0,) * (dim - 1) + (0.5,), spacing=0.1 if dim == 2 else 0.125)
    weight, normal = np.zeros(dim), np.zeros(dim)
    weight[0], weight[-1], normal[-1] = G * np.sin(ANGLE), -G * np.cos(ANGLE), 1.0
    body = es.Body(x=x, volume=volume, material=RUBBER)
    plane = RigidBody(Plane(normal), friction=friction)
    pull = es.BodyForce(lambda x, t: weight * min(t / 0.1, 1.0))
    return es.Simulation(body, boundaries=[pull], interactions=[plane], **options)


@pytest.mark.parametrize("form", FORMS)
def test_a_block_slides_with_friction(form):
    """The centre's acceleration is g (sin − μ cos): over 0.2 s, in which it also swings, to 2 %."""
    simulation = on_incline(0.3, **FORMS[form])
    simulation.run(0.12)
    before = simulation.v[:, 0].mean()
    simulation.run(0.32)
    found = (simulation.v[:, 0].mean() - before) / 0.2
    assert found == pytest.approx(G * (np.sin(ANGLE) - 0.3 * np.cos(ANGLE)), rel=0.02)
    force = rigid(simulation).force
    # by Coulomb, but for what goes sideways as the block swings
    assert force[0] == pytest.approx(-0.3 * force[-1], rel=5e-3)
    energy = simulation.energy()
    assert energy["interaction"] < -0.3 * energy["external"]  # what rubbing takes
    assert abs(energy["residual"]) < 1e-12 * energy["external"]


@pytest.mark.parametrize("form", FORMS)
def test_a_block_sticks_without_creep(form):
    """Below the angle of friction it shears, and slips as its weight comes on, a hundredth of a spacing, and stays."""
    simulation = on_incline(0.7, **FORMS[form])
    simulation.run(0.12)
    moved = [simulation.displacement[:, 0].mean() for _ in simulation.frames(np.linspace(0.14, 0.52, 20))]
    assert 1e-4 < np.mean(moved) < 1e-3
    assert np.mean(moved[10:]) - np.mean(moved[:10]) < 2e-6


@pytest.mark.parametrize("share", [0.3, 0.5], ids=["sticks", "slides"])
def test_a_rigid_box_is_pulled_over_a_block(share):
    """By a share of its weight, at μ = 0.4: it stays, or moves with the rest of the force; it does not turn over."""
    x, volume = box(lower=(0.0, 0.0), upper=(3.0, 0.5), spacing=0.1)
    block = es.Body(x=x, volume=volume, material=es.LinearElastic(density=1000.0, young=1e7, poisson=0.3))
    motion = Free(mass=100.0, gravity=G, force=(share * 100.0 * G, 0.0))
    sledge = RigidBody(Box((1.0, 0.4)), centre=(1.0, 0.7), friction=0.4, motion=motion)
    base = es.Fixed(lambda X: X[:, 1] < 0.1)
    simulation = es.Simulation(block, boundaries=[base], interactions=[sledge])
    body, speeds = rigid(simulation), []
    for time in simulation.frames(np.linspace(0.2, 0.4, 9)):
        speeds.append(body.v[0] / time)
    if share < 0.4:
        assert abs(body.x[0] - 1.0) < 1e-3
    else:  # it hops a little, and turns with it
        assert np.mean(speeds) == pytest.approx((share - 0.4) * G, rel=0.05)
    assert abs(body.R[0, 1]) < 0.03
    assert abs(simulation.energy()["residual"]) < 1e-10


def test_a_belt_takes_a_block_along():
    """While it slides it has μ times the impulse of the normal forces, exactly; then it moves with the belt."""
    x, volume = box(lower=(0.0, 0.0), upper=(1.0, 0.5), spacing=0.1)
    belt = RigidBody(Plane((0.0, 1.0)), friction=0.5, motion=Moving((1.0, 0.0)))
    body = es.Body(x=x, volume=volume, material=RUBBER)
    simulation = es.Simulation(body, boundaries=[es.Gravity()], interactions=[belt])
    simulation.run(0.1)
    along, up = simulation.v.mean(axis=0)
    assert along == pytest.approx(0.5 * (G * 0.1 + up), rel=1e-3)  # sheared elastically as it begins to touch
    simulation.run(1.0)
    assert simulation.v[:, 0].mean() == pytest.approx(1.0, rel=0.05)  # it swings and hops a little


def test_resumed_friction_goes_on_bit_for_bit():
    whole, resumed = on_incline(0.7), on_incline(0.7)
    whole.step(60)
    arrays, counters = {name: array.numpy().copy() for name, array in whole.evolving().items()}, whole.counters
    resumed.step(4)
    resumed.restore(arrays, counters)
    whole.step(20)
    resumed.step(20)
    assert bits(resumed) == bits(whole)


def test_a_coefficient_that_is_none_is_told():
    with pytest.raises(ValueError, match=r"friction must be 0 or more and finite, got -0\.1"):
        RigidBody(Plane((0.0, 1.0)), friction=-0.1)
