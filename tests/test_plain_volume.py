"""Volume inside by plain sums, pressure by their adjoint (M29): what it sees, conservation, bits."""

import functools

import numpy as np
import pytest
import warp as wp
from test_execution import DTYPES, assert_equal_to_round_off, results
from test_resume import resume_is_exact

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.geometry import box
from warp_eulsph.validation.cases import metal_punch

RUBBER = es.NeoHookean(density=1e3, young=1e6, poisson=0.4)
SIDES = {1: 40, 2: 20, 3: 12}


def block(dim, jitter=0.15, scheme=es.Verlet(correction=es.PlainVolume()), speed=1.0, **options):
    """A block in irregular motion, with particles inside."""
    n = SIDES[dim]
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / n, jitter=jitter)
    velocity = speed * np.random.default_rng(2).normal(size=x.shape)
    body = es.Body(x=x, volume=volume, spacing=1.0 / n, material=RUBBER, velocity=velocity)
    return es.Simulation(body, arrangement=es.Current(), scheme=scheme, **options)


def gradients(simulation):
    """∇v, the gradient that moves F, and who is inside."""
    medium = simulation.stepper.medium
    medium.velocity_gradient(simulation.stepper.U)
    exact = medium.grad_v.numpy().copy()
    return exact, medium.stabiliser.moving(medium.grad_v).numpy(), medium.stabiliser.inside.numpy()


@functools.cache
def weight_of_pairs(dim, h):
    """W of the cubic spline, (r,) -> (r,)."""
    sigma = es.CubicSpline().sigma[dim - 1]

    def W(r):
        q = r / h
        return sigma / h**dim * np.where(q < 1.0, 1.0 - 1.5 * q**2 + 0.75 * q**3, 0.25 * np.maximum(2.0 - q, 0.0) ** 3)

    return W


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_volume_is_that_of_a_sum_over_positions(dim):
    """Inside tr of what moves F is −κ d/dt Σ V_b W_ab, here by central differences, and all else is as it was."""
    simulation = block(dim)
    exact, moving, inside = gradients(simulation)
    x, v, h = simulation.x, simulation.v, 1.3 / SIDES[dim]
    W, V, dt = weight_of_pairs(dim, h), simulation.particles.V0.numpy(), 1e-6

    def density(x):
        sums = np.zeros(len(x))
        for a in range(len(x)):
            sums[a] = W(np.linalg.norm(x - x[a], axis=1)) @ V
        return sums

    rate = -(density(x + dt * v) - density(x - dt * v)) / (2.0 * dt)
    within = inside > 0.0
    assert 0.05 < within.mean() < 0.95
    trace = np.trace(moving, axis1=1, axis2=2)
    assert trace[within] == pytest.approx((inside * rate)[within], rel=1e-5, abs=1e-5 * np.abs(trace).max())
    assert np.array_equal(moving[~within], exact[~within])
    change = moving - exact
    shear = change - np.trace(change, axis1=1, axis2=2)[:, None, None] * np.eye(dim) / dim
    assert np.abs(shear).max() < 1e-12 * np.abs(exact).max()
    assert np.abs(change).max() > 1e-2 * np.abs(exact[within]).max()


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_on_a_lattice_it_is_the_exact_gradient(dim):
    exact, moving, inside = gradients(block(dim, jitter=0.0))
    # κ is of h/spacing to six digits
    assert (inside > 0.0).any() and np.abs(moving - exact).max() < 1e-6 * np.abs(exact).max()


@pytest.mark.parametrize("reference", [es.Always(), es.Every(3)], ids=repr)
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_books_and_momentum_close(dim, reference):
    """To round-off: forces are the adjoint of what moves F. Steps are short, for the fastest waves there are."""
    simulation = block(dim, reference=reference, time_step=es.TimeStep(cfl=0.2))
    start, momentum = simulation.energy()["total"], simulation.momentum()
    simulation.step(30)
    energy, mass = simulation.energy(), simulation.particles.mass.numpy().sum()
    assert abs(energy["residual"]) < 1e-12 * start and abs(energy["stepping"]) < 1e-2 * start
    assert np.abs(simulation.momentum() - momentum).max() < 1e-12 * mass


def test_angular_momentum():
    """A spinning block under pressure, stirred: lost is what M9 takes, and a part that falls with the step."""
    drift = {}
    for cfl in (0.4, 0.1):
        scheme = es.Verlet(correction=es.PlainVolume(), dissipation=None)
        simulation = block(2, scheme=scheme, speed=0.5, time_step=es.TimeStep(cfl=cfl))
        x = simulation.x - 0.5
        simulation.stepper.U.v.assign(simulation.v + 5.0 * np.stack([-x[:, 1], x[:, 0]], axis=-1))
        before = float(np.ravel(simulation.angular_momentum())[-1])
        simulation.run(0.01)
        drift[cfl] = abs(float(np.ravel(simulation.angular_momentum())[-1]) / before - 1.0)
    assert drift[0.4] < 1e-3 and drift[0.1] < 0.5 * drift[0.4]


@pytest.mark.of_the_cpu
@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_simd_equals_portable(dim, dtype):
    found = {}
    for simd in (False, True):
        execution.set_simd(simd)
        found[simd] = results(block(dim, dtype=dtype, time_step=es.TimeStep(fixed=2e-6)), 10)
    assert_equal_to_round_off(found[False], found[True], dtype)


@pytest.mark.of_the_cpu
def test_threads_keep_every_bit(monkeypatch):
    monkeypatch.setattr(execution, "LEAST_RANGE", 16)
    found = []
    for threads in (1, 3):
        execution.set_threads(threads)
        found.append(results(block(2), 8))
    for name, values in found[0].items():
        assert np.array_equal(values, found[1][name]), name


@pytest.mark.parametrize("scheme", [es.Verlet, es.LaxWendroff])
def test_resume_is_exact(scheme):
    options = {"reference": es.Every(3), "scheme": scheme(correction=es.PlainVolume())}
    resume_is_exact(lambda: block(2, **options), 5, 4)


def test_nothing_is_done_where_the_arrangement_stays():
    """With given surface vectors corrections are built there too."""
    x, volume = box((0.0, 0.0), (1.0, 1.0), 0.05, jitter=0.2)
    velocity = np.random.default_rng(2).normal(size=x.shape)
    body = es.Body(x=x, volume=volume, material=RUBBER, velocity=velocity, surface=0.0)
    simulation = es.Simulation(body, scheme=es.Verlet(correction=es.PlainVolume()))
    simulation.step(3)
    exact, moving, inside = gradients(simulation)
    assert np.array_equal(moving, exact) and not inside.any()


def test_liquids_have_their_own():
    x, volume = box((0.0, 0.0), (1.0, 1.0), 0.1)
    water = es.Body(x=x, volume=volume, material=es.TaitLiquid(density=1000.0, sound_speed=100.0))
    with pytest.raises(ValueError, match=r"PlainVolume\(\) is for solids, got a liquid or gas; take Uncorrected\(\)"):
        es.Simulation(water, scheme=es.Verlet(correction=es.PlainVolume()))


def test_pressed_metal_takes_its_room():
    """Punched to 0.4 of its height, 16²: the load of slip lines within 10 %, and books that close before mirrors."""
    simulation, punch = metal_punch.build(16)
    found = []
    for depth in np.arange(0.3, 0.401, 0.01):
        simulation.run(depth / metal_punch.SPEED + 0.5 * metal_punch.RISE)
        found.append(-simulation.reaction(punch)[1])
    energy = simulation.energy()
    assert np.mean(found) == pytest.approx(metal_punch.STEADY, rel=0.1)
    assert metal_punch.matter(simulation, 0.4) == pytest.approx(1.0, abs=0.04)
    assert abs(energy["residual"]) < 1e-12 * energy["constraint"]


def test_float32_runs():
    simulation = block(2, dtype=wp.float32)
    simulation.step(20)
    assert abs(simulation.energy()["residual"]) < 1e-4 * simulation.stepper.ledger.start
