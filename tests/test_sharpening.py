"""Sharpened gradients (M23): their order, the waves that they carry, the step that they bear."""

import numpy as np
import pytest
from clouds import BODIES, block

import warp_eulsph as es
from warp_eulsph.scheme.reference import STEEPER
from warp_eulsph.validation.cases import bar

STEEL = es.LinearElastic(density=1.0, young=1.0, poisson=0.3)


def sharpened(body, sharpening=es.Sharpening(), **options):
    return es.Simulation(body, scheme=es.Verlet(sharpening=sharpening, **options), sort=False)


def gradient(n, dim, sharpening):
    """Largest error of ∇v inside a lattice n particles across a unit box, for a field that is no polynomial."""
    x, volume = es.geometry.box((0.0,) * dim, (1.0,) * dim, 1.0 / n)
    phase = x @ np.array([2.0, 1.0, 1.5])[:dim]
    v = np.stack([np.sin(phase + k) for k in range(dim)], axis=1)
    exact = np.stack([np.cos(phase + k)[:, None] * np.array([2.0, 1.0, 1.5])[:dim] for k in range(dim)], axis=1)
    made = sharpened(es.Body(x=x, volume=volume, spacing=1.0 / n, material=STEEL, velocity=v), sharpening)
    made.stepper._velocity_gradient(made.stepper.U)
    inside = np.abs(x - 0.5).max(axis=1) < 0.15  # four supports of twelve across from every face
    return np.abs(made.stepper.grad_v.numpy() - exact)[inside].max()


@pytest.mark.parametrize("dim", [1, 2])
def test_gradients_are_of_fourth_order_inside(dim):
    levels = (24, 48)
    sharp, plain = (
        np.log2(np.divide(*[gradient(n, dim, option) for n in levels])) for option in (es.Sharpening(), None)
    )
    assert sharp > 3.8
    assert 1.9 < plain < 2.1


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_faces_lose_a_third_of_their_error_at_least(dim):
    """Of v = x², whose gradient is 2x: what M4 misses of it at a free face it sees in the jumps, but for 1/3 to 2/3."""
    x = block(dim, 0.0)
    v = np.zeros_like(x)
    v[:, 0] = x[:, 0] ** 2
    face = (x[:, 0] < 1.0) & (np.abs(x - 0.5 * x.max(axis=0) - 0.25)[:, 1:] < 1.0).all(axis=1)
    errors = []
    for option in (None, es.Sharpening()):
        made = sharpened(es.Body(x=x, volume=1.0, spacing=1.0, material=STEEL, velocity=v), option, tilt=None)
        made.stepper._velocity_gradient(made.stepper.U)
        errors.append(np.abs(made.stepper.grad_v.numpy()[face, 0, 0] - 2.0 * x[face, 0]).max())
    assert errors[0] > 1.0
    assert errors[1] < 0.67 * errors[0]


@pytest.mark.parametrize("theta", [0.5, 1.0, 1.5])
def test_waves_of_a_periodic_bar_have_their_closed_form(theta):
    """ω = (c/dx) sin θ (4 − cos θ)/3 for three-particle sums, of which M4 alone gives sin θ."""
    n = 24
    theta = 2.0 * np.pi * round(theta * n / (2.0 * np.pi)) / n
    x = np.arange(n)[:, None] + 0.5
    for sharpening, symbol in ((es.Sharpening(), np.sin(theta) * (4.0 - np.cos(theta)) / 3.0), (None, np.sin(theta))):
        body = es.Body(
            x=x, volume=1.0, spacing=1.0, material=es.Bar(density=1.0, young=1.0), velocity=1e-6 * np.cos(theta * x)
        )
        made = es.Simulation(
            body,
            scheme=es.Verlet(dissipation=None, tie=None, sharpening=sharpening),
            dilation=1.0,
            periodic=[float(n)],
            time_step=es.TimeStep(fixed=1e-3),
        )
        quarter = 0.5 * np.pi / symbol
        made.run(quarter)
        amplitude = 2.0 * (made.v[:, 0] * np.cos(theta * x[:, 0])).mean()
        assert abs(amplitude) < 1e-5 * 1e-6  # a quarter of a period on, the velocity is zero
        made.run(2.0 * quarter)
        assert 2.0 * (made.v[:, 0] * np.cos(theta * x[:, 0])).mean() == pytest.approx(-1e-6, rel=1e-5)


@pytest.mark.parametrize(("name", "overshoot", "kept"), [("verlet", 0.1, 0.9), ("limited_verlet", 0.05, 0.75)])
def test_a_shock_rings_little(name, overshoot, kept):
    """The bar at 40: 0.088 and 0.93 by default, 0.032 and 0.83 with the limiter; 0.22 and 0.91 not sharpened."""
    history = bar.measure(bar.build(40, es.Never(), bar.VERLETS[name][0]))
    assert bar.errors(history)["velocity_overshoot"] < overshoot
    assert kept < history["energy"][-1] / history["energy"][0] < 1.0


def highest_frequency(x, sharpening):
    """ω dx/c of a free body by power iteration on its forces."""
    made = sharpened(es.Body(x=x, volume=1.0, spacing=1.0, material=STEEL), sharpening)
    stepper, dim = made.stepper, x.shape[1]
    stepper.medium.options = es.Verlet(sharpening=sharpening, dissipation=None)
    u, rate = np.random.default_rng(2).normal(size=x.shape), 0.0
    for _ in range(150):
        u *= 1e-6 / np.abs(u).max()
        stepper.U.v.assign(u)
        stepper._velocity_gradient(stepper.U)
        F = np.eye(dim) + stepper.grad_v.numpy()
        stepper.U.v.zero_()
        stepper.U.x.assign(x + u)
        stepper.U.F.assign(F)
        stepper._stress(stepper.U, 0.0)
        stepper._sum_forces(stepper.U, stepper.U, 0.0)
        acceleration = stepper.forces.internal.numpy() + stepper.forces.tie.numpy()
        rate, u = np.linalg.norm(acceleration) / np.linalg.norm(u), -acceleration
    return np.sqrt(rate)


def test_steps_are_shorter_by_what_frequencies_are_higher():
    """By 1.17 to 1.21 in bodies whose steps are near the limit; less in the poorest; 1.3 in even rods, far from it."""
    ratios = {
        name: highest_frequency(BODIES[name], es.Sharpening()) / highest_frequency(BODIES[name], None)
        for name in ("square", "jittered square", "cube", "jittered cube", "rod")
    }
    for name in ("square", "jittered square", "cube", "jittered cube"):
        assert ratios[name] == pytest.approx(STEEPER, abs=0.04), ratios
    assert ratios["rod"] < STEEPER
    body = es.Body(x=BODIES["square"], volume=1.0, spacing=1.0, material=STEEL)
    one, other = sharpened(body), sharpened(body, None)
    one.step()
    other.step()
    assert other.dt / one.dt == pytest.approx(STEEPER, rel=1e-12)


def test_arrangements_that_move_are_not_sharpened():
    x = block(2, 0.0)
    body = es.Body(x=x, volume=1.0, spacing=1.0, material=STEEL)
    made = es.Simulation(body, scheme=es.Verlet(), reference=es.Always(), arrangement=es.Current())
    assert made.stepper.medium.sharpener is None
    assert es.Simulation(body, scheme=es.LaxWendroff()).stepper.medium.sharpener is None
    assert es.Simulation(body, reference=es.Always()).stepper.medium.sharpener is not None
