"""Particle shifting (M15): linear fields stay what they are, momenta and the books close, and shear goes on."""

import numpy as np
import pytest
import warp as wp
from bodies import RUBBER

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.validation.cases import shear, spinning_plate

SHIFTED = es.Verlet(shifting=es.Shifting())
EVEN = es.Verlet(shifting=es.Shifting())


def disordered(dim, n, velocity, dtype=wp.float64, F=1.0, reference=es.Always(), boundaries=(), scheme=SHIFTED):
    """A block whose inner particles were disturbed after the start, so that there is something to even out."""
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / n)
    body = es.Body(x=x, volume=volume, material=RUBBER, velocity=velocity(x))
    simulation = es.Simulation(
        body,
        arrangement=es.Current(),
        scheme=scheme,
        dtype=dtype,
        reference=reference,
        boundaries=boundaries,
    )
    inner = ((x > 2.9 / n) & (x < 1.0 - 2.9 / n)).all(axis=1)
    moved = np.where(inner[:, None], np.random.default_rng(3).uniform(-0.2, 0.2, x.shape) / n, 0.0)
    stepper = simulation.stepper
    stepper.U.x.assign((x + moved).astype(simulation.space.numpy))
    stepper.U.v.assign(velocity(x + moved).astype(simulation.space.numpy))
    stepper.U.F.assign(np.broadcast_to(F * np.eye(dim), (len(x), dim, dim)))
    stepper.configuration.refresh(stepper.U)
    stepper.stabiliser.refresh(stepper.configuration, stepper.U)
    stepper.medium.keep_gradient(stepper.U)
    simulation.clock.aim(1.0)
    return simulation


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize(("dim", "n"), [(1, 24), (2, 12), (3, 9)])
def test_linear_fields_stay_what_they_are(dim, n, dtype):
    """v = A x + b and a uniform F, A symmetric: remapped exactly but for the share that keeps the momenta."""
    A = np.random.default_rng(1).normal(size=(dim, dim))
    A = A + A.T
    simulation = disordered(dim, n, lambda x: x @ A.T + 2.0, dtype, F=1.1)
    before = simulation.x
    simulation.stepper._shift(simulation.stepper.U)
    shifted = simulation.x.astype(float)
    away = np.linalg.norm(shifted - before, axis=1) * n
    assert 0.005 < away.max() <= 0.05 * 1.1 * 1.001 and (away > 0.0).mean() > 0.01  # h_k follows the volume
    exact = 100 * np.finfo(simulation.space.numpy).eps
    np.testing.assert_allclose(simulation.F - 1.1 * np.eye(dim), 0.0, atol=exact)
    change = simulation.v - (shifted @ A.T + 2.0)
    fitted = np.c_[np.ones(len(shifted)), shifted]
    spread = change - fitted @ np.linalg.lstsq(fitted, change, rcond=None)[0]
    np.testing.assert_allclose(spread, 0.0, atol=10 * exact * np.abs(simulation.v).max())
    assert np.abs(change).max() < 0.02 * np.abs(simulation.v).max()


@pytest.mark.parametrize("reference", [es.Always(), es.Every(3)], ids=repr)
@pytest.mark.parametrize(("dim", "n"), [(2, 12), (3, 9)])
def test_momenta_and_the_books_close(dim, n, reference):
    """Steps with shifting: momentum to round-off, what shifting did has its account, angular momentum as without it."""

    def spin(x):
        return 50.0 * np.c_[-x[:, 1], x[:, 0], np.zeros((len(x), dim - 2))] + np.sin(7.0 * x)

    drift = {}
    for scheme in (es.Verlet(dissipation=None), es.Verlet(dissipation=None, shifting=es.Shifting())):
        simulation = disordered(dim, n, spin, reference=reference, scheme=scheme)
        simulation.stepper.ledger.open(simulation.stepper.U)
        momentum, about = simulation.momentum(), simulation.angular_momentum()
        simulation.step(9)
        energy = simulation.energy()
        assert abs(energy["residual"]) < 1e-12 * energy["total"]
        assert (energy["shifting"] != 0.0) == (scheme.shifting is not None)
        scale = 1100.0 * 50.0
        assert np.abs(simulation.momentum() - momentum).max() < 1e-12 * scale
        drift[scheme.shifting is None] = np.abs(simulation.angular_momentum() - about).max() / scale
    assert drift[False] < drift[True] + 1e-6


def test_held_particles_and_surfaces_stay():
    x = box((0.0, 0.0), (1.0, 1.0), 1.0 / 12)[0]
    held = (np.abs(x - 0.5) < 0.2).all(axis=1)
    simulation = disordered(2, 12, lambda x: 0.0 * x, boundaries=[es.Fixed(held)])
    before = simulation.x
    simulation.stepper._shift(simulation.stepper.U)
    moved = np.linalg.norm(simulation.x - before, axis=1) > 0.0
    assert moved.any() and not moved[held].any()
    assert not moved[((x < 0.1) | (x > 0.9)).any(axis=1)].any()


def test_nothing_moves_past_the_target():
    """A GPU takes steps past an output time; they must change nothing, shifting included."""
    simulation = disordered(2, 12, lambda x: 0.0 * x)
    simulation.clock.aim(0.0)
    before = simulation.x
    simulation.stepper._shift(simulation.stepper.U)
    assert np.array_equal(simulation.x, before)


def test_total_lagrangian_shifts_nothing():
    results = []
    for scheme in (es.Verlet(), SHIFTED):
        simulation = disordered(2, 12, lambda x: 1.0 * x, reference=es.Never(), scheme=scheme)
        simulation.step(3)
        results.append(simulation.x)
    assert np.array_equal(*results)


def test_shear_goes_on_where_the_default_is_lost():
    """A jittered block, 12 across, at a shear of 3: within 3 % of F and stress shifted, lost by 2 without."""
    simulation, upper = shear.build(12, es.Always(), arrangement=es.Current(), scheme=EVEN)
    simulation.run(0.3)
    errors = shear.errors(simulation, upper)
    assert errors["F"] < 0.03 and errors["stress"] < 0.03 and abs(errors["energy"] - 1.0) < 0.005
    simulation, upper = shear.build(
        12, es.Always(), arrangement=es.Current(), scheme=es.Verlet(correction=EVEN.correction)
    )
    simulation.run(0.2)
    assert shear.errors(simulation, upper)["F"] > 0.5


def test_bodies_that_need_none_hardly_change():
    """The plate at 105 rad/s, 16 across, 1.7 turns: energy and spin as without shifting, to 6e-4 and 1e-4."""
    kept, spin = {}, {}
    for scheme in (es.Verlet(), SHIFTED):
        simulation = spinning_plate.build(16, es.Always(), arrangement=es.Current(), scheme=scheme)
        start, about = simulation.energy()["total"], simulation.angular_momentum()[0]
        simulation.run(0.1)
        kept[scheme], spin[scheme] = simulation.energy()["total"] / start, simulation.angular_momentum()[0] / about
        assert np.abs(simulation.momentum()).max() < 1e-12 * about
    assert 0.0 < abs(kept[SHIFTED] - kept[es.Verlet()]) < 6e-4
    assert abs(spin[SHIFTED] - spin[es.Verlet()]) < 1e-4


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: es.Shifting(rate=0.0), "rate"),
        (lambda: es.Shifting(bound=0.5), "bound"),
        (lambda: es.Verlet(correction=es.PairAreas(), shifting=es.Shifting()), "Balance"),
        (lambda: es.LaxWendroff(correction=None, shifting=es.Shifting()), "Balance"),
    ],
)
def test_bad_options_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()
