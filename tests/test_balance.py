"""Balanced pair vectors (M13), the smoothing length that follows the volume, and the step that both allow (M14)."""

import contextlib
import logging

import numpy as np
import pytest
import warp as wp
from bodies import RUBBER

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.scheme.potentials import RELAXATION, _make_relax
from warp_eulsph.validation.balance_sweeps import left_over, spectrum
from warp_eulsph.validation.cases import bending_column, piston, punch

COUNT = {1: 24, 2: 9, 3: 6}


def disordered(dim, correction, dtype=wp.float64, n=None):
    """A block whose particles and volumes were disturbed after the start: its surface vectors no longer fit."""
    n = COUNT[dim] if n is None else n
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / n)
    scheme = es.Verlet(correction=correction)
    simulation = es.Simulation(
        es.Body(x=x, volume=volume, material=RUBBER), arrangement=es.Current(), scheme=scheme, dtype=dtype
    )
    stepper, rng = simulation.stepper, np.random.default_rng(5)
    stepper.U.x.assign(x + rng.uniform(-0.15, 0.15, x.shape) / n)
    stepper.U.F.assign(np.eye(dim) * rng.uniform(0.97, 1.06, len(x))[:, None, None])
    stepper.configuration.refresh(stepper.U)
    stepper.stabiliser.refresh(stepper.configuration, stepper.U)
    return simulation


def dual_forces(simulation, Q):
    """M5 of the stresses Q on the present reference."""
    stepper, space = simulation.stepper, simulation.space
    reference = stepper.configuration.fields
    Pi, out = (wp.zeros(stepper.n, dtype=dtype, device=stepper.device) for dtype in (space.mat, space.vec))
    Pi.assign(Q @ np.swapaxes(reference.L.numpy(), 1, 2))
    stepper.configuration.divergence(Pi, out)
    return out.numpy()


def gradient(simulation, f):
    """M4 of vectors f on the present reference."""
    stepper, space = simulation.stepper, simulation.space
    rows = wp.array(f.astype(space.numpy), dtype=space.vec, device=stepper.device)
    out = wp.zeros(stepper.n, dtype=space.mat, device=stepper.device)
    stepper.configuration.gradient(rows, out)
    return out.numpy()


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_balance_keeps_linear_fields_duality_and_both_momenta(dim, dtype):
    """Whatever the arrangement: ∇ of linear fields, Σ v·T = −Σ V Q:∇v, no net force, no net torque, to round-off."""
    simulation = disordered(dim, es.Balance(), dtype)
    reference, rng = simulation.stepper.configuration.fields, np.random.default_rng(1)
    x, V = reference.x.numpy().astype(float), reference.V.numpy().astype(float)
    moved = np.abs(reference.balanced.numpy() - x).max() * COUNT[dim]
    assert 0.01 < moved <= 0.25 * (1.0 + 1e-6)  # something was balanced, and not beyond the bound
    exact = 1e3 * np.finfo(simulation.space.numpy).eps
    slope = rng.normal(size=(dim, dim))
    assert np.abs(gradient(simulation, x @ slope.T + 2.0) - slope).max() < exact
    Q, v = rng.normal(size=(len(x), dim, dim)), rng.normal(size=x.shape)
    Q = Q + np.swapaxes(Q, 1, 2)
    force = dual_forces(simulation, Q)
    power = np.einsum("a,aij,aij->", V, Q, gradient(simulation, v))
    scale = np.abs(force).sum()
    assert abs((v * force).sum() + power) < exact * scale
    assert np.abs(force.sum(axis=0)).max() < exact * scale
    torque = np.einsum("ai,aj->ij", x, force)
    assert np.abs(torque - torque.T).max() < exact * scale


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_balance_takes_the_short_waves_of_the_defect(dim):
    """The force of a uniform stress on particles that pair up along x: 1e-4 of that without balance."""
    n = 8
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / n)
    pairing = 0.05 / n * (-1.0) ** np.rint(x[:, :1] * n - 0.5) * np.eye(dim)[0]
    size = {}
    for correction in (None, es.Balance()):
        body = es.Body(x=x, volume=volume, material=RUBBER, surface=0.0)
        scheme = es.Verlet(correction=correction)
        simulation = es.Simulation(body, arrangement=es.Current(), scheme=scheme, periodic=(1.0,) * dim)
        stepper = simulation.stepper
        stepper.U.x.assign(x + pairing)
        stepper.configuration.refresh(stepper.U)
        stepper.stabiliser.refresh(stepper.configuration, stepper.U)
        size[correction] = np.linalg.norm(dual_forces(simulation, np.broadcast_to(np.eye(dim), (len(x), dim, dim))))
    assert size[None] > 1e-6
    assert size[es.Balance()] < 1e-4 * size[None]


@pytest.mark.parametrize(
    ("dim", "largest", "saw_tooth", "left"), [(1, 1.85, 1.85, 9e-8), (2, 1.33, 1.23, 2e-6), (3, 1.16, 1.05, 1e-5)]
)
def test_share_of_a_sweep_is_the_reciprocal_of_the_largest_eigenvalue(dim, largest, saw_tooth, left):
    """Rounded down: no wave of a lattice is corrected too far, none by 5 % less than could be; figures of the docs."""
    found, share = spectrum(dim), RELAXATION[dim]
    assert 0.95 < share * found.largest <= 1.0
    assert found.largest == pytest.approx(largest, abs=0.005) and found.saw_tooth == pytest.approx(saw_tooth, abs=0.005)
    assert left_over(found.saw_tooth, share) == pytest.approx(left, rel=0.5)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_a_sweep_multiplies_the_saw_tooth_by_what_the_spectrum_says(dim):
    """One sweep of the kernel itself from ψ = (−1)^i, with no defect."""
    n = 6
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / n)
    body = es.Body(x=x, volume=volume, material=RUBBER, surface=0.0)
    simulation = es.Simulation(body, arrangement=es.Current(), periodic=(1.0,) * dim, sort=False)
    stepper = simulation.stepper
    wave = (-1.0) ** np.rint(x[:, :1] * n - 0.5) * np.ones(dim)
    psi, none, out = (wp.array(v, dtype=simulation.space.vec) for v in (wave, 0.0 * wave, 0.0 * wave))
    arguments = [stepper.configuration.fields, stepper.configuration.near, stepper.configuration.K, none, psi, out]
    wp.launch(_make_relax(simulation.space, False, False), len(x), [0, *arguments])
    expected = 1.0 - RELAXATION[dim] * spectrum(dim).saw_tooth
    np.testing.assert_allclose(out.numpy(), expected * wave, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_smoothing_length_follows_the_volume(dim):
    """A reference at twice the size in every direction has twice the smoothing lengths and the same neighbours."""
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / 6)
    simulation = es.Simulation(es.Body(x=x, volume=volume, material=RUBBER), arrangement=es.Current())
    stepper = simulation.stepper
    lists = stepper.configuration.lists
    near = lists.of_pairs(lists.rows.index)
    for factor, grown in ((1.5, 1.5), (0.7, 0.7), (3.0, 2.0)):  # growth ends at 2
        stepper.U.x.assign(factor * x)
        stepper.U.F.assign(np.broadcast_to(factor * np.eye(dim), (len(x), dim, dim)))
        stepper.configuration.refresh(stepper.U)
        np.testing.assert_allclose(stepper.configuration.fields.h.numpy(), grown * 1.3 / 6, rtol=1e-12)
        if factor == grown:
            assert np.array_equal(lists.of_pairs(lists.rows.index), near)


def plate(n, scheme, reference, cfl=None, omega=105.0):
    x, volume = box((-0.5, -0.5), (0.5, 0.5), 1 / n)
    body = es.Body(x=x, volume=volume, material=RUBBER, velocity=omega * np.c_[-x[:, 1], x[:, 0]])
    step = es.TimeStep(cfl=cfl)
    return es.Simulation(body, arrangement=es.Current(), scheme=scheme, reference=reference, time_step=step)


@pytest.mark.parametrize("reference", [es.Never(), es.Every(4), es.Always()], ids=repr)
def test_step_conserves_angular_momentum(reference):
    """Without M9 the spin is exact to round-off (F is the gradient of the motion); midpoint drifts."""
    drift = {}
    for scheme in (es.Verlet(dissipation=None), es.LaxWendroff(dissipation=None)):
        simulation = plate(8, scheme, reference, cfl=0.4)
        before = simulation.angular_momentum()[0]
        simulation.step(60)
        drift[type(scheme)] = abs(simulation.angular_momentum()[0] / before - 1.0)
    assert drift[es.Verlet] < 1e-12
    assert drift[es.LaxWendroff] > 1e-7


def test_step_neither_feeds_nor_damps_waves():
    """A standing wave without M9: a thousand steps of Verlet at CFL 0.8 keep its amplitude, midpoint blows it up."""
    n = 24
    x, volume = box((0.0,), (1.0,), 1 / n)
    velocity = 1e-6 * np.sin(2.0 * np.pi * x)
    largest = {}
    for scheme in (es.Verlet(dissipation=None), es.LaxWendroff(dissipation=None)):
        body = es.Body(x=x, volume=volume, material=es.Bar(density=1.0, young=1.0), velocity=velocity, surface=0.0)
        step = es.TimeStep(cfl=0.8)
        simulation = es.Simulation(body, reference=es.Never(), scheme=scheme, time_step=step, periodic=(1.0,))
        speeds = []
        with contextlib.suppress(es.UnstableError):  # which midpoint raises once its steps have made half of the energy
            for _ in range(10):
                simulation.step(100)
                speeds.append(simulation.energy()["total"])
        largest[type(scheme)] = max(speeds) / (0.5 * 1e-12 * 0.5)
    assert largest[es.Verlet] == pytest.approx(1.0, abs=0.02)  # (ωΔt)²/8 of a wave 24 particles long is 0.006
    assert largest[es.LaxWendroff] > 1.05


@pytest.mark.parametrize("cfl", [0.8, 1.0])
@pytest.mark.parametrize("reference", [es.Never(), es.Always()], ids=repr)
def test_bounded_bodies_hold_in_three_dimensions(reference, cfl):
    """A cube spinning at 105 rad/s, a quarter turn, up to CFL 1: energy bounded, spin to 2e-3.

    Verlet conserves an energy that differs from the body's by O(Δt²): 1e-4 while the spin sets in, so coarse a cube.
    """
    x, volume = box((-0.5,) * 3, (0.5,) * 3, 1 / 6)
    body = es.Body(x=x, volume=volume, material=RUBBER, velocity=105.0 * np.c_[-x[:, 1], x[:, 0], 0.0 * x[:, 0]])
    simulation = es.Simulation(body, arrangement=es.Current(), reference=reference, time_step=es.TimeStep(cfl=cfl))
    start, spin = simulation.energy()["total"], simulation.angular_momentum()[2]
    for _ in simulation.frames(np.linspace(0.0, 0.015, 31)[1:]):
        assert simulation.energy()["total"] <= start * (1.0 + 1e-4)
    assert simulation.energy()["total"] > 0.93 * start
    assert simulation.angular_momentum()[2] == pytest.approx(spin, rel=2e-3)


@pytest.mark.parametrize("speed", [60.0, 80.0])
def test_a_body_pulled_apart_has_free_faces(speed):
    """Halves torn apart: no pair, no force across the gap from then on, faces found anew, momentum to round-off.

    Torn faster, some particles of the first row end up behind others, with vectors of any sign.
    """
    x, volume = box((-1.0, 0.0), (1.0, 0.3), 0.05)
    left = x[:, 0] < 0.0
    material = es.NeoHookean(density=1100.0, young=17e6, poisson=0.3)
    body = es.Body(x=x, volume=volume, material=material, velocity=speed * np.sign(x[:, :1]) * [1.0, 0.0])
    simulation = es.Simulation(body, arrangement=es.Current())
    inner = left & (x[:, 0] > -0.05)
    assert np.abs(simulation.stepper.U.surface.numpy()[inner, 0]).max() < 0.01 * 0.05
    start = simulation.energy()["total"]
    pushes = []
    for _ in simulation.frames(np.linspace(0.004, 0.02, 9)):
        pushes.append(simulation.v[left].sum(axis=0))
        lists = simulation.stepper.configuration.lists
        rows = np.repeat(np.arange(len(x)), lists.lengths)
        assert not (left[rows] != left[lists.of_pairs(lists.rows.index)]).any()
        assert simulation.energy()["total"] <= start
    scale = 1100.0 * 0.05**2 * speed * left.sum()
    assert np.abs(simulation.momentum()).max() < 1e-12 * scale
    assert np.abs(np.diff(pushes, axis=0)).max() < 1e-12 * speed * left.sum()
    faces = simulation.stepper.U.surface.numpy()[inner, 0]
    assert faces.mean() > 0.5 * 0.05  # outward, of the order of a particle's face
    assert speed > 60.0 or faces.min() > 0.5 * 0.05


def test_a_tear_is_an_event(caplog):
    """A solid pulled apart with its neighbours read anew: a warning, once, or an end; never of a convected one."""
    from warp_eulsph.validation.cases import extension

    with caplog.at_level(logging.WARNING, logger="warp_eulsph.failure"):
        simulation, _ = extension.build(2, 10, es.Always(), 0.1, rate=4.0, arrangement=es.Current())
        simulation.run(0.25)
    assert caplog.text.count("a solid comes apart without a law of failure") == 1
    assert "of body 'body' at x =" in caplog.text and simulation.tear is not None
    assert 0.0 < simulation.tear.time < 0.25
    simulation, _ = extension.build(2, 10, es.Always(), 0.1, rate=4.0, arrangement=es.Current(stop_when_torn=True))
    with pytest.raises(es.UnstableError, match=r"arrangement=Convected\(\) holds solids together"):
        simulation.run(0.25)
    simulation, _ = extension.build(2, 10, es.Always(), 0.1, rate=4.0)
    simulation.run(0.25)
    assert simulation.tear is None


ARRANGEMENTS = [es.Convected(), es.Current()]


def test_particles_at_a_clamp_keep_apart():
    """A bending column: what pairs up above a held layer, read anew, takes 3 % of the energy by 0.6 s."""
    kept, column = {}, bending_column.build(2, 20, es.Never()).bodies
    held = es.Fixed(lambda X: X[:, 1] < 0.05)
    for arrangement in ARRANGEMENTS:
        simulation = es.Simulation(column, boundaries=[held], reference=es.Always(), arrangement=arrangement)
        start = simulation.energy()["total"]
        simulation.run(0.6)
        kept[arrangement] = simulation.energy()["total"] / start
    assert kept[es.Convected()] > 0.996
    assert 0.95 < kept[es.Current()] < 0.98


def test_material_flows_round_an_edge():
    """Under a punch, 10 % deep: within 5 % of the reference's reaction; read anew, a tenth and more below it."""
    for arrangement, low in zip(ARRANGEMENTS, (0.95, 0.85), strict=True):
        simulation, condition = punch.build(40, es.Always(), arrangement=arrangement)
        reaction = punch.near(punch.measure(simulation, condition, until=0.0103), "reaction", 0.01)
        assert low < reaction / (0.5 * sum(punch.REACTIONS[0.01])) < 1.05


@pytest.mark.parametrize("arrangement", ARRANGEMENTS, ids=repr)
def test_strong_shocks_hold(arrangement):
    """Behind a fast piston."""
    driven = piston.PISTONS["compression_100"]
    simulation = piston.build(400, driven, es.Always(), arrangement=arrangement)
    found = piston.errors(simulation, piston.measure(simulation, driven), driven)
    assert max(abs(error) for error in found.values()) < 0.02


@pytest.mark.parametrize(
    ("options", "message"),
    [({"sweeps": 0}, "sweeps"), ({"bound": 0.0}, "bound"), ({"bound": 0.4}, "bound")],
)
def test_bad_options_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        es.Balance(**options)
