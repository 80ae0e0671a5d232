"""What objects show of themselves, and the fields a simulation makes from its state."""

import io
import sys

import numpy as np
import pytest
from bodies import COMPRESSIBLE

import warp_eulsph as es
from warp_eulsph.geometry import box


def block(n=6, dim=2, **options):
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / n)
    return es.Body(x=x, volume=volume, material=COMPRESSIBLE, **options)


def stretched(reference):
    """A block two steps after it was set off apart, its foot held, under its weight."""
    body = block(velocity=20.0 * block().x)
    conditions = [es.Fixed(lambda X: X[:, 1] < 1 / 6), es.BodyForce((0.0, -9.81))]
    simulation = es.Simulation(body, boundaries=conditions, reference=reference)
    simulation.step(2)
    return simulation


def test_body_is_a_short_table():
    body = block(n=20, name="block <1>")
    assert len(repr(body)) < 500
    for part in ("Body 'block <1>': 400 particles, 2-D", "NeoHookean(", "0.05 m", "1100 kg/m"):
        assert part in repr(body)
    assert "<th style" in body._repr_html_() and "block &lt;1&gt;" in body._repr_html_()


def test_simulation_is_a_short_table(device):
    simulation = stretched(es.Always())
    assert len(repr(simulation)) < 700
    for part in (
        f"36 particles, 2-D, float64 on {device.alias}",
        "'body' (36 of NeoHookean)",
        "Fixed, BodyForce",
        "step 2",
    ):
        assert part in repr(simulation)
    assert simulation._repr_html_().startswith("<table>")


@pytest.mark.parametrize("reference", [es.Never(), es.Always()])
def test_stresses_are_those_of_the_law(reference):
    simulation = stretched(reference)
    F = np.zeros((36, 3, 3))
    F[:, :2, :2], F[:, 2, 2] = simulation.F, 1.0
    J = np.linalg.det(F)
    mu, kappa = COMPRESSIBLE.constants().values()
    inverse = np.linalg.inv(F).transpose(0, 2, 1)
    trace = np.einsum("nij,nij->n", F, F)
    P = mu * (J ** (-2 / 3))[:, None, None] * (F - (trace / 3)[:, None, None] * inverse)
    P += (kappa * (J - 1) * J)[:, None, None] * inverse
    assert simulation.first_piola == pytest.approx(P, abs=1e-9 * np.abs(P).max())
    sigma = P @ F.transpose(0, 2, 1) / J[:, None, None]
    assert simulation.cauchy_stress == pytest.approx(sigma, abs=1e-9 * np.abs(P).max())
    density = 0.5 * mu * (J ** (-2 / 3) * trace - 3) + 0.5 * kappa * (J - 1) ** 2
    assert simulation.strain_energy_density == pytest.approx(density, rel=1e-9)
    volume = simulation.bodies[0].volume
    assert (simulation.strain_energy_density * volume).sum() == pytest.approx(simulation.energy()["stored"], rel=1e-12)


@pytest.mark.parametrize("reference", [es.Never(), es.Always()])
def test_acceleration_is_what_changes_velocities(reference):
    simulation = stretched(reference)
    v = simulation.v
    simulation.step()
    change = (simulation.v - v) / simulation.dt
    assert simulation.acceleration == pytest.approx(change, abs=1e-9 * np.abs(change).max())
    mass = 1100.0 / 36
    assert simulation.force == pytest.approx(mass * change, abs=1e-9 * mass * np.abs(change).max())


def test_displacement_is_in_the_order_of_the_body():
    rng = np.random.default_rng(3)
    x, volume = box((0.0, 0.0), (1.0, 1.0), 1 / 8)
    x = rng.permutation(x)
    simulation = es.Simulation(es.Body(x=x, volume=volume, material=COMPRESSIBLE, velocity=(3.0, -1.0)))
    simulation.run(1e-3)
    assert simulation.displacement == pytest.approx(np.broadcast_to([3e-3, -1e-3], x.shape), abs=1e-12)


def test_a_bar_is_shown_when_asked_for_and_else_only_where_somebody_looks_on(monkeypatch, tmp_path):
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    simulation = es.Simulation(block(), reference=es.Never())
    simulation.run(1e-4)
    assert not sys.stderr.getvalue()
    simulation.run(2e-4, progress=True)
    assert "100.0%" in sys.stderr.getvalue() and "t = 0.0002 s" in sys.stderr.getvalue()
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    simulation.run(3e-4, output=tmp_path / "run", progress=True)
    assert "100.0%" in sys.stderr.getvalue()
    assert simulation.watch is None
