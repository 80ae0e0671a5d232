"""Every boundary condition against an outcome in closed form, the forms of its values, and its errors."""

import math

import numpy as np
import pytest
import warp as wp
from bodies import COMPRESSIBLE
from scipy.optimize import brentq

import warp_eulsph as es
from warp_eulsph.boundaries import Antisymmetry, BodyForce, Pressure, Roller, Traction, Wall, mirror
from warp_eulsph.materials import Bar
from warp_eulsph.scheme.smoothing import NeighbourAverage
from warp_eulsph.validation.cases.bar import DENSITY, LENGTH, SPEED, WAVE_SPEED, YOUNG
from warp_eulsph.validation.cases.bar import exact as bar_exact

DX = 0.1


def lattice(*counts: int) -> np.ndarray:
    ticks = np.meshgrid(*[np.arange(count) for count in counts], indexing="ij")
    return (np.stack(ticks, -1).reshape(-1, len(counts)) + 0.5) * DX


def block(*counts: int, **options) -> es.Body:
    return es.Body(x=lattice(*counts), volume=DX ** len(counts), **{"material": COMPRESSIBLE, **options})


def external(simulation: es.Simulation) -> np.ndarray:
    """External forces [N] at the present state, (n, dim)."""
    forces = wp.zeros_like(simulation.stepper.forces.external)
    for condition in simulation.conditions:
        condition.load(simulation.stepper.U, simulation.clock.fields, 0.0, forces)
    return forces.numpy().copy()


# body force, roller, velocity


@pytest.mark.parametrize("reference", [es.Never(), es.Always()], ids=repr)
@pytest.mark.parametrize("counts", [(8,), (5, 4), (4, 4, 4)], ids=str)
@pytest.mark.parametrize(("dtype", "tolerance"), [(wp.float64, 1e-13), (wp.float32, 1e-5)])
def test_free_fall_is_exact(counts, reference, dtype, tolerance):
    dim = len(counts)
    g = np.array([-9.81, 0.5, 2.0])[:dim]
    body = block(*counts, velocity=(1.0, 2.0, 3.0)[:dim])
    options = {"reference": reference, "time_step": es.TimeStep(fixed=1e-4), "dtype": dtype}
    simulation = es.Simulation(body, boundaries=[BodyForce(g)], **options)
    simulation.step(50)
    t = simulation.t
    # round-off of the positions, felt as stress: tolerance · c, c = 145 m/s
    np.testing.assert_allclose(simulation.v, body.velocity + g * t, rtol=0, atol=tolerance * 145.0)
    np.testing.assert_allclose(simulation.x, body.x + body.velocity * t + 0.5 * g * t**2, rtol=0, atol=tolerance)


@pytest.mark.parametrize("counts", [(8,), (5, 4), (4, 4, 4)], ids=str)
def test_gravity_pulls_one_body_down_the_last_axis(counts):
    dim = len(counts)
    far = np.eye(dim)[0] * 10.0
    a, b = block(*counts, name="a"), es.Body(x=block(*counts).x + far, volume=DX**dim, material=COMPRESSIBLE, name="b")
    simulation = es.Simulation([a, b], boundaries=[es.Gravity(body="a")], time_step=es.TimeStep(fixed=1e-4))
    simulation.step(10)
    fallen = np.zeros((2 * len(a.x), dim))
    fallen[: len(a.x), -1] = -9.81e-3
    np.testing.assert_allclose(simulation.v, fallen, atol=1e-11)
    with pytest.raises(ValueError, match=r"Gravity: g must be finite, got inf"):
        es.Gravity(np.inf)


@pytest.mark.parametrize("normal", [(3.0, 4.0), (1.0, -2.0, 2.0)], ids=str)
def test_roller_is_an_inclined_plane(normal):
    body, g = block(*(4,) * len(normal)), np.array([0.0, -10.0, 1.0])[: len(normal)]
    conditions = [BodyForce(g), Roller(None, normal)]
    simulation = es.Simulation(body, boundaries=conditions, time_step=es.TimeStep(fixed=1e-4))
    simulation.step(20)
    n = np.array(normal) / np.linalg.norm(normal)
    slide = (g - n * (g @ n)) * simulation.t
    np.testing.assert_allclose(simulation.v, np.broadcast_to(slide, body.x.shape), atol=1e-12)


def test_velocity_holds_some_axes_of_one_body():
    a = block(4, 4, name="a", velocity=(1.0, 1.0))
    b = es.Body(
        x=lattice(4, 4) + np.array([3.0, 0.0]), volume=DX**2, material=COMPRESSIBLE, velocity=(1.0, 1.0), name="b"
    )
    condition = es.Velocity(lambda X: X[:, 1] > 0.2, lambda x, t: 5.0 * t, axes=[0], body="b")
    simulation = es.Simulation([a, b], boundaries=[condition], time_step=es.TimeStep(fixed=1e-4))
    simulation.step(3)
    held = np.flatnonzero(b.x[:, 1] > 0.2) + 16
    np.testing.assert_allclose(simulation.v[held, 0], 5.0 * simulation.t, rtol=1e-14)
    assert np.abs(simulation.v[held, 1] - 1.0).max() > 0.0  # free, and shaken by the neighbours
    np.testing.assert_allclose(simulation.v[:16], 1.0, rtol=1e-12)


# pressure, traction


def test_pressure_on_a_closed_surface_has_no_resultant():
    simulation = es.Simulation(block(6, 5), boundaries=[Pressure(3.0e5)])
    simulation.step(20)
    forces, x = external(simulation), simulation.x
    size = np.abs(forces).sum()
    assert size > 3.0e5  # it acts
    assert np.abs(forces.sum(axis=0)).max() <= 1e-3 * size
    fresh = es.Simulation(block(6, 5), boundaries=[Pressure(3.0e5)])
    forces, x = external(fresh), fresh.x
    torque = (x[:, 0] * forces[:, 1] - x[:, 1] * forces[:, 0]).sum()
    assert np.abs(forces.sum(axis=0)).max() <= 1e-14 * size
    assert abs(torque) <= 1e-14 * size
    # on one half, whose open end is deeper than two support radii beneath the face: p times the face
    half = es.Simulation(block(16, 5), boundaries=[Pressure(3.0e5, lambda X: X[:, 0] > 0.8)])
    np.testing.assert_allclose(external(half).sum(axis=0), [-3.0e5 * 0.5, 0.0], rtol=1e-13, atol=1e-8)


@pytest.mark.parametrize(
    ("reference", "correction", "tolerance"),
    [
        (es.Never(), None, 1e-10),
        (es.Always(), es.PairAreas(kappa=math.inf), 5e-4),  # conjugate gradients of 5 iterations
        (es.Always(), es.PairAreas(kappa=math.inf, iterations=60), 1e-9),
        (es.Always(), es.PairAreas(), 0.03),  # M12 admits no more force than the dissipation of a body almost at rest
    ],
    ids=["total", "eulerian", "converged", "limited"],
)
def test_pressure_is_in_equilibrium_with_the_cauchy_stress(reference, correction, tolerance):
    """A square compressed by λ with σ = −p I stays at rest: the follower force is −p times the present area."""
    p, mu, kappa = 2.0e6, 17e6 / 2.6, 17e6 / 1.2

    def cauchy(stretch):  # plane strain, F = λ I: σ = κ (J − 1) + μ J^(−5/3) (λ² − I1/3)
        J = stretch**2
        return kappa * (J - 1.0) + mu * J ** (-5 / 3) * (stretch**2 - (2 * stretch**2 + 1.0) / 3.0)

    stretch = brentq(lambda s: cauchy(s) + p, 0.7, 1.0)
    assert stretch < 0.97
    scheme = es.LaxWendroff(correction=correction)
    simulation = es.Simulation(block(6, 6), boundaries=[Pressure(p)], reference=reference, scheme=scheme)
    U = simulation.stepper.U
    for field, factor in ((U.x, stretch), (U.F, stretch), (U.surface, stretch)):
        field.assign(field.numpy() * factor)
    start = simulation.x
    simulation.step(20)
    assert np.abs(simulation.v).max() <= tolerance * p / (1100.0 * 145.0)  # of what the pressure alone would cause
    assert np.abs(simulation.x - start).max() <= tolerance * DX


def bar_of(cells: int) -> es.Body:
    x = (np.arange(cells) + 0.5)[:, None] / cells
    return es.Body(x=x, volume=1.0 / cells, material=Bar(density=1000.0, young=1e9))


def test_traction_elongates_a_bar():
    """u = t X / E is in equilibrium, particle by particle."""
    t, body = 1e6, bar_of(20)
    conditions = [es.Fixed(lambda X: X[:, 0] < 0.3), Traction([t], [1.0], lambda X: X[:, 0] > 0.5)]
    simulation = es.Simulation(body, boundaries=conditions, reference=es.Never())
    U = simulation.stepper.U
    U.x.assign(body.x * (1.0 + t / 1e9))
    U.F.assign(np.full((20, 1, 1), 1.0 + t / 1e9))
    simulation.step(50)
    assert np.abs(simulation.v).max() <= 1e-9 * t / (1000.0 * 1000.0)  # of the velocity t/(ρ c) of an impact
    np.testing.assert_allclose(simulation.x, body.x * (1.0 + t / 1e9), rtol=0, atol=1e-13)


def test_sudden_traction_sends_a_wave():
    """After L/c the wave has crossed the bar: stress t everywhere, velocity t/(ρ c), the end moved by t L/E."""
    t, body = 1e6, bar_of(80)
    simulation = es.Simulation(body, boundaries=[Traction([t], [1.0], lambda X: X[:, 0] > 0.8)], reference=es.Never())
    simulation.run(0.9 * 1e-3)  # c = 1000 m/s, L = 1 m: the front is at 0.1
    u = simulation.x - body.x
    assert u[-1, 0] == pytest.approx(0.9 * t / 1e9, rel=0.01)
    crossed = (body.x[:, 0] > 0.25) & (body.x[:, 0] < 0.9)
    # means, because a central scheme oscillates behind the front
    assert simulation.v[crossed].mean() == pytest.approx(t / 1e6, rel=0.01)
    assert 1e9 * (simulation.F[crossed, 0, 0] - 1.0).mean() == pytest.approx(t, rel=0.01)
    assert np.abs(simulation.v[body.x[:, 0] < 0.02]).max() < 0.1  # ahead of the front


def test_traction_sums_to_the_area_of_the_face(caplog):
    condition = Traction((2.0, 3.0), (5.0, 0.0), lambda X: X[:, 0] > 0.4)
    simulation = es.Simulation(block(10, 6), boundaries=[condition])
    np.testing.assert_allclose(external(simulation).sum(axis=0), np.array([2.0, 3.0]) * 0.6, rtol=1e-13)
    shallow = es.Simulation(block(10, 6), boundaries=[Traction((2.0, 3.0), (1.0, 0.0), lambda X: X[:, 0] > 0.9)])
    np.testing.assert_allclose(external(shallow), external(simulation), rtol=1e-13)
    assert not caplog.text


def test_loads_on_a_cube():
    """Pressure on the closed surface has no resultant and no torque; the traction sums to the area of the face."""
    simulation = es.Simulation(block(5, 5, 5), boundaries=[Pressure(2.0)])
    forces, x = external(simulation), simulation.x
    size = np.abs(forces).sum()
    assert size > 6 * 2.0 * 0.25
    assert np.abs(forces.sum(axis=0)).max() <= 1e-14 * size
    assert np.abs(np.cross(x, forces).sum(axis=0)).max() <= 1e-14 * size
    traction = Traction((1.0, 2.0, 3.0), (0.0, 1.0, 0.0), lambda X: X[:, 1] > 0.4)
    simulation = es.Simulation(block(4, 10, 5), boundaries=[traction])
    np.testing.assert_allclose(external(simulation).sum(axis=0), np.array([1.0, 2.0, 3.0]) * 0.2, rtol=1e-12)


# the forms of a value


@wp.func
def vector_of_x_and_t(x: wp.vec2d, t: wp.float64):
    return x * t


@wp.func
def scalar_of_x_and_t(x: wp.vec2d, t: wp.float64):
    return x[1] * t


@wp.func
def constant_vector(x: wp.vec2d, t: wp.float64):
    return wp.vec2d(wp.float64(0.3), wp.float64(-0.7))


MAKERS = {
    "velocity": lambda value: es.Velocity(lambda X: X[:, 0] < 0.2, value),
    "body force": lambda value: BodyForce(value),
    "traction": lambda value: Traction(value, (1.0, 0.0), lambda X: X[:, 0] > 0.2),
}


def ran(condition: es.Boundary) -> np.ndarray:
    simulation = es.Simulation(block(5, 4), boundaries=[condition], time_step=es.TimeStep(fixed=1e-3))
    simulation.step(3)
    return np.concatenate([simulation.x, simulation.v], axis=1)


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS.keys())
def test_forms_of_values_give_the_same_bits(make):
    device, host = ran(make(vector_of_x_and_t)), ran(make(lambda x, t: x * t))
    assert np.array_equal(device, host)
    forms = [(0.3, -0.7), constant_vector, lambda x, t: (0.3, -0.7), lambda x, t: np.full((len(x), 2), (0.3, -0.7))]
    results = [ran(make(form)) for form in forms]
    count = len(es.Simulation(block(5, 4), boundaries=[make(0.0)]).conditions[0].indices)
    results.append(ran(make(np.tile([0.3, -0.7], (count, 1)))))
    for kind in ([results[0], results[4]], results[1:4]):  # constants are steady: round-off apart from functions
        assert all(np.array_equal(result, kind[0]) for result in kind[1:])
    np.testing.assert_allclose(results[0], results[2], rtol=1e-12)
    assert not np.array_equal(results[0], device)


def test_forms_of_a_scalar_value_give_the_same_bits():
    device, host = ran(Pressure(scalar_of_x_and_t)), ran(Pressure(lambda x, t: x[:, 1] * t))
    assert np.array_equal(device, host)
    assert np.array_equal(ran(Pressure(0.3)), ran(Pressure(np.full(20, 0.3))))
    assert not np.array_equal(device, ran(Pressure(0.3)))


# mirror ghosts


@pytest.mark.parametrize(
    ("reference", "scheme"),
    [(es.Never(), es.LaxWendroff()), (es.Always(), es.LaxWendroff(correction=None))],
    ids=["total", "eulerian"],
)
def test_quarter_with_walls_equals_the_full_problem(reference, scheme):
    """A square that explodes symmetrically, and its quarter behind two walls, corner ghosts included."""

    def velocity(x):
        return 40.0 * x * np.array([1.0, -0.5]) * (1.0 + x[:, :1] ** 2) * (1.0 + 2.0 * x[:, 1:] ** 2)

    x = lattice(12, 12) - 0.6
    full = es.Body(x=x, volume=DX**2, material=COMPRESSIBLE, velocity=velocity(x))
    x = lattice(6, 6)
    quarter = es.Body(x=x, volume=DX**2, material=COMPRESSIBLE, velocity=velocity(x))
    depth = 3 * 2.0 * 1.3 * DX
    ghosted, left = mirror(quarter, point=(0, 0), normal=(-1, 0), depth=depth)
    ghosted, bottom = mirror(ghosted, point=(0, 0), normal=(0, -2), depth=depth, image=Wall())
    options = {"reference": reference, "scheme": scheme, "time_step": es.TimeStep(fixed=1e-4)}
    whole, part = es.Simulation(full, **options), es.Simulation(ghosted, boundaries=[left, bottom], **options)
    whole.step(40)
    part.step(40)
    same = (full.x > 0).all(axis=1)
    assert np.abs(whole.F[same] - np.eye(2)).max() > 0.1
    # round-off of sums in another order, amplified by the steps
    np.testing.assert_allclose(part.x[:36], whole.x[same], rtol=0, atol=1e-12)
    np.testing.assert_allclose(part.v[:36], whole.v[same], rtol=0, atol=1e-9)
    np.testing.assert_allclose(part.F[:36], whole.F[same], rtol=0, atol=1e-11)


def test_half_of_a_block_equals_the_whole_behind_an_oblique_wall():
    """In 3-D, the whole turned by a rotation, so that the normal is along no axis."""
    turn, _ = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))
    x = lattice(8, 3, 3) - np.array([0.4, 0.0, 0.0])
    v = 30.0 * x * (1.0 + x[:, :1] ** 2) * (1.0 + x[:, 1:2])
    half = x[:, 0] > 0
    whole = es.Body(x=x @ turn.T, volume=DX**3, material=COMPRESSIBLE, velocity=v @ turn.T)
    part = es.Body(x=x[half] @ turn.T, volume=DX**3, material=COMPRESSIBLE, velocity=v[half] @ turn.T)
    part, wall = mirror(part, point=(0, 0, 0), normal=-turn[:, 0], depth=3 * 2.0 * 1.3 * DX)
    step = es.TimeStep(fixed=1e-4)
    full = es.Simulation(whole, reference=es.Never(), time_step=step)
    walled = es.Simulation(part, boundaries=[wall], reference=es.Never(), time_step=step)
    full.step(10)
    walled.step(10)
    np.testing.assert_allclose(walled.v[: half.sum()], full.v[half], rtol=0, atol=1e-10)
    assert np.abs(full.v[half] - whole.velocity[half]).max() > 1.0


def test_exact_bar_has_the_published_shape():
    """Trapezoid of the end displacement: rise, plateau, fall, period."""
    end = np.array([LENGTH])
    assert pytest.approx(5053.019, abs=5e-4) == WAVE_SPEED
    assert bar_exact(end, 6.5951e-6)[0][0] == pytest.approx(3.297534e-5, rel=1e-5)
    assert bar_exact(end, 6.5951e-6 / 2)[0][0] == pytest.approx(3.297534e-5 / 2, rel=1e-5)
    assert bar_exact(end, 4.6165e-5)[0][0] == pytest.approx(3.297534e-5, rel=1e-5)
    assert abs(bar_exact(end, (4.61655e-5 + 5.93556e-5) / 2)[0][0]) <= 1e-5 * 3.297534e-5
    assert bar_exact(end, 5.93556e-5)[0][0] == pytest.approx(-3.297534e-5, rel=1e-5)
    assert [bar_exact(end, t)[1][0] for t in (3e-6, 3e-5, 5e-5)] == pytest.approx([5.0, 0.0, -5.0])
    x = np.linspace(0, LENGTH, 7)
    np.testing.assert_allclose(bar_exact(x, 1e-5)[0], bar_exact(x, 1e-5 + 1.055211e-4)[0], atol=1e-10)
    np.testing.assert_allclose(bar_exact(x[:1], 3.3e-5), 0.0, atol=1e-18)


def test_bar_is_nodally_exact_at_courant_number_two():
    """The paper's impacted bar with a 3-particle support: two cells a step, reflected without error at both ends."""
    dx = LENGTH / 40
    x = (np.arange(40) + 0.5)[:, None] * dx
    velocity = np.where(x > 0.75 * LENGTH, SPEED, 0.0)
    body = es.Body(x=x, volume=dx, material=Bar(density=DENSITY, young=YOUNG), velocity=velocity)
    body, fixed_end = mirror(body, point=[0.0], normal=[-1.0], depth=4 * dx)
    body, free_end = mirror(body, point=[LENGTH], normal=[1.0], depth=4 * dx, image=Antisymmetry())
    assert len(body.x) == 48
    simulation = es.Simulation(
        body,
        boundaries=[fixed_end, free_end],
        reference=es.Never(),
        scheme=es.LaxWendroff(smoothing=NeighbourAverage(), dissipation=None),
        dilation=1.0,
        time_step=es.TimeStep(fixed=2 * dx / WAVE_SPEED),
    )
    # F − 1 is about 5e-4, kept to 1e-16: each step adds round-off of up to c · 1e-16 = 5e-13 m/s
    for steps, tolerance in ((1, 1e-12), (20, 1e-12), (379, 379 * 5e-13)):
        simulation.step(steps - simulation.steps)
        np.testing.assert_allclose(simulation.v[:40, 0], bar_exact(x[:, 0], simulation.t)[1], rtol=0, atol=tolerance)
    assert simulation.t == pytest.approx(5e-4, rel=1e-3)


# errors


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        (es.Fixed(lambda X: X[:, 0] > 99.0), r"^Fixed: the region selects no particle; positions lie in .* bodies are"),
        (es.Fixed([]), "^Fixed: the region selects no particle"),
        (es.Fixed(body="plate"), r"body must be one of \['body'\], got 'plate'"),
        (es.Fixed(lambda X: X[:, 0]), r"predicate must return \(20,\) bool .* got \(20,\) float64"),
        (es.Fixed(lambda X: X > 0.0), r"predicate must return \(20,\) bool .* got \(20, 2\) bool"),
        (es.Fixed(np.ones(7, dtype=bool)), r"mask must have shape \(20,\), got \(7,\)"),
        (es.Fixed([3, 20]), r"indices must be integers in \[0, 20\)"),
        (es.Fixed([-1]), r"indices must be integers in \[0, 20\)"),
        (es.Fixed([0.5]), r"indices must be integers"),
        (es.Fixed(axes=[2]), r"axes must be among \[0, 1\], got \[2\]"),
        (es.Fixed(axes=[]), r"axes must be among"),
        (es.Velocity(value=np.nan), "Velocity: values must be finite"),
        (es.Velocity(value=(1.0, 2.0, 3.0)), r"values must be a number, \(2,\) or \(20, 2\), got shape \(3,\)"),
        (es.Velocity(value=np.zeros((7, 2))), r"got shape \(7, 2\)"),
        (es.Velocity(value=lambda x, t: np.full(3, np.inf)), "Velocity: values must be finite"),
        (BodyForce((0.0, np.inf)), "BodyForce: values must be finite"),
        (Pressure(np.zeros(7)), r"Pressure: values must be a number, \(1,\) or \(20, 1\), got shape \(7,\)"),
        (Pressure(1.0, body="x"), "Pressure: body must be one of"),
        (Traction((1.0, 0.0), (0.0, 0.0)), "Traction: normal must be"),
        (Traction((1.0, 0.0), (0.0, 0.0, 1.0)), r"Traction: normal must be \(2,\) finite"),
        (Roller(None, (np.nan, 1.0)), "Roller: normal must be"),
    ],
)
def test_errors(condition, message):
    with pytest.raises(ValueError, match=message):
        es.Simulation(block(5, 4), boundaries=[condition])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"normal": (0.0, 0.0)}, "mirror: normal must be"),
        ({"point": (0.0,)}, r"mirror: point must be \(2,\) finite numbers"),
        ({"point": (0.05, 0.0)}, "in front of the plane and off it, got particle 0.*half a spacing"),
        ({"normal": (1.0, 0.0)}, "in front of the plane"),
        ({"depth": 0.01}, "no particle within depth 0.01 m of the plane, the nearest is 0.05 m away"),
        ({"image": Antisymmetry()}, "Antisymmetry needs a linear law such as Bar or LinearElastic, got NeoHookean"),
    ],
)
def test_mirror_errors(change, message):
    with pytest.raises(ValueError, match=message):
        mirror(block(5, 4), **{"point": (0.0, 0.0), "normal": (-1.0, 0.0), "depth": 0.5, **change})


def test_free_end_needs_a_linear_law():
    body = es.Body(x=lattice(8), volume=DX, material=COMPRESSIBLE)
    with pytest.raises(ValueError, match="linear law such as Bar or LinearElastic, got NeoHookean"):
        mirror(body, point=[0.0], normal=[-1.0], depth=0.5, image=Antisymmetry())
