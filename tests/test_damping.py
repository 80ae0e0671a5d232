"""Dynamic relaxation: exact static answers to a stated residual, its work in an account of its own."""

import numpy as np
import pytest
import warp as wp
from bodies import bits
from case_files import small
from kept_runs import StopAfter

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.cases import CaseError, parse_case
from warp_eulsph.geometry import box
from warp_eulsph.output import Run, record
from warp_eulsph.output.checkpoint import take
from warp_eulsph.settling import residual

RUBBER = es.NeoHookean(density=1000.0, young=1e6, poisson=0.3)


def hanging_bar(n, damping=es.Damping(), **options):
    """A bar of 1 m that hangs under its weight, its clamp, and the error of its displacements over the largest."""
    density, young, g = 1000.0, 1e6, 10.0
    x = (np.arange(n) + 0.5)[:, None] / n
    body = es.Body(x=x, volume=1.0 / n, material=es.Bar(density=density, young=young))
    clamp = es.Clamped((0.0,), (-1.0,))
    simulation = es.Simulation(body, boundaries=[es.BodyForce((g,)), clamp, damping], **options)
    exact = density * g / young * (x - 0.5 * x**2)
    return simulation, clamp, lambda: np.abs(simulation.displacement - exact).max() / exact.max()


@pytest.mark.parametrize("scheme", [es.Verlet(), es.LaxWendroff()], ids=["verlet", "lax-wendroff"])
def test_a_bar_under_its_weight_comes_to_its_static_shape(scheme):
    errors = []
    for n in (12, 24):
        simulation, clamp, error = hanging_bar(n, scheme=scheme)
        assert es.settle(simulation, 1e-6, until=5.0) == residual(simulation) <= 1e-6
        errors.append(error())
        assert simulation.reaction(clamp)[0] == pytest.approx(-1e4, rel=1e-4)
        energy = simulation.energy()
        # The weight falls twice as far as it needs to store what it stores; damping takes the rest (Clapeyron)
        assert energy["external"] == pytest.approx(2.0 * energy["stored"], rel=1e-3)
        assert energy["damping"] + energy["dissipation"] == pytest.approx(-energy["stored"], rel=2e-3)
        assert abs(energy["dissipation"]) < 5e-3 * abs(energy["damping"])
        assert abs(energy["residual"]) < 1e-11 * energy["stored"]
    assert errors[1] < 0.005 and np.log2(errors[0] / errors[1]) > 1.7


def test_the_rate_follows_the_lowest_frequency():
    """A clamped-free bar: ω = π c / 2 L, so that critical damping is c π / L; three periods are enough at it."""
    simulation, _, _ = hanging_bar(24)
    es.settle(simulation, 1e-6, until=5.0)
    wave = np.sqrt(1e6 / 1000.0)
    assert simulation.conditions[2]._rate.numpy()[0] == pytest.approx(np.pi * wave, rel=0.01)
    assert simulation.t < 3.0 * 4.0 / wave
    slow, _, _ = hanging_bar(24, es.Damping(rate=0.1 * np.pi * wave))
    es.settle(slow, 1e-6, until=20.0)
    assert slow.t > 2.0 * simulation.t


def sunk_block(dim, n):
    """A block between smooth walls under its weight; its base, and the error of its displacements over the largest.

    Exactly, uniaxial strain: ρ g (L y − y²/2)/M at the height y.
    """
    law = es.LinearElastic(density=1000.0, young=1e6, poisson=0.3)
    modulus = 1e6 * 0.7 / (1.3 * 0.4)
    x, volume = box((0.0,) * dim, (0.5,) * (dim - 1) + (1.0,), 1 / n)
    sides = es.Fixed(axes=range(dim - 1))
    base = es.Clamped((0.0,) * dim, (0.0,) * (dim - 1) + (-1.0,))
    body = es.Body(x=x, volume=volume, material=law)
    simulation = es.Simulation(body, boundaries=[es.Gravity(10.0), sides, base, es.Damping()])
    es.settle(simulation, 1e-4, until=5.0)
    exact = -1000.0 * 10.0 / modulus * (x[:, -1] - 0.5 * x[:, -1] ** 2)
    assert simulation.reaction(base)[-1] == pytest.approx(1e4 * 0.5 ** (dim - 1), rel=1e-3)
    return np.abs(simulation.displacement[:, -1] - exact).max() / np.abs(exact).max()


def test_a_block_between_smooth_walls_sinks_as_it_should():
    """At second order: 1 to 2 % at 12 across, 0.4 % at 24."""
    errors = [sunk_block(2, n) for n in (12, 24)]
    assert errors[1] < 0.005 and np.log2(errors[0] / errors[1]) > 1.5
    assert sunk_block(3, 12) < 0.03


def test_a_beam_sags_as_beams_do():
    """Euler-Bernoulli and the shear of Timoshenko in plane strain: 8.92 mm; at 12 across within some per cent."""
    young, poisson, density, g, n = 1e6, 0.3, 1000.0, 0.01, 12
    x, volume = box((0.0, 0.0), (5.0, 1.0), 1.0 / n)
    law = es.SaintVenantKirchhoff(density=density, young=young, poisson=poisson)
    clamp = es.Clamped((0.0, 0.0), (-1.0, 0.0))
    beam = es.Simulation(es.Body(x=x, volume=volume, material=law), boundaries=[es.Gravity(g), clamp, es.Damping()])
    es.settle(beam, 1e-3, until=20.0)
    bending = density * g * 5.0**4 / 8.0 / (young / (1.0 - poisson**2) / 12.0)
    shear = density * g * 5.0**2 / 2.0 / (5.0 / 6.0 * young / 2.0 / (1.0 + poisson))
    sag = -beam.displacement[x[:, 0] > 5.0 - 1.0 / n, 1].mean()
    assert 0.97 < sag / (bending + shear) < 1.05
    np.testing.assert_allclose(beam.reaction(clamp), [0.0, 50.0], atol=0.1)


def test_a_strip_between_grips_settles_by_its_reactions():
    """Nothing loads it, grips pull it apart: F = E' A ε in the middle of a long strip, to second order in ε."""
    x, volume = box((0.0, 0.0), (2.0, 0.4), 0.05)
    law = es.SaintVenantKirchhoff(density=1000.0, young=1e6, poisson=0.0)
    grips = [
        es.Velocity(region, lambda x, t, way=way: way * 0.1 * (t < 0.1), axes=[0])
        for region, way in ((lambda X: X[:, 0] < 0.05, -1.0), (lambda X: X[:, 0] > 1.95, 1.0))
    ]
    strip = es.Simulation(es.Body(x=x, volume=volume, material=law), boundaries=[*grips, es.Damping()])
    strip.run(until=0.1)
    es.settle(strip, 1e-3, until=5.0)
    pulled = strip.displacement[-1, 0] - strip.displacement[0, 0]
    assert pulled == pytest.approx(0.02, rel=0.05)  # but for the last step of the ramp
    force = strip.reaction(grips[1])[0]
    strain = pulled / 1.95
    assert force == pytest.approx(1e6 * 0.4 * strain * (1.0 + 1.5 * strain), rel=0.02)
    assert force == pytest.approx(-strip.reaction(grips[0])[0], rel=1e-2)


def test_single_precision_settles():
    simulation, _, error = hanging_bar(24, dtype=wp.float32)
    es.settle(simulation, 1e-3, until=5.0)  # round-off of the stresses leaves 2e-4 of the weight
    assert error() < 0.005


def test_a_body_of_its_own_is_damped():
    """A free body loses its velocity as exp(−c t), another keeps it."""
    x, volume = box((0, 0), (1, 1), 0.2)
    bodies = [es.Body(x=x + 3.0 * k, volume=volume, material=RUBBER, velocity=(2.0, 0.0), name=f"{k}") for k in (0, 1)]
    simulation = es.Simulation(bodies, boundaries=[es.Damping(rate=10.0, body="1")])
    simulation.run(until=0.1)
    v = simulation.v[:, 0].reshape(2, -1).mean(axis=1)
    assert v[0] == pytest.approx(2.0, rel=1e-12) and v[1] == pytest.approx(2.0 * np.exp(-1.0), rel=0.03)


def test_at_most_a_quarter_of_the_velocity_goes_in_a_step():
    x, volume = box((0, 0), (1, 1), 0.2)
    body = es.Body(x=x, volume=volume, material=RUBBER, velocity=(2.0, 0.0))
    simulation = es.Simulation(body, boundaries=[es.Damping(rate=1e9)])
    simulation.step()
    np.testing.assert_allclose(simulation.v[:, 0], 1.5, rtol=1e-12)


def kept_block(**options):
    x, volume = box((0, 0), (1, 1), 0.2, jitter=0.1)
    body = es.Body(x=x, volume=volume, material=RUBBER, velocity=np.sin(3.0 * x))
    boundaries = [es.Gravity(), es.Fixed(lambda X: X[:, 1] < 0.2), es.Damping()]
    return es.Simulation(body, boundaries=boundaries, **options)


def test_resumes_bit_for_bit_and_by_graphs():
    whole = kept_block()
    whole.step(5)
    stored = take(whole, {}, {})
    whole.step(7)
    resumed = kept_block()
    resumed.restore(stored.arrays, stored.counters)
    resumed.step(7)
    assert bits(resumed) == bits(whole)
    before = execution._graphs
    try:
        found = []
        for on in (False, True):
            execution.set_graphs(on)
            simulation = kept_block()
            simulation.step(12)
            assert simulation.by_graphs is on
            found.append(bits(simulation))
        assert found[0] == found[1] == bits(whole)
    finally:
        execution.set_graphs(before)


def test_without_it_its_account_is_empty_and_nothing_settles():
    x, volume = box((0, 0), (1, 1), 0.2)
    simulation = es.Simulation(es.Body(x=x, volume=volume, material=RUBBER), boundaries=[es.Gravity()])
    simulation.step(3)
    assert simulation.energy()["damping"] == 0.0
    with pytest.raises(ValueError, match="settle needs a Damping"):
        es.settle(simulation, until=1.0)


def test_mistakes_are_named():
    with pytest.raises(ValueError, match="rate must be positive and finite, got 0"):
        es.Damping(rate=0.0)
    with pytest.raises(ValueError, match="a residual must be positive and finite, got 0"):
        es.settle(kept_block(), 0.0, until=1.0)
    simulation = kept_block()
    with pytest.raises(RuntimeError, match=r"no equilibrium by t = .*: residual .*, asked for 1e-09"):
        es.settle(simulation, 1e-9, until=0.01)
    assert residual(es.Simulation(simulation.bodies, boundaries=[es.Damping()])) == np.inf


def settling_case(**changes):
    case = small(settle=1e-3, until=5.0, boundary=["Gravity", {"kind": "Fixed", "region": "y < 0.25"}, "Damping"])
    return {**case, **changes}


def test_runs_end_in_equilibrium_stopped_on_the_way_or_not(tmp_path):
    """By a case file: the last frame is the state at rest, the same one after a stop between two looks."""
    case = parse_case(settling_case())
    for name, stops in (("whole", ()), ("stopped", (33, 50))):
        stop = StopAfter(*stops)
        for _ in range(len(stops) + 1):
            simulation = case.build()
            options = {"resume": True, "stop": stop, "watch": stop.watch}
            record(simulation, tmp_path / name, case.until, case.recording(simulation), **options)
        assert residual(simulation) <= 1e-3 and simulation.t < 1.0 and simulation.steps % 20 == 0
        assert Run(tmp_path / name).state == "done"
    whole, stopped = Run(tmp_path / "whole"), Run(tmp_path / "stopped")
    assert whole[-1].step == stopped[-1].step == simulation.steps > 50
    np.testing.assert_array_equal(whole[-1].x, stopped[-1].x)


def test_runs_that_never_come_to_rest_are_refused(tmp_path):
    case = parse_case(settling_case(boundary=["Gravity"]))
    simulation = case.build()
    with pytest.raises(ValueError, match="settle needs a Damping"):
        record(simulation, tmp_path / "run", case.until, case.recording(simulation))
    with pytest.raises(CaseError, match="settle: input should be greater than 0"):
        parse_case(settling_case(settle=0.0))
