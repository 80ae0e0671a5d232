"""Clamped: exact in uniform states, second order in bars and beams, no work, in every reference."""

import numpy as np
import pytest
import warp as wp
from bodies import COMPRESSIBLE
from loads import bar, beam, clamped, inside

import warp_eulsph as es
from warp_eulsph.geometry import box, nodes


def orders(spacings, errors):
    return np.diff(np.log(np.abs(errors))) / np.diff(np.log(spacings))


def test_a_bar_under_gravity_converges_at_second_order():
    """Let go under its weight its end moves by ρ g L²/E, twice the static elongation; exactly, in the continuum."""
    numbers = np.array([6, 12, 24, 48])
    errors, energies = zip(*[bar(n, clamped(1)) for n in numbers], strict=True)
    assert abs(errors[1]) < 0.006 and abs(errors[3]) < 4e-4
    assert np.log(errors[0] / errors[-1]) / np.log(8) > 1.75
    assert abs(bar(12, inside)[0]) > 0.1  # what a held layer makes of it
    for energy in energies:
        assert abs(energy["constraint"]) <= 1e-11 * energy["external"]
    assert bar(12, clamped(1), reference=es.Always())[0] == pytest.approx(errors[1], abs=1e-5)


def test_a_beam_converges_at_second_order():
    sags = np.array([beam(n, clamped(2))[0] for n in (6, 8, 12)])
    # three resolutions for three unknowns: the sag at zero spacing, the error and its order
    orders = np.linspace(1.0, 4.0, 301)
    parts = np.array([6.0, 8.0, 12.0])[:, None] ** -orders
    fits = (parts[0] - parts[1]) / (parts[1] - parts[2]) - (sags[0] - sags[1]) / (sags[1] - sags[2])
    best = np.abs(fits).argmin()
    limit = sags[2] - (sags[1] - sags[2]) * parts[2, best] / (parts[1, best] - parts[2, best])
    assert orders[best] > 1.9
    assert limit == pytest.approx(17.80e-3, rel=0.005)  # of 24 and 16 across


@pytest.mark.parametrize("reference", [es.Never(), es.Every(4), es.Always()], ids=repr)
@pytest.mark.parametrize("dim", [2, 3])
def test_it_does_no_work_and_bears_the_load(dim, reference):
    """In an oblique direction; the impulse of clamp and weight is the momentum."""
    turn, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(dim, dim)))
    x, volume = box((0,) * dim, (1.0, 0.5, 0.5)[:dim], 1 / 8, jitter=0.05)
    body = es.Body(x=x @ turn.T, volume=volume, material=COMPRESSIBLE, velocity=(x * (3.0, -20.0, 10.0)[:dim]) @ turn.T)
    clamp = es.Clamped((0.0,) * dim, -turn[:, 0])
    simulation = es.Simulation(body, boundaries=[clamp], reference=reference)
    impulse, start = np.zeros(dim), simulation.momentum()
    for _ in range(40):
        simulation.step()
        impulse += simulation.reaction(clamp) * simulation.dt
    np.testing.assert_allclose(simulation.momentum() - start, impulse, rtol=0, atol=1e-10 * np.abs(start).max())
    energy = simulation.energy()
    assert abs(energy["constraint"]) <= 1e-12 * energy["total"] and abs(energy["residual"]) <= 1e-12 * energy["total"]


def test_a_uniform_pull_is_in_equilibrium():
    """Stretched between a clamp and a traction the bar stays at rest, particle by particle; the reaction is −t."""
    n, t = 20, 1e5
    x = (np.arange(n) + 0.5)[:, None] / n
    body = es.Body(x=x, volume=1 / n, material=es.Bar(density=1000.0, young=1e7))
    conditions = [es.Clamped([0.0], [-1.0]), es.Traction([t], [1.0], lambda X: X[:, 0] > 0.96)]
    simulation = es.Simulation(body, boundaries=conditions, reference=es.Never())
    U = simulation.stepper.U
    U.x.assign(x * 1.01)
    U.F.assign(np.full((n, 1, 1), 1.01))
    simulation.step(50)
    assert np.abs(simulation.v).max() <= 1e-10
    np.testing.assert_allclose(simulation.reaction(conditions[0]), [-t], rtol=1e-9)


@pytest.mark.parametrize("offset", [0.0, 0.3, 1.0], ids=str)
def test_the_plane_may_lie_off_the_cells(offset):
    """A linear field that vanishes at the plane is left alone, wherever the plane lies."""
    x, volume = box((0, 0), (1, 1), 0.1)
    plane = -offset * 0.1 + 0.05
    slope = np.array([3.0, -2.0])
    body = es.Body(x=x, volume=volume, material=COMPRESSIBLE, velocity=(x[:, :1] - plane) * slope)
    simulation = es.Simulation(body, boundaries=[es.Clamped((plane, 0.0), (-1.0, 0.0))])
    np.testing.assert_allclose(simulation.v, body.velocity, atol=1e-13)


def test_it_holds_a_patch_and_particles_on_the_plane():
    x, volume, surface = nodes((0, 0), (1, 1), 0.1)
    body = es.Body(x=x, volume=volume, material=COMPRESSIBLE, surface=surface, velocity=(1.0, 2.0))
    clamp = es.Clamped((0, 0), (-1, 0), lambda X: X[:, 1] > 0.45)
    simulation = es.Simulation(body, boundaries=[clamp], reference=es.Never())
    held = (x[:, 0] < 0.05) & (x[:, 1] > 0.45)
    simulation.step(10)
    assert not simulation.v[held].any() and np.abs(simulation.v[~held]).min() > 0.0
    np.testing.assert_array_equal(simulation.conditions[0].indices, np.flatnonzero(held))


def test_single_precision():
    x, volume = box((0, 0, 0), (1, 0.5, 0.5), 0.125)
    body = es.Body(
        x=x, volume=volume, material=COMPRESSIBLE, velocity=np.c_[np.zeros((len(x), 1)), 5.0 * x[:, :1], x[:, :1]]
    )
    runs = []
    for dtype in (wp.float64, wp.float32):
        clamp = es.Clamped((0, 0, 0), (-1, 0, 0))
        runs.append(es.Simulation(body, boundaries=[clamp], dtype=dtype, time_step=es.TimeStep(fixed=2e-4)))
        runs[-1].step(60)
    np.testing.assert_allclose(runs[1].x, runs[0].x, rtol=0, atol=2e-6)
