"""The one-step Lax scheme for {p, F}."""

import numpy as np
import pytest
from bodies import COMPRESSIBLE, lattice

import warp_eulsph as es
from warp_eulsph.scheme.lax import Lax
from warp_eulsph.scheme.smoothing import NeighbourAverage

C_P = np.sqrt(17e6 * 0.7 / (1.3 * 0.4) / 1100.0)


def pulse(scheme, n, cfl, reference=es.Never(), dilation=1.0, amplitude=1e-6, turns=0.5):
    """A right-running wave of small amplitude on the unit circle: v = −c F₁₁ + c; its velocity and the exact one."""

    def wave(x):
        return amplitude * np.sin(2.0 * np.pi * x)

    x = ((np.arange(n) + 0.5) / n)[:, None]
    body = es.Body(x=x, volume=1.0 / n, material=COMPRESSIBLE, velocity=wave(x) * C_P)
    step = es.TimeStep(fixed=cfl / n / C_P)
    simulation = es.Simulation(
        body, scheme=scheme, reference=reference, periodic=(1.0,), dilation=dilation, time_step=step
    )
    simulation.stepper.U.F.assign((1.0 - wave(x))[:, :, None])
    if not reference.fixed:
        simulation.stepper.configuration.refresh(simulation.stepper.U)
    simulation.stepper.ledger.open(simulation.stepper.U)
    simulation.run(until=turns / C_P)
    return simulation, simulation.v[:, 0] / C_P, wave(x[:, 0] - turns)


def test_courant_number_one_on_three_particles_shifts_exactly():
    paper = Lax(NeighbourAverage(), dissipation=None)
    _, found, exact = pulse(paper, 20, 1.0)
    # the law is nonlinear: its terms are the amplitude squared
    assert np.abs(found - exact).max() < 1e-4 * 1e-6
    _, halved, _ = pulse(paper, 20, 0.5)
    assert np.abs(halved - exact).max() > 0.1 * 1e-6


def test_first_order():
    errors = [np.abs(np.subtract(*pulse(Lax(NeighbourAverage(), None), n, 0.5)[1:])).max() for n in (80, 160)]
    assert 0.8 < np.log2(errors[0] / errors[1]) < 1.1


def test_linear_exact_smoothing_lets_long_waves_grow():
    ledger = pulse(Lax(es.LinearExact()), 24, 0.4, dilation=1.3)[0].stepper.ledger
    assert ledger.accounts()["stepping"] > 0.1 * ledger.start


@pytest.mark.parametrize("reference", [es.Never(), es.Always()], ids=repr)
def test_books_close_and_energy_falls(reference):
    simulation, _, _ = pulse(Lax(), 24, 0.4, reference, dilation=1.3, amplitude=0.02)
    ledger, U = simulation.stepper.ledger, simulation.stepper.U
    assert simulation.steps > 20
    assert abs(ledger.residual(U)) < 1e-12 * ledger.start
    assert ledger.accounts()["stepping"] < -0.01 * ledger.start  # Lax damps
    if reference.fixed:  # M6 keeps momentum on a lattice, not on the moved particles
        mass = simulation.particles.mass.numpy()
        assert abs(mass @ simulation.v[:, 0]) < 1e-12 * (mass @ np.abs(simulation.v[:, 0]))


def test_two_dimensions_with_a_held_edge_and_a_step_of_no_duration():
    x = lattice(2, 6)
    body = es.Body(x=x, volume=1.0 / 36, material=COMPRESSIBLE, velocity=np.stack([0.0 * x[:, 1], 2.0 * x[:, 0]], 1))
    held = es.Fixed(lambda X: X[:, 0] < 0.1)
    simulation = es.Simulation(body, boundaries=[held], scheme=Lax(), time_step=es.TimeStep(cfl=0.3))
    simulation.run(until=5e-3)
    ledger, U = simulation.stepper.ledger, simulation.stepper.U
    assert abs(ledger.residual(U)) < 1e-11 * ledger.start
    assert not simulation.v[x[:, 0] < 0.1].any()
    before = simulation.x, simulation.v, simulation.F, ledger.accounts()
    simulation.stepper.step()
    after = simulation.x, simulation.v, simulation.F, ledger.accounts()
    assert all(np.array_equal(a, b) for a, b in zip(before[:3], after[:3], strict=True))
    assert before[3] == after[3]
