"""Liquids without corrections (M27) and rigid walls in their sums (M28): rest, exchange of energy, walls that move."""

import dataclasses

import numpy as np
import pytest
import warp as wp

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.interactions import Free, Moving, Plane, RigidBody, Sphere
from warp_eulsph.interactions.wetting import ENTRIES, behind_planes
from warp_eulsph.scheme.uncorrected import lattice_sum

WEIGHT, RAMP, SOUND = 9.80665, 0.4, 30.0
SCHEME = es.Verlet(dissipation=es.Upwind(volume=True), correction=es.Uncorrected())
OPTIONS = {"scheme": SCHEME, "weight": es.CubicSpline(), "dilation": 1.3}
WATER = es.TaitLiquid(density=1e3, sound_speed=SOUND)


@wp.func
def filling_up(x: wp.vec2d, t: wp.float64) -> wp.vec2d:
    s = wp.min(t / wp.float64(RAMP), wp.float64(1.0))
    return wp.vec2d(wp.float64(0.0), -wp.float64(WEIGHT) * s * s * (wp.float64(3.0) - wp.float64(2.0) * s))


def walls(**options):
    planes = {"floor": ((0.0, 1.0), (0.0, 0.0)), "left": ((1.0, 0.0), (0.0, 0.0)), "right": ((-1.0, 0.0), (1.0, 0.0))}
    return [RigidBody(Plane(normal=n), centre=c, name=name, **options) for name, (n, c) in planes.items()]


def tank(n, scheme):
    """A square metre of water between a floor and two walls; its weight comes in 0.4 s."""
    x, volume = box((0.0, 0.0), (1.0, 1.0), 1.0 / n)
    water = es.Body(x=x, volume=volume, material=WATER, spacing=1.0 / n)
    conditions = [es.BodyForce(filling_up), es.Damping(30.0)]
    options = {**OPTIONS, "scheme": scheme} if scheme else {}
    return es.Simulation(water, boundaries=conditions, interactions=walls(), **options)


def test_liquid_rests_in_a_tank():
    """Hydrostatic pressure within 1 % (rms, of that of the floor), for a hundred times the sound's way; no drift.

    With balanced pair vectors particles crowd unseen: the liquid stirs itself up and sinks by centimetres.
    """
    simulation, found = tank(20, SCHEME), []
    for t in (RAMP + 50.0 / SOUND, RAMP + 100.0 / SOUND):
        simulation.run(t)
        x = simulation.x
        depth = x[:, 1].max() + 0.025 - x[:, 1]
        error = -simulation.cauchy_stress[:, 0, 0] / (1e3 * WEIGHT) - depth
        assert np.sqrt(np.mean(error**2)) < 0.01
        found.append(x[:, 1].mean())
    assert abs(found[1] - found[0]) < 3e-4 and x[:, 0].min() > 0.2 / 20 and x[:, 1].min() > 0.2 / 20
    floor, left, right = (wall.force for wall in simulation.bound_interactions)
    assert floor[1] == pytest.approx(-1e3 * WEIGHT, rel=2e-3)
    assert -left[0] == pytest.approx(0.5e3 * WEIGHT, rel=0.02) and right[0] == pytest.approx(0.5e3 * WEIGHT, rel=0.02)
    energy = simulation.energy()
    assert abs(energy["interaction"]) < 1e-10 and abs(energy["residual"]) < 1e-10 * energy["total"]
    bare = tank(20, es.Verlet(dissipation=es.Upwind(volume=True)))
    bare.run(2.5)
    assert bare.x[:, 1].mean() < found[1] - 0.02


@pytest.mark.parametrize(("dim", "real"), [(1, wp.float64), (2, wp.float64), (3, wp.float64), (2, wp.float32)])
def test_wall_that_moves_keeps_the_books(dim, real):
    """A piston that presses a blob: what it does is what the liquid gets, to round-off, and momentum is its impulse."""
    n = {1: 20, 2: 8, 3: 5}[dim]
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / n)
    liquid = es.Body(x=x, volume=volume, material=WATER, spacing=1.0 / n)
    normal = np.eye(dim)[0]
    motion = Moving(velocity=tuple(0.3 * normal))
    piston = RigidBody(Plane(normal=tuple(normal)), motion=motion, name="piston")
    simulation = es.Simulation(liquid, interactions=[piston], **OPTIONS, dtype=real)
    impulse = 0.0
    for _ in range(30):
        simulation.step()
        impulse -= simulation.bound_interactions[0].force[0] * simulation.dt
    tolerance = 1e-11 if real is wp.float64 else 1e-5
    energy = simulation.energy()
    assert energy["external"] > 1.0
    assert abs(energy["interaction"]) < tolerance * energy["external"]
    assert abs(energy["residual"]) < tolerance * energy["external"]
    p = (1e3 * volume * simulation.v[:, 0]).sum() if np.isscalar(volume) else (1e3 * volume @ simulation.v[:, 0])
    assert p == pytest.approx(impulse, rel=tolerance)


def test_free_ball_falls_into_water():
    """Momentum of both is that of the weights, and their exchange of energy is of the order of the step."""
    g, n = 9.81, 16
    x, volume = box((0.0, 0.0), (1.0, 0.5), 1.0 / n)
    ball = RigidBody(
        Sphere(0.15), centre=(0.5, 0.75), motion=Free(density=500.0, gravity=g, velocity=(0.0, -2.0)), name="ball"
    )
    pool = es.Body(x=x, volume=volume, material=WATER, spacing=1.0 / n)
    simulation = es.Simulation(pool, boundaries=[es.Gravity(g)], interactions=[ball, *walls()], **OPTIONS)
    mass, impulse, lost = 500.0 * np.pi * 0.15**2, 0.0, 0.0
    for _ in range(120):
        simulation.step()
        impulse += sum(wall.force[1] for wall in simulation.bound_interactions[1:]) * simulation.dt
    ball = simulation.bound_interactions[0]
    p = 500.0 * simulation.v[:, 1].mean() + mass * ball.v[1]
    assert p == pytest.approx(-2.0 * mass - (500.0 + mass) * g * simulation.t - impulse, rel=1e-10)
    energy = simulation.energy()
    assert np.abs(ball.force[1]) > 2.0 * mass * g
    lost = abs(energy["interaction"])
    assert lost < 2e-3 * mass * 2.0 and abs(energy["residual"]) < 1e-10 * energy["total"]


def test_restored_tank_goes_on_as_it_was():
    """A checkpoint holds what walls put into the sums."""
    x, volume = box((0.0, 0.0), (1.0, 0.5), 0.1)
    pool = es.Body(x=x, volume=volume, material=WATER, spacing=0.1)
    push = RigidBody(Plane(normal=(1.0, 0.0)), motion=Moving(velocity=(0.2, 0.0)), name="push")
    parts = {"boundaries": [es.Gravity()], "interactions": [push, *walls()[::2]], "scheme": SCHEME}
    first, second = (es.Simulation(pool, **parts) for _ in range(2))
    first.step(7)
    held = {name: array.numpy().copy() for name, array in first.evolving().items()}
    second.restore(held, first.counters)
    for simulation in (first, second):
        simulation.step(7)
    np.testing.assert_allclose(second.x, first.x, rtol=1e-13)
    np.testing.assert_allclose(second.J, first.J, rtol=1e-12)
    assert second.energy()["interaction"] == pytest.approx(first.energy()["interaction"], abs=1e-10)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_sums_behind_planes(dim):
    """Lattices with a plane between rows have the sums of the whole lattice."""
    h, weight = 1.3, es.WendlandC4()
    along, across = behind_planes(weight, dim, h)
    z = np.linspace(0.0, weight.support, ENTRIES) * h
    axes = [np.arange(-4.0, 5.0)] * dim
    xi = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, dim)
    slope = weight.profile(wp.float64)[1]
    q = np.linalg.norm(xi, axis=1) / h
    g = np.array([float(slope(wp.float64(p))) if 0.0 < p < weight.support else 0.0 for p in q])
    g *= weight.sigma[dim - 1] / h ** (dim + 2)
    assert (g * xi[:, 0] ** 2).sum() == pytest.approx(lattice_sum(weight, dim, h), rel=1e-12)
    for k in (0, 1):
        behind = xi[:, 0] > k + 0.5
        assert np.interp(k + 0.5, z, along) / h == pytest.approx((g * xi[:, 0])[behind].sum(), abs=1e-3)
        if dim > 1:
            assert np.interp(k + 0.5, z, across) == pytest.approx((g * xi[:, 1] ** 2)[behind].sum(), abs=1e-3)


def test_solids_that_are_read_anew_cannot_be_uncorrected():
    x, volume = box((0.0, 0.0), (1.0, 1.0), 0.1)
    rubber = es.Body(x=x, volume=volume, material=es.NeoHookean(density=1e3, young=1e6, poisson=0.3))
    scheme = es.Verlet(correction=es.Uncorrected())
    with pytest.raises(ValueError, match=r"is for liquids and gases, .* got a solid whose arrangement is read anew"):
        es.Simulation(rubber, arrangement=es.Current(), scheme=scheme)


def test_liquid_rests_on_an_elastic_solid():
    """The same on rubber between two walls that touch the water alone; half as wide."""
    n, density = 16, 1e3
    x, volume = box((0.0, 0.0), (0.5, 1.0), 1.0 / n)
    water = es.Body(x=x, volume=volume, material=WATER, spacing=1.0 / n, name="water")
    x, volume = box((-0.25, -0.25), (0.75, 0.0), 1.0 / n)
    rubber = es.NeoHookean(density=density, young=4e6, poisson=0.3)
    bed = es.Body(x=x, volume=volume, material=rubber, spacing=1.0 / n, name="bed")
    planes = [(1.0, 0.0), (-1.0, 0.0)]
    sides = [
        RigidBody(Plane(normal=n), centre=(0.25 - 0.25 * n[0], 0.0), bodies=["water"], name=f"side {n[0]}")
        for n in planes
    ]
    held = es.Fixed(lambda X: X[:, 1] < -0.25 + 1.0 / n)
    conditions = [es.BodyForce(filling_up, body="water"), es.Damping(30.0), held]
    simulation = es.Simulation([water, bed], boundaries=conditions, interactions=[es.Contact(), *sides], **OPTIONS)
    found, own = [], slice(0, len(water.x))
    for t in (RAMP + 25.0 / SOUND, RAMP + 50.0 / SOUND):
        simulation.run(t)
        x = simulation.x[own]
        depth = x[:, 1].max() + 0.5 / n - x[:, 1]
        error = -simulation.cauchy_stress[own, 0, 0] / (1e3 * WEIGHT) - depth
        assert np.sqrt(np.mean(error**2)) < 0.01
        found.append(x[:, 1].mean())
    assert abs(found[1] - found[0]) < 2e-4
    pressed = simulation.interaction_force[len(water.x) :, 1].sum()
    assert pressed == pytest.approx(-500.0 * WEIGHT, rel=5e-3)
    energy = simulation.energy()
    assert abs(energy["interaction"]) < 1e-10 and abs(energy["residual"]) < 1e-10 * energy["total"]


@pytest.mark.parametrize(("dim", "real"), [(1, wp.float64), (2, wp.float64), (3, wp.float64), (2, wp.float32)])
def test_liquid_hits_a_free_solid(dim, real):
    """A blob hits a block: both momenta as they were, nothing made where they meet, nothing through it."""
    n = {1: 16, 2: 8, 3: 5}[dim]
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / n)
    velocity = np.zeros(dim)
    velocity[0] = -3.0
    water = dataclasses.replace(WATER, cavitation=0.0)
    blob = es.Body(x=x, volume=volume, material=water, spacing=1.0 / n, velocity=velocity, name="blob")
    shift = np.full(dim, 0.2 / n)
    shift[0] = -3.0 / n
    x, volume = box(tuple(shift), tuple(shift + np.array([3.0 / n, *[1.0] * (dim - 1)])), 1.0 / n)
    rubber = es.NeoHookean(density=700.0, young=2e6, poisson=0.3)
    block = es.Body(x=x, volume=volume, material=rubber, spacing=1.0 / n, name="block")
    simulation = es.Simulation([blob, block], interactions=[es.Contact()], **OPTIONS, dtype=real)
    mass = simulation.order.by_number(simulation.stepper.particles.mass.numpy()).astype(float)
    start = mass @ simulation.v
    simulation.run(0.15)
    tolerance = 1e-12 if real is wp.float64 else 1e-5
    np.testing.assert_allclose(mass @ simulation.v, start, atol=tolerance * np.abs(start).max())
    energy = simulation.energy()
    assert abs(energy["interaction"]) < max(tolerance, 1e-12) * energy["total"] * 10.0
    assert abs(energy["residual"]) < 10.0 * tolerance * energy["total"]
    speed = simulation.v[len(blob.x) :, 0].mean()
    assert speed < -1.0 and simulation.x[: len(blob.x), 0].min() > simulation.x[len(blob.x) :, 0].max() - 0.75 / n
    if dim == 2 and real is wp.float64:
        x, v, own = simulation.x, simulation.v, slice(0, len(blob.x))
        turned = mass[own] @ (-3.0 * -blob.x[:, 1])
        assert mass @ (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0]) == pytest.approx(turned, rel=1e-3)


def test_light_solids_ask_for_shorter_steps():
    """Foam of a fiftieth of the water's density, as fast in sound: steps are stable, and make next to no energy.

    Without the bound it is unstable within 106 steps; at 1.2 times the step, CFL 1.2, it is stable, at twice it is not.
    """
    n, sound = 10, 20.0
    x, volume = box((0.0, -0.4), (1.0, 0.0), 1.0 / n)
    modulus, poisson, density = 20.0 * sound**2, 0.3, 20.0
    young = modulus * (1.0 + poisson) * (1.0 - 2.0 * poisson) / (1.0 - poisson)
    foam = es.NeoHookean(density=density, young=young, poisson=poisson)
    bed = es.Body(x=x, volume=volume, material=foam, spacing=1.0 / n, name="foam")
    x, volume = box((0.0, 0.0), (1.0, 0.6), 1.0 / n)
    water = es.TaitLiquid(density=1e3, sound_speed=sound)
    pool = es.Body(x=x, volume=volume, material=water, spacing=1.0 / n, name="water")
    sides = [
        RigidBody(Plane((side, 0.0)), centre=(0.5 - 0.5 * side, 0.0), bodies=["water"], name=f"side {side:.0f}")
        for side in (1.0, -1.0)
    ]
    held = es.Fixed(lambda X: X[:, 1] < -0.3, body="foam")
    conditions = [es.BodyForce((0.0, -0.1)), held]
    simulation = es.Simulation([bed, pool], boundaries=conditions, interactions=[*sides, es.Contact()])
    simulation.run(0.2)
    assert 0.25 < simulation.dt * sound * n / 0.8 < 0.4  # of the step by waves alone
    energy = simulation.energy()
    assert abs(energy["stepping"]) < 1e-3 * energy["total"]


def test_nothing_leaks_through_two_particles():
    """Water at 150 m/s, a tenth of its speed of sound, on a steel plate two particles thick, held at its ends."""
    n = 20
    x, volume = box((0.0, 0.5 / n), (1.0, 0.5 + 0.5 / n), 1.0 / n)
    water = es.TaitLiquid(density=1e3, sound_speed=1480.0, cavitation=0.0)
    pour = es.Body(x=x, volume=volume, material=water, velocity=(0.0, -150.0), spacing=1.0 / n, name="water")
    x, volume = box((-0.5, -2.0 / n), (1.5, 0.0), 1.0 / n)
    steel = es.NeoHookean(density=7800.0, young=2e11, poisson=0.3)
    plate = es.Body(x=x, volume=volume, material=steel, spacing=1.0 / n, name="plate")
    held = es.Fixed(lambda X: (X[:, 1] < 0.0) & (np.abs(X[:, 0] - 0.5) > 0.9))
    simulation = es.Simulation([pour, plate], boundaries=[held], interactions=[es.Contact()], scheme=SCHEME)
    simulation.run(3.3e-3)
    own = len(pour.x)
    x, solid = simulation.x[:own], simulation.x[own:]
    layer = solid[np.isclose(plate.x[:, 1], -0.5 / n)]
    layer = layer[np.argsort(layer[:, 0])]
    assert (x[:, 1] > np.interp(x[:, 0], layer[:, 0], layer[:, 1])).all()
    assert np.abs(simulation.v[own:]).max() > 10.0
    energy = simulation.energy()
    assert abs(energy["interaction"]) < 1e-12 * energy["total"] and abs(energy["residual"]) < 1e-12 * energy["total"]


def told_of_thin(x, volume, spacing, caplog):
    """What is said of a solid of particles ``x`` beside water of spacing 1, whose weight reaches 3.1 into it."""
    dim = x.shape[1]
    pool, each = box((0.0,) * dim, (8.0, *[4.0] * (dim - 1)), 1.0)
    water = es.Body(x=pool - 12.0, volume=each, material=WATER, spacing=1.0, name="water")
    rubber = es.NeoHookean(density=1000.0, young=1e6, poisson=0.3)
    solid = es.Body(x=x, volume=volume, material=rubber, spacing=spacing, name="solid")
    es.Simulation([solid, water], interactions=[es.Contact()])
    return [record.getMessage() for record in caplog.records if "thick" in record.getMessage()]


SIDES = ["4", "3", "16 4", "16 3", "4 4", "3 3", "4 4 4", "3 3 3", "12 12 4", "12 12 2", "12 4 4", "12 3 3"]


@pytest.mark.parametrize("spacing", [0.5, 1.0])
@pytest.mark.parametrize("sides", SIDES)
def test_solids_thinner_than_the_liquid_reaches_are_told(sides, spacing, caplog):
    """Plates, rods, cubes: their shortest side counts, 3.6 spacings of the liquid less half of one are its reach."""
    sides = [float(side) for side in sides.split()]
    lines = told_of_thin(*box((0.0,) * len(sides), sides, spacing), spacing, caplog)
    assert len(lines) == (min(sides) < 3.1)
    if lines:
        assert f"'solid' is {min(sides):g} m thick," in lines[0] and "'water' reaches 3.1 m into" in lines[0]
        assert f"should be {min(sides) / 3.1:.3g} m or less, is 1 m" in lines[0]


@pytest.mark.parametrize("hollow", [False, True])
@pytest.mark.parametrize(("dim", "radius"), [(2, 2.0), (2, 1.4), (3, 2.0), (3, 1.4)])
def test_round_solids_are_as_thick_as_their_diameter(dim, radius, hollow, caplog):
    """Or as their wall; where surfaces are is known to half a spacing each."""
    x, volume = box((-8.0,) * dim, (8.0,) * dim, 0.4)
    r = np.linalg.norm(x, axis=1)
    inside = (r > 6.0) & (r < 6.0 + radius) if hollow else r < radius
    lines = told_of_thin(x[inside], np.broadcast_to(volume, len(x))[inside], 0.4, caplog)
    thick = radius if hollow else 2.0 * radius
    assert len(lines) == (thick < 3.1)
    if lines:
        assert float(lines[0].split("is ")[1].split(" m")[0]) == pytest.approx(thick, abs=0.4)


def test_solids_bonded_to_something_thick_are_not_thin(caplog):
    """A coat of one layer, by itself too thin."""
    rubber = es.NeoHookean(density=1000.0, young=1e6, poisson=0.3)
    bodies = [es.Body(x=box((0.0, -9.0), (8.0, -4.0), 1.0)[0], volume=1.0, material=WATER, name="water")]
    bodies += [es.Body(x=box((0.0, 1.0), (8.0, 5.0), 1.0)[0], volume=1.0, material=rubber, name="block")]
    coat = es.Body(x=box((0.0, 0.0), (8.0, 1.0), 1.0)[0], volume=1.0, material=rubber, name="coat", bonded="block")
    es.Simulation([*bodies, coat], interactions=[es.Contact()])
    assert not [record for record in caplog.records if "thick" in record.getMessage()]


def test_a_coat_is_as_thick_as_what_it_is_bonded_to(caplog):
    x, volume = box((0.0, 0.0), (2.0, 0.4), 0.05)
    pool = es.Body(x=x, volume=volume, material=WATER, spacing=0.05, name="water")
    rubber = es.NeoHookean(density=1000.0, young=1e6, poisson=0.3)
    x, volume = box((0.0, -0.1), (2.0, 0.0), 0.05)
    coat = es.Body(x=x, volume=volume, material=rubber, spacing=0.05, name="coat")
    x, volume = box((0.0, -0.4), (2.0, -0.1), 0.05)
    base = es.Body(x=x, volume=volume, material=rubber, spacing=0.05, name="base", bonded="coat")
    for solids, told in (([coat], True), ([coat, base], False)):
        caplog.clear()
        es.Simulation([*solids, pool], interactions=[es.Contact()])
        assert any("thick" in record.getMessage() for record in caplog.records) == told
