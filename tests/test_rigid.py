"""Rigid bodies: walls, tools and projectiles, by exact solutions and conservation."""

import dataclasses

import numpy as np
import pytest
import warp as wp
from bodies import RUBBER, bits, block

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.geometry import box
from warp_eulsph.interactions import Box, Driven, Free, Held, Moving, Plane, RigidBody, Sphere, traces
from warp_eulsph.output import Recording, record
from warp_eulsph.output.record import ChangedCaseError
from warp_eulsph.schedule import AtTimes

ELASTIC = es.LinearElastic(density=1.0, young=1.0, poisson=0.0)  # c = 1
FLOOR = RigidBody(Plane((0.0, 1.0)), name="floor")


def rigid(simulation, name="rigid"):
    return next(each for each in simulation.bound_interactions if each.option.name == name)


def bar(n, scheme, **options):
    """A bar of length 1 and wave speed 1 that meets a wall at 0.01."""
    x, volume = box(lower=(0.0,), upper=(1.0,), spacing=1.0 / n)
    body = es.Body(x=x, volume=volume, material=ELASTIC, velocity=-0.01)
    return es.Simulation(body, interactions=[RigidBody(Plane((1.0,)))], scheme=scheme, **options)


@pytest.mark.parametrize(
    "options",
    [
        {"scheme": es.Verlet()},
        {"scheme": es.Verlet(), "dtype": wp.float32},
        {"scheme": es.Verlet(), "arrangement": es.Current()},
        {"scheme": es.LaxWendroff(), "reference": es.Never()},
    ],
    ids=["total Lagrangian", "single", "Eulerian", "Lax-Wendroff"],
)
def test_a_bar_leaves_a_wall_as_it_came(options):
    """Exact: contact for 2 L/c = 2, pressure ρ c v = 0.01, rebound at the speed of impact with all of the energy."""
    simulation = bar(100, **options)
    wall, start = rigid(simulation), simulation.energy()["total"]
    times, forces = [], []
    while simulation.t < 2.6:
        simulation.step()
        times.append(simulation.t)
        forces.append(-wall.force[0])
    times, forces = np.array(times), np.array(forces)
    touching = times[forces > 0.0]
    assert touching[-1] - touching[0] == pytest.approx(2.0, rel=0.02)
    assert forces.min() == 0.0  # no tension
    plateau = (times > 0.3) & (times < 1.7)
    assert forces[plateau].mean() == pytest.approx(0.01, rel=0.001)
    energy = simulation.energy()
    assert simulation.v.mean() == pytest.approx(0.01, rel=0.02)
    assert energy["total"] == pytest.approx(start, rel=0.02)
    assert energy["held"] == 0.0
    assert abs(energy["interaction"]) < 0.0015 * start  # the error of the steps
    assert abs(energy["residual"]) < (1e-12 if simulation.space.real is wp.float64 else 1e-6) * start


def test_all_layers_lose_less_than_the_outermost_alone(monkeypatch):
    """Rebound and the contact's account with forces on outermost particles: .990, on columns .994."""
    found = []
    for least in (traces.LEAST, np.inf):
        monkeypatch.setattr(traces, "LEAST", least)
        simulation = bar(100, es.Verlet())
        start = simulation.energy()["total"]
        simulation.run(2.6)
        found.append((simulation.v.mean() / 0.01, simulation.energy()["interaction"] / start))
    (column, lost), (alone, more) = found
    assert column > alone + 0.003
    assert 0.0 > lost > more


def test_a_wall_that_moves_does_the_work():
    """A wall at speed v sends a bar at rest off at 2v, and its drive puts in what the bar has then."""
    for motion in (Moving((0.005,)), Driven(lambda x, t: 0.005 * t)):
        simulation = bar(50, es.Verlet())
        body = dataclasses.replace(simulation.bodies[0], velocity=0.0)
        simulation = es.Simulation(body, interactions=[RigidBody(Plane((1.0,)), motion=motion)])
        assert simulation.by_graphs == isinstance(motion, Moving)
        simulation.run(2.6)
        energy = simulation.energy()
        assert simulation.v.mean() == pytest.approx(0.01, rel=0.04)
        assert energy["external"] == pytest.approx(energy["total"], rel=0.01)
        assert abs(energy["interaction"]) < 0.005 * energy["external"]
        assert rigid(simulation).x == pytest.approx(0.013)
        assert rigid(simulation).v == pytest.approx(0.005)


@pytest.mark.parametrize("turned", [False, True], ids=["gravity turned", "plane turned"])
def test_a_block_slides_down_an_incline_without_friction(turned):
    angle, g = np.radians(30.0), 9.81
    x, volume = box(lower=(0.0, 0.0), upper=(1.0, 0.5), spacing=0.1)
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) if turned else np.eye(2)
    pull = R @ [-g * np.sin(angle), -g * np.cos(angle)]
    body = es.Body(x=x @ R.T, volume=volume, material=RUBBER)
    plane = RigidBody(Plane(R @ [0.0, 1.0]))
    simulation = es.Simulation(body, boundaries=[es.BodyForce(pull)], interactions=[plane])
    simulation.run(0.3)
    along = simulation.v.mean(axis=0) @ R[:, 0]
    assert along == pytest.approx(-g * np.sin(angle) * 0.3, rel=1e-12)
    assert abs((simulation.x - x @ R.T)[:, 0].std()) < 0.005
    energy = simulation.energy()
    assert abs(energy["interaction"]) < 1e-4 * energy["external"]


def test_a_block_rests_under_its_weight():
    """It swings about its sag, never higher than at the start, nor aside, and comes to rest with its weight."""
    x, volume = box(lower=(0.0, 0.0), upper=(1.0, 0.5), spacing=0.1)
    body = es.Body(x=x, volume=volume, material=RUBBER)
    simulation = es.Simulation(body, boundaries=[es.Gravity(), es.Damping()], interactions=[FLOOR])
    height = x[:, 1].mean()
    for _ in simulation.frames(np.linspace(0.05, 4.0, 80)):
        centre = simulation.x.mean(axis=0)
        assert height - 0.003 < centre[1] < height + 1e-9
        assert abs(centre[0] - 0.5) < 1e-9
    assert simulation.steps > 2000
    assert rigid(simulation, "floor").force[1] == pytest.approx(-1100.0 * 0.5 * 9.81, rel=1e-3)
    assert np.abs(simulation.v).max() < 1e-3
    energy = simulation.energy()
    assert energy["interaction"] < 1e-3 * energy["external"]


@pytest.mark.slow
def test_a_block_rests_for_a_hundred_thousand_steps():
    """Without damping but the scheme's own: no drift, no gain, and motion dies out."""
    x, volume = box(lower=(0.0, 0.0), upper=(1.0, 0.5), spacing=0.1)
    simulation = es.Simulation(
        es.Body(x=x, volume=volume, material=RUBBER), boundaries=[es.Gravity()], interactions=[FLOOR]
    )
    simulation.step(20_000)
    before = simulation.energy()
    simulation.step(80_000)
    after = simulation.energy()
    centre = simulation.x.mean(axis=0)
    assert abs(centre[0] - 0.5) < 1e-12
    assert 0.2499 < centre[1] < 0.25
    assert after["kinetic"] < before["kinetic"] < 1e-6 * before["external"]
    assert before["total"] * (1.0 - 1e-3) < after["total"] < before["total"]
    assert after["interaction"] == pytest.approx(before["interaction"], abs=1e-7 * before["total"])


def far_away(dim, **options):
    """Bodies that nothing touches."""
    return block(dim, 3, **options)


def test_a_free_box_keeps_its_energy_and_angular_momentum():
    """Spun about its middle axis, where turning is unstable, with steps of a fiftieth of a turn."""
    motion = Free(density=1000.0, spin=(0.01, 3.0, 0.01), velocity=(1.0, 0.0, 0.0))
    turning = RigidBody(Box((0.1, 0.2, 0.4)), centre=(50.0, 0.0, 0.0), motion=motion)
    simulation = es.Simulation(far_away(3), interactions=[turning], time_step=es.TimeStep(fixed=0.04))
    body = rigid(simulation)
    mass = 1000.0 * 0.008
    inertia = mass / 12.0 * np.array([0.2, 0.17, 0.05])
    spin = np.array([0.01, 3.0, 0.01])
    L = inertia * spin
    np.testing.assert_allclose(body.angular_momentum, L, rtol=1e-12)
    start = 0.5 * mass + 0.5 * inertia @ spin**2
    assert simulation.energy()["held"] == pytest.approx(start, rel=1e-12)
    turns = []
    for _ in range(40):
        simulation.step(50)
        np.testing.assert_allclose(body.angular_momentum, L, rtol=1e-12)
        assert simulation.energy()["held"] == pytest.approx(start, rel=2e-3)  # bounded, of second order
        turns.append(body.R[1, 1])
    assert min(turns) < -0.9 < 0.9 < max(turns)  # it does tumble
    assert simulation.energy()["held"] == pytest.approx(start, rel=2e-3)
    np.testing.assert_allclose(body.x, [50.0 + simulation.t, 0.0, 0.0], rtol=1e-12)
    np.testing.assert_allclose(body.R @ body.R.T, np.eye(3), atol=1e-11)


def test_errors_of_free_turning_are_of_second_order():
    errors = []
    for steps in (100, 200):
        motion = Free(density=1000.0, spin=(1.0, 3.0, 2.0))
        simulation = es.Simulation(
            far_away(3),
            interactions=[RigidBody(Box((0.1, 0.2, 0.4)), centre=(50.0, 0.0, 0.0), motion=motion)],
            time_step=es.TimeStep(fixed=1.0 / steps),
        )
        start = simulation.energy()["held"]
        simulation.step(steps)
        errors.append(abs(simulation.energy()["held"] - start))
    assert errors[1] == pytest.approx(errors[0] / 4.0, rel=0.1)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_weight_and_forces_move_a_free_body(dim):
    forces = {1: {}, 2: {"torque": (5.0,)}, 3: {"torque": (0.0, 0.0, 5.0)}}[dim]
    motion = Free(mass=2.0, gravity=9.81, force=[4.0] * dim, **forces)
    centre = [50.0] * dim
    ball = RigidBody(Sphere(0.3), centre=centre, motion=motion)
    simulation = es.Simulation(far_away(dim), interactions=[ball], time_step=es.TimeStep(fixed=1e-3))
    simulation.run(0.5)
    acceleration = np.full(dim, 2.0)
    acceleration[-1] -= 9.81
    body = rigid(simulation)
    np.testing.assert_allclose(body.v, 0.5 * acceleration, rtol=1e-12)
    np.testing.assert_allclose(body.x, centre + 0.125 * acceleration, rtol=1e-12)
    if dim > 1:
        assert body.spin[-1] == pytest.approx(0.5 * 5.0 / (2.0 * {2: 0.5, 3: 0.4}[dim] * 0.09), rel=1e-12)
    energy = simulation.energy()
    assert energy["external"] == pytest.approx(energy["held"], rel=1e-12)
    assert abs(energy["interaction"]) < 1e-12 * energy["held"]


def dropped(dim=2, dtype=wp.float64, **options):
    """A free ball that falls on a block beside its middle, and the two fly on together in empty space."""
    centre = [0.4, 1.26, 0.45][:dim]
    if dim == 3:
        centre = [0.4, 0.45, 1.26]
    velocity = [0.0] * (dim - 1) + [-4.0]
    ball = RigidBody(Sphere(0.25), centre=centre, motion=Free(mass=200.0, velocity=velocity))
    return es.Simulation(block(dim, 8 if dim == 2 else 5), interactions=[ball], dtype=dtype, **options)


@pytest.mark.parametrize(("dim", "dtype"), [(2, wp.float64), (2, wp.float32), (3, wp.float64)])
def test_momentum_goes_over_to_the_last_bit(dim, dtype):
    # dissipation by forces (M9) takes angular momentum within a body, that by stresses takes none
    simulation = dropped(dim, dtype, scheme=es.Verlet(dissipation=es.Upwind(stress=True)))
    ball, start = rigid(simulation), simulation.energy()["total"]
    scale = 200.0 * 4.0

    def momenta():
        linear = simulation.momentum() + 200.0 * ball.v
        x, v = np.zeros(3), np.zeros(3)
        x[:dim], v[:dim] = ball.x, ball.v
        about = 200.0 * np.cross(x, v)[{2: slice(2, 3), 3: slice(0, 3)}[dim]] + ball.angular_momentum
        return linear, simulation.angular_momentum() + about

    before = momenta()
    pushed = 0.0
    for _ in range(40):
        simulation.step(5)
        pushed = max(pushed, ball.force[-1])
    after = momenta()
    precise = dtype is wp.float64
    assert pushed > 1e3 and ball.v[-1] > -3.0
    np.testing.assert_allclose(after[0], before[0], atol=(1e-12 if precise else 1e-5) * scale)
    np.testing.assert_allclose(after[1], before[1], atol=(1e-12 if precise else 1e-5) * scale)
    energy = simulation.energy()
    assert abs(energy["interaction"]) < 0.01 * start  # the steps at which points begin to touch
    assert abs(energy["residual"]) < (1e-12 if precise else 1e-5) * start


def test_graphs_sorting_threads_and_host_agree():
    found = []
    for graphs, threads in ((False, 1), (True, 1), (False, 2)):
        execution.set_threads(threads)
        try:
            simulation = dropped(arrangement=es.Current())
            simulation.by_graphs = graphs
            simulation.step(60)
            found.append(bits(simulation))
        finally:
            execution.set_threads()
    assert found[0] == found[1] == found[2]


def test_resumed_runs_go_on_bit_for_bit():
    whole, resumed = dropped(), dropped()
    whole.step(20)
    arrays, counters = {name: array.numpy().copy() for name, array in whole.evolving().items()}, whole.counters
    resumed.step(4)
    resumed.restore(arrays, counters)
    assert (rigid(resumed).force == rigid(whole).force).all() and rigid(whole).force.any()
    whole.step(20)
    resumed.step(20)
    assert bits(resumed) == bits(whole)


def test_recorded_runs_go_on_and_know_their_rigid_bodies(tmp_path):
    def run(directory, until, radius=0.25):
        simulation = dropped()
        ball = dataclasses.replace(simulation.interactions[0], shape=Sphere(radius), friction=0.2)
        simulation = es.Simulation(simulation.bodies, interactions=[ball])
        record(simulation, directory, until, Recording(snapshots=AtTimes([0.004, 0.006])), resume=True)
        return simulation

    whole = run(tmp_path / "whole", 0.006)
    run(tmp_path / "parts", 0.004)
    assert bits(run(tmp_path / "parts", 0.006)) == bits(whole)
    assert rigid(whole).force.any()
    with pytest.raises(ChangedCaseError, match=r"interactions.0.shape.radius: 0.25, now 0.2"):
        run(tmp_path / "parts", 0.01, radius=0.2)


def test_a_disc_in_a_hollow_box_bounces_about():
    """A body inside a container that has no matter where it is, at an angle."""
    container = RigidBody(Box((2.0, 2.0)), centre=(0.5, 0.5), rotation=(0.3,), hollow=True)
    body = block(2, 6, velocity=(6.0, 4.0))
    simulation = es.Simulation(body, interactions=[container])
    start = simulation.energy()["total"]
    forces = []
    for _ in simulation.frames(np.linspace(0.02, 1.0, 50)):
        away = np.abs((simulation.x - 0.5) @ container_axes(0.3)).max()
        assert away < 1.0
        forces.append(np.abs(rigid(simulation).force).max())
    assert np.count_nonzero(forces) > 3
    energy = simulation.energy()
    assert abs(energy["interaction"]) < 0.02 * start


def container_axes(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def test_a_small_overlap_counts_as_touching():
    """Less than half a spacing: no face is known better; nothing is set off."""
    x, volume = box(lower=(0.0, 0.0), upper=(1.0, 1.0), spacing=0.1)
    body = es.Body(x=x, volume=volume, material=RUBBER)
    simulation = es.Simulation(body, interactions=[RigidBody(Plane((0.0, 1.0)), centre=(0.0, 0.02))])
    simulation.step(20)
    assert np.abs(simulation.v).max() < 1e-9 and simulation.energy()["held"] < 1e-20
    assert rigid(simulation).option.motion == Held()
