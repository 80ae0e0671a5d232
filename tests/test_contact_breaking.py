"""Contact of bodies that break: surfaces beside a crack, restart while it grows, and a container that bursts."""

import numpy as np
import pytest
import warp as wp
from touching import SOFT, bits, rectangle

import warp_eulsph as es
from warp_eulsph.interactions import Plane, RigidBody
from warp_eulsph.materials import Failing, PrincipalStrain
from warp_eulsph.scheme.health import WELL
from warp_eulsph.validation.cases import container

BRITTLE = Failing(material=SOFT, failure=PrincipalStrain(energy=1e3, strain=0.01))


def plates(columns=20, rows=4, h=0.1, **options):
    """A brittle plate under a whole one, a spacing apart from each other."""
    lower = es.Body(x=rectangle(columns, rows, h), volume=h * h, material=BRITTLE, name="lower", **options)
    x = rectangle(columns, rows, h, (0.0, rows * h))
    upper = es.Body(x=x, volume=h * h, material=SOFT, name="upper", velocity=(0.0, -1.0))
    return es.Simulation([lower, upper], interactions=[es.Contact()])


def test_a_crack_takes_the_normals_beside_it_and_changes_no_other():
    """So the energy of contacts elsewhere does not jump. Interior particles beside the crack come to the surface."""
    simulation = plates()
    simulation.step(3)
    contact, breaking = simulation.bound_interactions[0], simulation.stepper.media[0].breaking
    skin, U = contact.skin, simulation.stepper.U
    skin.want(skin._all)
    skin.look(U)
    normals, there = skin.normal.numpy().copy(), skin.there.numpy().copy()
    opened = np.flatnonzero(np.hypot(*(simulation.X[:80] - np.array([1.05, 0.35])).T) < 0.12)
    cut = breaking.cut.numpy()
    cut[opened] = 1
    breaking.cut.assign(cut)
    breaking._fresh.zero_()
    breaking._cut()
    stale = wp.zeros(1, dtype=wp.int32, device=breaking.cut.device)
    skin.tell(stale)
    assert stale.numpy()[0] == 1
    skin.find()
    skin.want(skin._all)
    skin.look(U)
    frayed = breaking.frayed.numpy().astype(bool)  # of both bodies, which are one medium
    far = np.min(np.linalg.norm(simulation.X[:80, None] - simulation.X[opened], axis=2), axis=1)
    np.testing.assert_array_equal(frayed[:80], far < 2.0 * 1.3 * 0.1)  # those whose support reached what was cut
    found, now = skin.normal.numpy(), skin.there.numpy()
    assert not frayed[80:].any()
    frayed = frayed[skin.indices]
    assert (found[frayed] == 0.0).all() and (now[frayed] == 1).all() and (there[frayed] == 0).any()
    assert np.array_equal(found[~frayed], normals[~frayed]) and np.array_equal(now[~frayed], there[~frayed])


def test_fragments_bounce_off_a_rigid_wall():
    """Particles that were let go and those of new surfaces alike; what is torn in flight has the momentum it had."""
    h = 0.1
    x = rectangle(20, 4, h, (-1.0, 0.3))
    v = np.stack([4.0 * x[:, 0], np.full(len(x), -10.0)], axis=1)
    body = es.Body(x=x, volume=h * h, material=BRITTLE, velocity=v, name="plate")
    simulation = es.Simulation(body, interactions=[RigidBody(Plane((0.0, 1.0)), name="wall")])
    start = simulation.energy()["total"]
    simulation.run(0.09)
    energy = simulation.energy()
    assert simulation.stepper.media[0].breaking.first.numpy()[0] != WELL
    assert simulation.stepper.media[0].breaking.cut.numpy().any()
    assert simulation.x[:, 1].min() > 0.25 * h and simulation.v[:, 1].mean() > 0.0
    assert abs(energy["interaction"]) < 0.01 * start and abs(energy["residual"]) < 1e-12 * start


def test_a_burst_goes_on_bit_for_bit_after_a_restart():
    def build():
        return container.build(20, 300.0)

    whole, resumed = build(), build()
    whole.step(25)
    assert whole.stepper.media[0].breaking.cut.numpy().any()
    arrays, counters = {name: array.numpy().copy() for name, array in whole.evolving().items()}, whole.counters
    resumed.step(4)
    resumed.restore(arrays, counters)
    cracks = whole.stepper.media[0].breaking.cut.numpy().sum()
    whole.step(40)
    resumed.step(40)
    assert whole.stepper.media[0].breaking.cut.numpy().sum() > cracks  # new surfaces after the restart
    assert bits(resumed) == bits(whole)


@pytest.mark.parametrize("speed", container.SPEEDS)
def test_a_container_bursts_with_closed_books(speed):
    found = container.found_at(20, speed)
    assert found["missing"] < 1e-12 and found["residual"] < 1e-12
    # Planes through particles that came apart made it 0.3 to 1200 times the energy, from nothing
    assert -0.06 < found["account"] < 0.005
    assert 0.8 < found["momentum"] < 1.1 and found["failed"] > 0.05


def test_halves_of_a_cracked_bar_touch_what_a_crack_let_go():
    """Four columns of one bar are let go; its halves, which feel nobody across, fly at these and bounce off."""
    h, speed = 0.1, 1.0
    x = rectangle(20, 4, h, (-1.0, 0.0))
    v = np.stack([-speed * np.sign(x[:, 0]), np.zeros(len(x))], axis=1)
    loose = abs(x[:, 0]) < 2.1 * h
    v[loose] = 0.0
    tough = Failing(material=SOFT, failure=PrincipalStrain(energy=1e9, strain=1.0))
    simulation = es.Simulation(
        es.Body(x=x, volume=h * h, material=tough, velocity=v, name="bar"), interactions=[es.Contact()]
    )
    breaking = simulation.stepper.media[0].breaking
    breaking.cut.assign(loose.astype(np.int32))
    breaking._fresh.zero_()
    breaking._cut()
    start, held, gaps = simulation.energy()["total"], 0.0, []
    left, right = x[:, 0] < -2.1 * h, x[:, 0] > 2.1 * h
    for _ in simulation.frames(np.linspace(0.005, 0.1, 20)):
        held = max(held, simulation.energy()["held"])
        gaps.append((simulation.x[right, 0].min() - simulation.x[left, 0].max()) / h)
    energy = simulation.energy()
    assert held > 0.01 * start and min(gaps) > 1.0
    assert simulation.v[left, 0].mean() < -0.2 * speed and simulation.v[right, 0].mean() > 0.2 * speed
    assert abs(energy["interaction"]) < 0.01 * start and abs(energy["residual"]) < 1e-12 * start
    assert np.abs(simulation.momentum()).max() < 1e-11 * simulation.particles.mass.numpy().sum() * speed
