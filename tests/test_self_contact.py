"""A body that touches itself: bars of one body, a notch that closes, a ring that is crushed, in 2-D and 3-D."""

import numpy as np
import pytest
import warp as wp
from bodies import lattice
from touching import C_P, SOFT, bar, rectangle

import warp_eulsph as es
from warp_eulsph.geometry import annulus
from warp_eulsph.interactions import Driven, Plane, RigidBody


def two_bars(as_one):
    """100 particles each, four spacings apart, the left one at 0.01 of the wave speed."""
    left, right = bar(100, 0.0, 1.0, 1.0, velocity=0.01, name="left"), bar(100, 1.04, 1.0, 1.0, name="right")
    if not as_one:
        return [left, right]
    v = np.repeat([[0.01], [0.0]], 100, axis=0)
    return es.Body(x=np.concatenate([left.x, right.x]), volume=0.01, material=left.material, velocity=v, name="both")


def test_two_bars_of_one_body_hit_like_two_bodies():
    found = []
    for as_one in (True, False):
        simulation = es.Simulation(two_bars(as_one), interactions=[es.Contact()])
        start, momentum = simulation.energy()["total"], simulation.momentum()
        simulation.run(5.0)
        held = simulation.energy()["held"]
        simulation.run(6.5)
        energy = simulation.energy()
        assert held > 0.0 and energy["held"] == 0.0
        assert [simulation.v[:100].mean() / 0.01, simulation.v[100:].mean() / 0.01] == pytest.approx(
            [0.0, 1.0], abs=0.02
        )
        assert -0.003 * start < energy["interaction"] <= 0.0 and abs(energy["residual"]) < 1e-12 * start
        np.testing.assert_allclose(simulation.momentum(), momentum, rtol=1e-12)
        found.append((simulation.x, simulation.v, held))
    for one, two in zip(*found, strict=True):
        np.testing.assert_array_equal(one, two)


def fork(dim, legs=6, velocity=0.0):
    """Two legs, three cells wide and four apart, on a foot; the legs fly at each other."""
    h = 0.1
    deep = {2: 1, 3: 4}[dim]
    flat = rectangle(10, legs + 3, h)
    x = flat[(flat[:, 1] < 3 * h) | (abs(flat[:, 0] - 5 * h) > 2 * h)]
    if dim == 3:
        x = np.concatenate([np.insert(x, 1, (k + 0.5) * h, axis=1) for k in range(deep)])
    v = np.zeros_like(x)
    v[:, 0] = -velocity * np.sign(x[:, 0] - 5 * h) * np.maximum(x[:, -1] - 3 * h, 0.0) / (legs * h)
    return es.Body(x=x, volume=h**dim, material=SOFT, velocity=v, name="fork")


@pytest.mark.parametrize("dim", [2, 3])
def test_nothing_acts_at_the_start_and_forces_are_slopes(dim):
    simulation = es.Simulation(fork(dim), interactions=[es.Contact()])
    contact, world = simulation.bound_interactions[0], simulation.stepper
    assert simulation.energy()["held"] == 0.0
    random, X = np.random.default_rng(3), simulation.x
    x = X + random.uniform(-0.01, 0.01, X.shape)
    x[:, 0] -= np.sign(X[:, 0] - 0.5) * np.where(X[:, -1] > 0.5, 0.215, 0.0)

    def energy_at(places):
        world.U.x.assign(places)
        return contact.energy(world)

    held = energy_at(x)
    force = wp.zeros(world.n, dtype=world.space.vec, device=world.device)
    contact.forces(world, world.U, 0.0, force)
    f = force.numpy()
    assert held > 0.0 and np.abs(f[X[:, -1] < 0.2]).max() == 0.0
    for _ in range(5):
        aside = random.normal(size=x.shape)
        slope = (energy_at(x + 1e-7 * aside) - energy_at(x - 1e-7 * aside)) / 2e-7
        assert slope == pytest.approx(-(f * aside).sum(), rel=1e-5, abs=1e-5 * np.abs(f).sum())
    scale = np.abs(f).sum()
    assert np.abs(f.sum(axis=0)).max() < 1e-13 * scale
    moment = (x[:, :, None] * f[:, None] - x[:, None] * f[:, :, None]).sum(axis=0)
    assert np.abs(moment).max() < 1e-12 * scale


@pytest.mark.parametrize(("dim", "friction"), [(2, 0.0), (2, 0.3), (3, 0.0)])
def test_legs_of_a_fork_hit_each_other(dim, friction):
    """They meet by their ends, do not pass, and part again; momentum and the ledger are exact."""
    speed = {2: 0.15, 3: 0.1}[dim] * C_P  # of the tips; 3-D ends, corner on corner, give way more
    body = fork(dim, legs=9, velocity=speed)
    simulation = es.Simulation(body, interactions=[es.Contact(friction=friction)])
    start, X = simulation.energy()["total"], body.x
    left, right = (X[:, 0] < 0.5) & (X[:, -1] > 0.8), (X[:, 0] > 0.5) & (X[:, -1] > 0.8)
    held, gaps = 0.0, []
    for _ in simulation.frames(np.linspace(0.002, 0.06, 30)):
        held = max(held, simulation.energy()["held"])
        d = simulation.x[right][:, None] - simulation.x[left]
        gaps.append(d[np.linalg.norm(d[..., 1:], axis=-1) < 0.1, 0].min())
    energy = simulation.energy()
    assert held > 1e-3 * start
    assert 0.03 < min(gaps) < 0.1 < gaps[-1]
    assert abs(energy["interaction"]) < {2: 0.01, 3: 0.02}[dim] * start and abs(energy["residual"]) < 1e-11 * start
    scale = simulation.particles.mass.numpy().sum() * speed
    assert np.abs(simulation.momentum()).max() < 1e-13 * scale


def test_two_cubes_of_one_body_in_three_dimensions():
    """Face to face, three quarters of it: they bounce, and the contact keeps momentum and energy."""
    n = 5
    x = lattice(3, n)
    x = np.concatenate([x, x + np.array([0.25, 0.0, 1.6])])
    v = np.repeat([[0.0, 0.0, 6.0], [0.0, 0.0, -6.0]], n**3, axis=0)
    simulation = es.Simulation(
        es.Body(x=x, volume=n**-3.0, material=SOFT, velocity=v, name="both"), interactions=[es.Contact()]
    )
    start, held = simulation.energy()["total"], 0.0
    for _ in simulation.frames(np.linspace(0.01, 0.12, 12)):
        held = max(held, simulation.energy()["held"])
    energy, v = simulation.energy(), simulation.v
    assert held > 1e-2 * start and energy["held"] == 0.0
    assert v[: n**3, 2].mean() < -3.0 and v[n**3 :, 2].mean() > 3.0
    assert np.abs(simulation.momentum()).max() < 1e-9
    assert abs(energy["interaction"]) < 0.03 * start and abs(energy["residual"]) < 1e-11 * start


def crushed_ring():
    """A rubber ring between two planes that come and go; the time that they come for [s]."""
    x, volume = annulus(centre=(0.0, 0.0), inner=0.8, outer=1.0, rings=3)
    body = es.Body(x=x, volume=volume, material=SOFT, name="ring")
    half = 0.8 / (0.05 * C_P)

    def plane(name, side):
        path = Driven(lambda x, t: np.array([[0.0, -side * 0.4025 * (1.0 - np.cos(np.pi * t / half))]]))
        return RigidBody(Plane(normal=(0.0, -side)), centre=(0.0, side), motion=path, name=name)

    planes = [plane("above", 1.0), plane("below", -1.0)]
    return es.Simulation(body, interactions=[es.Contact(), *planes]), half


def test_a_ring_that_is_crushed_flat():
    """It touches itself, gap about zero, nothing passes; it opens again, and the contact took nothing."""
    simulation, half = crushed_ring()
    X, h = simulation.x, simulation.bodies[0].spacing.mean()
    middle = (np.linalg.norm(X, axis=1) < 0.8 + 0.8 * h) & (abs(X[:, 0]) < 0.3)
    up, down = middle & (X[:, 1] > 0.0), middle & (X[:, 1] < 0.0)
    contact = simulation.bound_interactions[0]
    gaps, held, work = [], [], []
    for _ in simulation.frames(np.linspace(0.1, 2.0, 20) * half):
        d = simulation.x[up][:, None] - simulation.x[down]
        gaps.append(d[abs(d[..., 0]) < h, 1].min() / h)
        held.append(contact.energy(simulation.stepper))
        work.append(simulation.energy()["external"])
    energy = simulation.energy()
    assert 0.6 < min(gaps) < 1.0  # spacings: faces that touch are 1 apart
    assert max(held) > 0.0 and held[0] == held[-1] == 0.0
    assert gaps[-1] > 0.9 * gaps[0]
    assert abs(energy["residual"]) < 1e-11 * max(work)
    assert abs(energy["interaction"]) < 0.005 * max(work)
    assert np.abs(simulation.momentum()[0]) < 1e-9


def test_a_notch_that_closes():
    """Two cells wide, in a block that is pressed from both ends: its faces pass through each other, or bear."""
    h, force, gaps = 0.1, {}, {}
    x = rectangle(20, 10, h)
    x = x[(abs(x[:, 0] - 10 * h) > h) | (x[:, 1] < 3 * h)]
    for name, contact in (("open", []), ("closed", [es.Contact()])):
        body = es.Body(x=x, volume=h * h, material=SOFT, name="block")
        ends = [
            es.Velocity(lambda X: X[:, 0] < 2 * h, 1.0, axes=(0,)),
            es.Velocity(lambda X: X[:, 0] > 18 * h, -1.0, axes=(0,)),
        ]
        simulation = es.Simulation(body, interactions=contact, boundaries=ends)
        left, right = ((x[:, 1] > 6 * h) & (abs(x[:, 0] - at * h) < 0.1 * h) for at in (8.5, 11.5))
        found = []
        for _ in simulation.frames([0.02, 0.2]):
            found.append((simulation.x[right, 0] - simulation.x[left, 0]).min() / h)
        force[name], gaps[name] = simulation.reaction(ends[0])[0], found
    assert gaps["closed"][0] == pytest.approx(gaps["open"][0], rel=1e-6)  # nothing acts before they meet
    assert gaps["open"][1] < -1.0 and 0.5 < gaps["closed"][1] < 1.0
    assert force["closed"] > 2.0 * force["open"]


def test_what_touches_itself(caplog):
    """By default all whose arrangement stays; by name; what is read anew does not: logged, and refused by name."""
    caplog.set_level("INFO", logger="warp_eulsph")
    body = fork(2)
    other = es.Body(x=rectangle(4, 4, 0.1, (3.0, 0.0)), volume=0.01, material=SOFT, name="other")

    def felt(contact, **options):
        simulation = es.Simulation([body, other], interactions=[contact], **options)
        return simulation.bound_interactions[0]._felt.tolist()

    assert felt(es.Contact()) == [[2, 1], [1, 2]]
    assert felt(es.Contact(between=[("fork", "other")])) == [[0, 1], [1, 0]]
    assert felt(es.Contact(between=[("fork", "fork")])) == [[2, 0], [0, 0]]
    assert "do not touch themselves" not in caplog.text
    assert felt(es.Contact(), arrangement=es.Current()) == [[0, 1], [1, 0]]
    assert "['fork', 'other'] read their arrangement anew and do not touch themselves" in caplog.text
    with pytest.raises(ValueError, match=r"must keep their arrangement, \['fork'\] read it anew"):
        es.Simulation([body, other], interactions=[es.Contact(between=[("fork", "fork")])], arrangement=es.Current())
