"""The oscillation sensor and flux-corrected transport (paper §5)."""

import numpy as np
import pytest
import warp as wp
from bodies import COMPRESSIBLE
from clouds import cloud, configuration_of, dense_N

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.fields import allocate
from warp_eulsph.operators.values import Linear, Shepard
from warp_eulsph.scheme.limiter import FluxCorrectedTransport
from warp_eulsph.scheme.sensor import DimensionlessSensor, PaperSensor, SensorField

SIDE = {1: 12, 2: 6, 3: 4}


def prepared(dim, option, v, F, d, jitter=0.2, **lattice):
    """Increments (n, dim) and (n, dim, dim) of the limiter on a cloud, with its configuration."""
    x, volume = cloud(dim, SIDE[dim], jitter)
    h = lattice.pop("h", 1.4) / SIDE[dim]
    configuration = configuration_of(x, volume, h, density=3.0, **lattice)
    diffusion = option.build(configuration.space, configuration.particles, configuration, wp.get_device())
    diffusion.refresh()
    U = allocate(configuration.space, "State", len(x), wp.get_device())
    U.v.assign(v)
    U.F.assign(F)
    diffusion.prepare(U, wp.array(d, dtype=configuration.space.vec))
    return diffusion, diffusion.dv.numpy().copy(), diffusion.dF.numpy().reshape(F.shape).copy(), (x, volume, h)


def random_state(dim, seed=7):
    rng = np.random.default_rng(seed)
    n = SIDE[dim] ** dim
    return rng.normal(size=(n, dim)), rng.normal(size=(n, dim, dim)), rng.uniform(0.0, 1.0, (n, dim))


@pytest.mark.parametrize("values", [Shepard(), Linear()], ids=repr)
@pytest.mark.parametrize("conservative", [True, False], ids=["conservative", "printed"])
@pytest.mark.parametrize("dim", [1, 2])
def test_diffusion_is_that_of_the_mass_matrices(dim, conservative, values):
    v, F, d = random_state(dim)
    option = FluxCorrectedTransport(conservative=conservative, values=values)
    diffusion, dv, dF, (x, volume, h) = prepared(dim, option, v, F, d)
    mass = 3.0 * volume
    N = dense_N(x, volume, np.full(len(x), h), values.linear)
    M_C, M_L = N.T @ (mass[:, None] * N), N.T @ mass
    assert np.abs(diffusion.lumped.numpy() - M_L).max() < 1e-12 * M_L.max()
    assert np.abs(diffusion.consistent.numpy() - np.diag(M_C)).max() < 1e-12 * M_L.max()
    others = M_L - np.diag(M_C)
    s = np.where(others > 1e-4 * M_L, 1.0 / others, 0.0)[:, None]
    for f, d_f, found in ((v, d, dv), (F.reshape(len(x), -1), np.repeat(d, dim, axis=1), dF.reshape(len(x), -1))):
        if conservative:
            sd = s * mass[:, None] * d_f
            pair = 0.5 * M_C[:, :, None] * (sd[:, None] + sd[None])
            expected = np.einsum("abi,abi->ai", pair, f[None] - f[:, None]) / mass[:, None]
        else:
            expected = d_f * s * (M_C @ f - M_L[:, None] * f)
        assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()
    momentum, scale = (mass[:, None] * dv).sum(axis=0), np.abs(mass[:, None] * dv).sum()
    change_of_F = (mass[:, None, None] * dF).sum(axis=0)
    if conservative:
        assert np.abs(momentum).max() < 1e-13 * scale
        assert np.abs(change_of_F).max() < 1e-13 * np.abs(mass[:, None, None] * dF).sum()
    else:
        assert np.abs(momentum).max() > 1e-4 * scale


@pytest.mark.parametrize("conservative", [True, False], ids=["conservative", "printed"])
def test_uniform_fields_and_zero_d_are_left_alone(conservative):
    v, F, d = random_state(2)
    option = FluxCorrectedTransport(conservative=conservative)
    _, dv, dF, _ = prepared(2, option, np.ones_like(v), np.ones_like(F) * 2.0, d)
    assert np.abs(dv).max() < 1e-13
    assert np.abs(dF).max() < 1e-13
    _, dv, dF, _ = prepared(2, option, v, F, np.zeros_like(d))
    assert not dv.any()
    assert not dF.any()
    d[:, 1] = 0.0  # direction 1 is left alone: v_1 and F_1j
    _, dv, dF, _ = prepared(2, option, v, F, d)
    assert not dv[:, 1].any()
    assert not dF[:, 1].any()
    assert dv[:, 0].any()
    assert dF[:, 0].all()


@pytest.mark.parametrize("conservative", [True, False], ids=["conservative", "printed"])
def test_saw_tooth_on_three_particles(conservative):
    """N is (1, 4, 1)/6 there: the symbol of M^C is 1/9, M^C_aa = m/2, hence the amplitude turns to 1 − 16/9 = −7/9."""
    v = ((-1.0) ** np.arange(12))[:, None]
    option = FluxCorrectedTransport(conservative=conservative)
    _, dv, _, _ = prepared(1, option, v, np.ones((12, 1, 1)), np.ones_like(v), jitter=0.0, box=(1.0,), h=1.0)
    assert np.abs(v + dv + 7.0 / 9.0 * v).max() < 1e-13


def test_a_particle_alone_is_left_alone():
    x = np.array([[0.0], [1.0], [5.0]])
    configuration = configuration_of(x, np.ones(3), 1.0)
    diffusion = FluxCorrectedTransport().build(
        configuration.space, configuration.particles, configuration, wp.get_device()
    )
    diffusion.refresh()
    U = allocate(configuration.space, "State", 3, wp.get_device())
    U.v.assign(x)
    diffusion.prepare(U, wp.ones(3, dtype=configuration.space.vec))
    dv = diffusion.dv.numpy()[:, 0]
    assert dv[2] == 0.0
    assert dv[0] == pytest.approx(-dv[1])
    assert dv[0] > 0.1


def sensed(option, x, volume, h, v, grad_v, speed=20.0, box=None):
    configuration = configuration_of(x, volume, h, box=box)
    space, n = configuration.space, len(x)
    flux = allocate(space, "Flux", n, wp.get_device())
    flux.speed.fill_(speed)
    field = SensorField(option, space, configuration.particles, wp.get_device())
    arrays = (wp.array(v, dtype=space.vec), wp.array(grad_v, dtype=space.mat))
    field.compute(configuration, flux, *arrays)
    return field.d.numpy().copy()


def test_sensor_sees_the_saw_tooth_in_its_support_and_not_a_linear_field():
    n = 16
    x, volume = cloud(1, n, jitter=0.0)
    v = np.zeros((n, 1))
    v[6] = 1e-3  # one spike: |∇²v| = 2e-3 n² there, half of it beside it
    d = sensed(PaperSensor(X=1.0), x, volume, 1.0 / n, v, np.zeros((n, 1, 1)))[:, 0]
    expected = np.zeros(n)
    expected[5:8], expected[[4, 8]] = 2e-3 * n**2, 1e-3 * n**2
    assert np.abs(d - expected).max() < 1e-12
    # twice the gain saturates where d was above a half
    doubled = sensed(PaperSensor(X=2.0), x, volume, 1.0 / n, v, np.zeros((n, 1, 1)))[:, 0]
    assert np.abs(doubled - np.minimum(2.0 * expected, 1.0)).max() < 1e-12
    same = sensed(DimensionlessSensor(X=20.0 * n**2), x, volume, 1.0 / n, v, np.zeros((n, 1, 1)), speed=20.0)[:, 0]
    assert np.abs(same - expected).max() < 1e-12
    slope = np.full((n, 1, 1), 3.0)
    assert sensed(PaperSensor(X=1e6), x, volume, 1.3 / n, 3.0 * x, slope).max() < 1e-4  # 1e6 times round-off


def test_sensor_takes_directions_apart_and_survives_zero_wave_speed():
    x, volume = cloud(2, 6, jitter=0.0)
    v = np.zeros((36, 2))
    v[0, 1] = 1.0
    d = sensed(DimensionlessSensor(), x, volume, 1.3 / 6, v, np.zeros((36, 2, 2)), speed=0.0)
    assert not d[:, 0].any()
    assert set(d[:, 1]) == {0.0, 1.0}


def bar(scheme, reference=es.Never(), n=24, **options):
    """A bar whose right quarter moves at once, the left end held: rings without dissipation."""
    x = ((np.arange(n) + 0.5) / n)[:, None]
    body = es.Body(x=x, volume=1.0 / n, material=COMPRESSIBLE, velocity=np.where(x > 0.75, 2.0, 0.0))
    held = es.Fixed(lambda X: X[:, 0] < 1.0 / n)
    return es.Simulation(body, boundaries=[held], reference=reference, scheme=scheme, **options)


def scheme_with(limiter, **options):
    return es.LaxWendroff(**{"dissipation": None, "limiter": limiter, **options})


@pytest.mark.parametrize("reference", [es.Never(), es.Always()], ids=repr)
def test_limiter_is_booked_and_dissipates(reference):
    limiter = FluxCorrectedTransport(DimensionlessSensor(X=50.0))
    simulation = bar(scheme_with(limiter), reference)
    simulation.run(until=5e-3)
    ledger, U = simulation.stepper.ledger, simulation.stepper.U
    assert simulation.steps > 10
    assert abs(ledger.residual(U)) < 1e-12 * ledger.start
    assert ledger.accounts()["limiter"] < -0.01 * ledger.start


def test_held_particles_stay_held_and_their_reaction_is_the_momentum_of_the_body():
    simulation = bar(scheme_with(FluxCorrectedTransport(DimensionlessSensor(X=50.0))))
    mass = simulation.particles.mass.numpy()
    before = mass @ simulation.v[:, 0]
    simulation.run(until=2e-3)
    assert simulation.v[0, 0] == 0.0
    step = mass @ simulation.v[:, 0]
    simulation.clock.aim(3e-3)
    simulation.stepper.step()
    impulse = simulation.clock.dt * simulation.stepper.forces.reaction.numpy()[:, 0].sum()
    # all that the conservative limiter takes from the others and from the wall's particle passes through the reaction
    assert mass @ simulation.v[:, 0] - step == pytest.approx(impulse, abs=1e-12 * abs(before))


def test_zero_gain_is_plain_lax_wendroff_to_the_bit(monkeypatch):
    monkeypatch.setattr(execution, "_simd", False)  # only the portable kernels have a sensor
    plain, limited = bar(scheme_with(None)), bar(scheme_with(FluxCorrectedTransport(PaperSensor(X=0.0))))
    upwind = bar(es.LaxWendroff(dissipation=es.Upwind(sensor=PaperSensor(X=0.0))))
    default = bar(es.LaxWendroff())
    for simulation in (plain, limited, upwind, default):
        simulation.run(until=2e-3)
    assert np.array_equal(plain.v, limited.v)
    assert np.array_equal(plain.F, limited.F)
    assert np.array_equal(default.v, upwind.v)


def test_a_step_of_no_duration_changes_nothing():
    simulation = bar(scheme_with(FluxCorrectedTransport(PaperSensor(X=1.0))))
    simulation.run(until=1e-3)
    v, F, accounts = simulation.v, simulation.F, simulation.stepper.ledger.accounts()
    simulation.stepper.step()
    assert np.array_equal(v, simulation.v)
    assert np.array_equal(F, simulation.F)
    assert accounts == simulation.stepper.ledger.accounts()


@pytest.mark.parametrize("reference", [es.Never(), es.Always()], ids=repr)
def test_sensed_upwind_damps_overshoots(reference):
    def overshoot(dissipation):
        simulation = bar(es.LaxWendroff(dissipation=dissipation), reference, n=48)
        simulation.run(until=2e-3)
        assert abs(simulation.stepper.ledger.residual(simulation.stepper.U)) < 1e-12 * simulation.stepper.ledger.start
        return simulation.v.max() - 2.0

    # before the waves meet the exact velocity lies in [0, 2]
    assert overshoot(es.Upwind(sensor=DimensionlessSensor(X=250.0))) < 0.25 * overshoot(es.Upwind())


@pytest.mark.parametrize(("dim", "real"), [(1, wp.float32), (3, wp.float64)])
def test_limiter_keeps_momentum_in_single_precision_and_in_three_dimensions(dim, real):
    x, volume = cloud(dim, 4 if dim == 3 else 12, jitter=0.1)
    velocity = np.where(x > 0.5, 1.0, -1.0) + np.arange(dim)
    body = es.Body(x=x, volume=volume, material=COMPRESSIBLE, velocity=velocity)
    scheme = es.LaxWendroff(
        smoothing=es.NeighbourAverage(Linear()), limiter=FluxCorrectedTransport(DimensionlessSensor(X=5.0))
    )
    simulation = es.Simulation(body, scheme=scheme, reference=es.Never(), dtype=real)
    mass = simulation.particles.mass.numpy().astype(float)
    before = mass @ simulation.v
    for _ in range(4):
        simulation.clock.aim(1.0)
        simulation.stepper.step()
    precision = 1e-5 if real is wp.float32 else 1e-12
    assert np.abs(mass @ simulation.v - before).max() < precision * mass.sum() * np.abs(velocity).max()
    ledger = simulation.stepper.ledger
    assert abs(ledger.residual(simulation.stepper.U)) < precision * ledger.start
    assert ledger.accounts()["limiter"] < -1e-3 * ledger.start


def test_gain_must_be_a_number():
    with pytest.raises(ValueError, match="sensor X must be finite and at least 0, got -1"):
        PaperSensor(X=-1.0)
