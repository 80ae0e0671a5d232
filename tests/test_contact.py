"""Bodies that touch: momentum, energy, statics, friction, against exact values; start, restart, threads."""

import numpy as np
import pytest
import warp as wp
from bodies import lattice
from touching import C_P, REFERENCES, SOFT, bar, mean_velocity, rectangle, rings

import warp_eulsph as es
from warp_eulsph.geometry import disc


@REFERENCES
@pytest.mark.parametrize("ratio", [1.0, 2.0], ids=["equal", "unequal"])
def test_bars(ratio, arrangement):
    """Impedances 1 : 1 and 1 : 2, equal times of travel: (1, 0) becomes (0, 1) and (−⅓, ⅔); the bars part."""
    v = 0.01
    left = bar(100, 0.0, 1.0, 1.0, velocity=v, name="left")
    right = bar(100, 1.0, 1.0 / ratio, ratio**2, name="right")
    simulation = es.Simulation([left, right], interactions=[es.Contact()], arrangement=arrangement)
    momentum, start = simulation.momentum(), simulation.energy()["total"]
    simulation.run(1.0)
    assert simulation.energy()["held"] > 0.0
    simulation.run(2.4)
    expected = (0.0, 1.0) if ratio == 1.0 else (-1.0 / 3.0, 2.0 / 3.0)
    for name, value in zip(("left", "right"), expected, strict=True):
        assert mean_velocity(simulation, name)[0] / v == pytest.approx(value, abs=0.02)
    energy = simulation.energy()
    assert energy["held"] == 0.0 and -0.003 * start < energy["interaction"] <= 0.0
    assert abs(energy["residual"]) < 1e-12 * start
    np.testing.assert_allclose(simulation.momentum(), momentum, rtol=1e-12)


def test_what_bars_lose_in_contact_is_the_error_of_the_steps():
    """Of second order: forces are those of the energy that is held."""
    lost = []
    for cfl in (0.8, 0.4, 0.2):
        bodies = [bar(100, 0.0, 1.0, 1.0, velocity=0.01, name="left"), bar(100, 1.0, 1.0, 1.0, name="right")]
        simulation = es.Simulation(bodies, interactions=[es.Contact()], time_step=es.TimeStep(cfl=cfl))
        start = simulation.energy()["total"]
        simulation.run(2.6)
        lost.append(-simulation.energy()["interaction"] / start)
    assert lost[0] < 1.2e-3
    assert lost[:2] == pytest.approx([4.0 * lost[1], 4.0 * lost[2]], rel=0.05)


def test_bars_of_other_spacings_and_in_float32():
    """Three cells against one, and a gap that closes first."""
    left = bar(120, 0.0, 1.0, 1.0, velocity=0.01, name="left")
    right = bar(40, 1.02, 1.0, 1.0, name="right")
    simulation = es.Simulation([left, right], interactions=[es.Contact()], dtype=wp.float32)
    simulation.run(5.0)
    assert mean_velocity(simulation, "left")[0] / 0.01 == pytest.approx(0.0, abs=0.03)
    assert simulation.momentum()[0] == pytest.approx(0.01, rel=1e-5)


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("dim", [2, 3])
def test_forces_are_the_slopes_of_the_energy(dim, friction):
    """A block pressed into another of other spacing: forces are those of the energy, and have no moment."""
    n, m = (12, 7) if dim == 2 else (6, 4)
    lower = es.Body(x=lattice(dim, n), volume=n**-dim, material=SOFT, name="lower")
    scale = 0.6
    x = lattice(dim, m) * scale + np.array([*[0.23, 0.21][: dim - 1], 1.01])
    upper = es.Body(x=x, volume=(scale / m) ** dim, material=SOFT, name="upper")
    simulation = es.Simulation([lower, upper], interactions=[es.Contact(friction=friction)])
    contact, world = simulation.bound_interactions[0], simulation.stepper
    start, own = simulation.x, np.arange(len(simulation.x)) >= len(lower.x)

    def energy_at(shift):
        world.U.x.assign(np.where(own[:, None], start + shift, start))
        return contact.energy(world)

    pressed = np.zeros(dim)
    pressed[-1] = -0.02
    step = 1e-6
    for i in range(dim):
        aside = np.eye(dim)[i] * step
        slope = (energy_at(pressed + aside) - energy_at(pressed - aside)) / (2.0 * step)
        energy_at(pressed)
        force = wp.zeros(world.n, dtype=world.space.vec, device=world.device)
        contact.forces(world, world.U, 0.0, force)
        on_upper, on_lower = force.numpy()[own].sum(axis=0), force.numpy()[~own].sum(axis=0)
        pushed = on_upper[-1]
        assert pushed > 0.0
        assert on_upper[i] == pytest.approx(-slope, rel=1e-4, abs=1e-6 * pushed)
        np.testing.assert_allclose(on_lower, -on_upper, rtol=1e-12, atol=1e-12 * pushed)
    f, x = force.numpy(), world.U.x.numpy()
    moment = (x[:, :, None] * f[:, None] - x[:, None] * f[:, :, None]).sum(axis=0)
    assert np.abs(moment).max() < 1e-12 * pushed


@pytest.mark.parametrize("dim", [2, 3])
def test_forces_are_the_slopes_where_all_moves(dim):
    """Every particle displaced at will, normals with them: −∂E/∂x of each, by differences along random directions."""
    random = np.random.default_rng(3)
    n = 6 if dim == 2 else 4
    lower = es.Body(x=lattice(dim, n), volume=n**-dim, material=SOFT, name="lower")
    upper = es.Body(x=lattice(dim, n) + np.eye(dim)[-1] * 1.02 + 0.3 / n, volume=n**-dim, material=SOFT, name="upper")
    simulation = es.Simulation([lower, upper], interactions=[es.Contact()])
    contact, world = simulation.bound_interactions[0], simulation.stepper
    x = simulation.x + random.uniform(-0.1, 0.1, simulation.x.shape) / n
    x[len(lower.x) :, -1] -= 0.5 / n

    def energy_at(places):
        world.U.x.assign(places)
        return contact.energy(world)

    held = energy_at(x)
    force = wp.zeros(world.n, dtype=world.space.vec, device=world.device)
    contact.forces(world, world.U, 0.0, force)
    f = force.numpy()
    assert held > 0.0
    for _ in range(5):
        aside = random.normal(size=x.shape)
        slope = (energy_at(x + 1e-6 / n * aside) - energy_at(x - 1e-6 / n * aside)) / (2e-6 / n)
        assert slope == pytest.approx(-(f * aside).sum(), rel=1e-5, abs=1e-5 * np.abs(f).sum())
    moment = (x[:, :, None] * f[:, None] - x[:, None] * f[:, :, None]).sum(axis=0)
    assert np.abs(moment).max() < 1e-12 * np.abs(f).sum()


@REFERENCES
def test_a_block_at_rest(arrangement):
    """Damped, then left alone: it bears its weight, drifts nowhere and gains nothing."""
    h = 0.1
    base = es.Body(x=rectangle(16, 4, h), volume=h * h, material=SOFT, name="base")
    block = es.Body(x=rectangle(8, 4, h, (0.4, 0.4)), volume=h * h, material=SOFT, name="block")
    conditions = [es.Fixed(lambda X: X[:, 1] < h, body="base"), es.Gravity(9.81), es.Damping()]
    simulation = es.Simulation(
        [base, block], interactions=[es.Contact()], boundaries=conditions, arrangement=arrangement
    )
    simulation.run(0.5)
    rest, before = simulation.x[64:].mean(axis=0), simulation.energy()
    simulation.step(1000)
    weight = 9.81 * 1000.0 * 32 * h * h
    assert simulation.interaction_force[64:].sum(axis=0) == pytest.approx([0.0, weight], rel=1e-3, abs=1e-3 * weight)
    assert np.abs(simulation.x[64:].mean(axis=0) - rest).max() < 1e-7
    assert np.abs(simulation.v).max() < 1e-4
    assert simulation.energy()["total"] <= before["total"] + 1e-6 * abs(before["stored"])


@REFERENCES
def test_a_frictionless_overhanging_stack_stays(arrangement):
    h = 0.1
    steel = es.NeoHookean(density=1000.0, young=1e9, poisson=0.3)
    blocks = [
        es.Body(x=rectangle(10, 3, h, (0.13 * k, 0.3 * k)), volume=h * h, material=steel, name=str(k)) for k in range(3)
    ]
    conditions = [es.Fixed(lambda X: X[:, 1] < h, body="0"), es.Gravity(9.81)]
    simulation = es.Simulation(blocks, interactions=[es.Contact()], boundaries=conditions, arrangement=arrangement)
    simulation.run(0.1)
    for k in (1, 2):
        own = simulation.ranges[str(k)]
        moved = simulation.x[own.start : own.stop].mean(axis=0) - blocks[k].x.mean(axis=0)
        assert abs(moved[0]) < 5e-6 and -1e-4 < moved[1] < 0.0


@REFERENCES
@pytest.mark.parametrize(("friction", "tolerance"), [(0.0, 1e-4), (0.3, 0.015)])
def test_sliding_down_an_incline(friction, tolerance, arrangement):
    """30°: g (sin − μ cos)."""
    simulation = incline(friction, arrangement)
    simulation.run(0.15)
    first = mean_velocity(simulation, "block")[0]
    simulation.run(0.4)
    found = (mean_velocity(simulation, "block")[0] - first) / 0.25
    exact = 9.81 * (np.sin(np.radians(30.0)) - friction * np.cos(np.radians(30.0)))
    assert found == pytest.approx(exact, rel=tolerance)
    energy = simulation.energy()
    assert abs(energy["residual"]) < 1e-10 * energy["kinetic"]
    assert energy["interaction"] < 0.0 if friction else abs(energy["interaction"]) < 1e-4 * energy["kinetic"]


@REFERENCES
def test_sticking_on_an_incline(arrangement):
    """30° at a friction of 0.7, whose angle is 35°: it comes to rest and does not creep."""
    simulation = incline(0.7, arrangement)
    at = [simulation.x[160:].mean(axis=0)[0] for _ in simulation.frames([0.15, 0.2, 0.25, 0.3, 0.35, 0.4])]
    assert np.ptp(at) < 2e-5  # it swings, ever less
    assert at[-1] - simulation.bodies[1].x[:, 0].mean() < 3e-4  # half cells in shear, and the block


def incline(friction, arrangement=es.Convected()):
    """A block on a plane of 30°, gravity turned instead and grown over 0.1 s."""
    h, angle = 0.1, np.radians(30.0)
    base = es.Body(x=rectangle(40, 4, h), volume=h * h, material=SOFT, name="base")
    block = es.Body(x=rectangle(8, 4, h, (0.55, 0.4)), volume=h * h, material=SOFT, name="block")
    down = 9.81 * np.array([np.sin(angle), -np.cos(angle)])
    pull = es.BodyForce(lambda x, t: down * min(t / 0.1, 1.0), body="block")
    return es.Simulation(
        [base, block],
        interactions=[es.Contact(friction=friction)],
        boundaries=[es.Fixed(lambda X: X[:, 1] < h, body="base"), pull],
        arrangement=arrangement,
    )


@pytest.mark.parametrize(("speed", "circles"), [(0.05, 4), (0.15, 4), (0.3, 4), (0.3, 8)])
def test_rings_give_their_energy_back(speed, circles):
    """Off centre: what they lose is the dissipation's; momenta are kept. Eight circles crease and touch themselves."""
    simulation = rings(speed, circles)
    start, momentum, about = simulation.energy()["total"], simulation.momentum(), simulation.angular_momentum()
    held = 0.0
    for _ in simulation.frames(np.linspace(0.4, 3.0, 6) / (speed * C_P)):
        held = max(held, simulation.energy()["held"])
    energy = simulation.energy()
    assert held > 5e-4 * start
    assert mean_velocity(simulation, "left")[0] < 0.0 < mean_velocity(simulation, "right")[0]
    assert abs(energy["interaction"]) < 0.01 * start
    assert abs(energy["residual"]) < 1e-11 * start
    scale = simulation.particles.mass.numpy().sum() * speed * C_P
    assert np.abs(simulation.momentum() - momentum).max() < 1e-13 * scale
    assert abs(simulation.angular_momentum() - about)[0] < 1e-3 * scale


@REFERENCES
@pytest.mark.parametrize("speed", [0.03, 0.3])
@pytest.mark.parametrize("angle", [45.0, 30.0, 0.0])
def test_a_square_hits_a_face(angle, speed, arrangement):
    """By a corner, askew and flat: nothing passes, momentum and energy are kept."""
    h, turn = 0.1, np.radians(angle)
    Q = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    x = (rectangle(8, 8, h) - 0.4) @ Q.T
    base = es.Body(x=rectangle(24, 8, h), volume=h * h, material=SOFT, name="base")
    x = x + np.array([1.2, 0.87 - x[:, 1].min()])
    square = es.Body(x=x, volume=h * h, material=SOFT, velocity=(0.0, -speed * C_P), name="square")
    simulation = es.Simulation([base, square], interactions=[es.Contact()], arrangement=arrangement)
    start, momentum = simulation.energy()["total"], simulation.momentum()
    for _ in simulation.frames(np.linspace(0.02, 0.04, 5)):
        own, others = simulation.x[192:], simulation.x[:192]
        apart = np.linalg.norm(own[:, None] - others, axis=2).min()
        assert apart > 0.25 * h
        beside = [others[abs(others[:, 0] - place[0]) < 1.01 * h, 1].max(initial=-1.0) for place in own]
        assert (own[:, 1] > beside).all()
    energy = simulation.energy()
    assert mean_velocity(simulation, "square")[1] > -0.6 * speed * C_P
    assert -0.015 * start < energy["interaction"] < 0.01 * start
    assert np.abs(simulation.momentum() - momentum).max() < 1e-12 * np.abs(momentum).max()


@pytest.mark.parametrize("speed", [2.0, 8.0])
def test_a_drop_on_a_block(speed):
    """Water splashes on rubber: no particle gets in, and the contact takes and makes no energy."""
    h = 0.05
    block = es.Body(x=rectangle(40, 8, h), volume=h * h, material=SOFT, name="block")
    x, volume = disc(centre=(1.0, 0.72), radius=0.3, spacing=h)
    water = es.TaitLiquid(density=1000.0, sound_speed=50.0)
    drop = es.Body(x=x, volume=volume, material=water, velocity=(0.0, -speed), name="drop")
    held = es.Fixed(lambda X: X[:, 1] < h, body="block")
    simulation = es.Simulation([block, drop], interactions=[es.Contact()], boundaries=[held])
    start = simulation.energy()["total"]
    for _ in simulation.frames(np.linspace(0.04, 0.3, 5) / speed):
        own, others = simulation.x[320:], simulation.x[:320]
        beneath = [others[abs(others[:, 0] - place[0]) < h, 1].max(initial=-1.0) for place in own]
        assert (own[:, 1] > np.array(beneath) + 0.25 * h).all()
        energy = simulation.energy()
        assert abs(energy["interaction"]) < 0.003 * start
        assert abs(energy["residual"]) < 1e-11 * start
    assert mean_velocity(simulation, "drop")[1] > -0.6 * speed


@REFERENCES
def test_a_thin_plate_hit_on_both_sides(arrangement):
    """Two particles thick, between two discs of the same momentum: symmetric, and nobody passes."""
    h = 0.05
    plate = es.Body(x=rectangle(30, 2, h, (-0.75, -h)), volume=h * h, material=SOFT, name="plate")
    x, volume = disc(centre=(0.0, 0.0), radius=0.3, spacing=h)
    speed = 0.05 * C_P
    above = es.Body(x=x + np.array([0.0, 0.45]), volume=volume, material=SOFT, velocity=(0.0, -speed), name="above")
    below = es.Body(x=x - np.array([0.0, 0.45]), volume=volume, material=SOFT, velocity=(0.0, speed), name="below")
    simulation = es.Simulation([plate, above, below], interactions=[es.Contact()], arrangement=arrangement)
    start = simulation.energy()["total"]
    lowest = []
    for _ in simulation.frames(np.linspace(0.005, 0.08, 16)):
        place = {name: simulation.x[own.start : own.stop] for name, own in simulation.ranges.items()}
        lowest.append(place["above"][:, 1].min() - place["below"][:, 1].max())
        assert abs(place["plate"][:, 1].mean()) < 1e-6
    assert min(lowest) > 1.5 * h
    up, down = mean_velocity(simulation, "above"), mean_velocity(simulation, "below")
    assert up[1] > 0.3 * speed and up == pytest.approx([down[0], -down[1]], abs=1e-4 * speed)
    assert abs(simulation.energy()["interaction"]) < 0.02 * start


def test_angular_momentum_is_exact_where_dissipation_is_central():
    simulation = rings(0.15, scheme=es.Verlet(dissipation=es.Upwind(stress=True)))
    about, held = simulation.angular_momentum(), 0.0
    for _ in simulation.frames(np.linspace(0.4, 3.0, 6) / (0.15 * C_P)):
        held = max(held, simulation.energy()["held"])
    assert held > 0.0
    scale = simulation.particles.mass.numpy().sum() * 0.15 * C_P
    assert abs(simulation.angular_momentum() - about)[0] < 1e-13 * scale


def test_three_bodies_at_one_place():
    """Three discs fly to one point: threefold symmetry but for the lattice, momentum, and they part again."""
    x, volume = disc(centre=(0.0, 0.0), radius=0.3, spacing=0.05)
    bodies = []
    for k in range(3):
        turn = 2.0 * np.pi * k / 3.0
        out = np.array([np.cos(turn), np.sin(turn)])
        Q = np.array([[out[0], -out[1]], [out[1], out[0]]])
        bodies.append(es.Body(x=x @ Q.T + 0.5 * out, volume=volume, material=SOFT, velocity=-5.0 * out, name=str(k)))
    simulation = es.Simulation(bodies, interactions=[es.Contact()])
    start = simulation.energy()["total"]
    simulation.run(0.12)
    speeds = []
    for k, body in enumerate(bodies):
        out = -body.velocity[0] / 5.0
        v = mean_velocity(simulation, str(k))
        speeds.append(v @ out)
        assert abs(v @ [-out[1], out[0]]) < 1e-3 * 5.0
    assert min(speeds) > 1.0 and np.ptp(speeds) < 1e-3 * 5.0
    scale = simulation.particles.mass.numpy().sum() * 5.0
    assert np.abs(simulation.momentum()).max() < 1e-13 * scale
    assert abs(simulation.energy()["interaction"]) < 0.02 * start


def test_cubes_in_three_dimensions():
    """A cube and a cube of other spacing, face to edge."""
    n, m = 5, 6
    turn = np.radians(45.0)
    Q = np.array([[np.cos(turn), 0.0, -np.sin(turn)], [0.0, 1.0, 0.0], [np.sin(turn), 0.0, np.cos(turn)]])
    lower = es.Body(x=lattice(3, n), volume=n**-3.0, material=SOFT, velocity=(0.0, 0.0, 3.0), name="lower")
    x = (lattice(3, m) - 0.5) @ Q.T + np.array([0.5, 0.5, 0.0])
    x[:, 2] += 1.15 - x[:, 2].min()
    upper = es.Body(x=x, volume=m**-3.0, material=SOFT, velocity=(0.0, 0.0, -3.0), name="upper")
    simulation = es.Simulation([lower, upper], interactions=[es.Contact()])
    start = simulation.energy()["total"]
    simulation.run(0.05)
    energy = simulation.energy()
    assert mean_velocity(simulation, "lower")[2] < 0.0 < mean_velocity(simulation, "upper")[2]
    assert np.abs(simulation.momentum()).max() < 1e-9
    assert abs(energy["interaction"]) < 0.03 * start and abs(energy["residual"]) < 1e-11 * start
