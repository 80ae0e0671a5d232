"""Matter that breaks: damage along paths of one particle, crack energy of bars, pieces, events, books, snapshots."""

import math

import numpy as np
import pytest
import warp as wp
from points import COPPER, KAPPA, MU, Point, mises, sheared, stretched

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.materials import (
    J2,
    Failing,
    JohnsonCookFailure,
    LinearElastic,
    LinearHardening,
    NeoHookean,
    PlasticStrain,
    PrincipalStrain,
    PrincipalStress,
)

SOFT = {"density": 1000.0, "young": 1e6, "poisson": 0.0}
METAL = J2(**COPPER, hardening=LinearHardening(yield_stress=0.4e9, modulus=0.1e9))
BRITTLE = [PrincipalStress(energy=400.0, strength=1e4), PrincipalStrain(energy=400.0, strain=0.01)]


@pytest.mark.parametrize("failure", BRITTLE, ids=lambda f: type(f).__name__)
def test_a_brittle_particle_takes_its_energy_and_keeps_its_pressure(failure):
    """Stretched one way, ν = 0: stress falls along a line, ∫ Ψ dD = G/width; then pressure is all it bears."""
    point, kappa = Point(Failing(material=NeoHookean(**SOFT), failure=failure, layers=2.0)), 1e6 / 3.0
    steps = np.linspace(0.0, 0.05, 1001)[1:]
    stress = []
    for e in steps:
        point.step(np.diag([1.0 + e, 1.0, 1.0]))
        stress.append(point.sigma[0, 0])
    stress = np.array(stress)
    assert stress.max() == pytest.approx(1e4, rel=0.01) and float(point.damage) == 1.0 and stress[-1] == 0.0
    assert sum(point.lost) == pytest.approx(400.0 / 2.0, rel=0.02) and min(point.lost) >= 0.0  # strains of 4 %
    half = np.interp(0.5 * (0.01 + 0.04), steps, stress)
    assert half == pytest.approx(0.5e4, rel=0.02)
    for F in (sheared(0.5), np.diag([1.2, 1.0, 1.1])):
        assert np.abs(point.step(F).sigma).max() < 1e-9 * 1e4
    squeezed = sheared(0.5) * 0.9
    point.step(squeezed)
    J = np.linalg.det(squeezed)
    np.testing.assert_allclose(point.sigma, kappa * math.log(J) / J * np.eye(3), rtol=1e-9, atol=1e-6)
    assert point.energy[-1] == pytest.approx(0.5 * kappa * math.log(J) ** 2) and sum(point.lost[1000:]) == 0.0


def test_unloading_keeps_the_damage_and_loads_again_along_the_secant():
    point = Point(Failing(material=NeoHookean(**SOFT), failure=BRITTLE[0], layers=2.0))
    for e in (0.005, 0.01, 0.015, 0.02):
        point.step(np.diag([1.0 + e, 1.0, 1.0]))
    damage, stress = float(point.damage), point.sigma[0, 0]
    assert 0.3 < damage < 0.9
    half = point.step(np.diag([1.01, 1.0, 1.0])).sigma[0, 0]
    assert half == pytest.approx(0.5 * stress, rel=0.02)
    again = point.step(np.diag([1.02, 1.0, 1.0]))
    assert again.sigma[0, 0] == stress and float(again.damage) == damage


def test_a_ductile_particle_is_whole_to_its_strain_and_then_takes_its_energy():
    """The same stress as without failure up to α_f; from there plastic work (1 − D) y Δα and G/width in sum."""
    plain = Point(METAL)
    point = Point(Failing(material=METAL, failure=PlasticStrain(energy=2e8, strain=0.2), layers=2.0))
    whole, after = 0.0, 0.0
    for e in np.linspace(0.0, 1.2, 601)[1:]:
        plain.step(stretched(e))
        point.step(stretched(e))
        if float(plain.plastic_strain) < 0.2:
            np.testing.assert_array_equal(point.sigma, plain.sigma)
            whole += point.lost[-1]
        else:
            after += point.lost[-1]
    assert float(point.damage) == 1.0 and np.abs(point.sigma).max() < 1e-9 * 0.4e9
    stored = mises(plain.sigma) ** 2 / (6.0 * MU)  # is let go beside the work
    assert after == pytest.approx(1e8 + stored, rel=0.01) and whole == pytest.approx(0.41e9 * 0.2, rel=0.01)


@pytest.mark.parametrize(("J", "dim"), [(1.0, 3), (1.003, 3), (1.003, 2)])
def test_johnson_and_cook_break_sooner_in_tension(J, dim):
    """At a constant triaxiality, κ ln J over y in uniaxial straining at volume J, drive is α/ε_f."""
    failure = JohnsonCookFailure(energy=1e9, D1=0.1, D2=0.8, D3=-1.5, D4=0.05, reference_rate=10.0)
    perfect = J2(**COPPER, hardening=LinearHardening(yield_stress=0.4e9))
    point = Point(Failing(material=perfect, failure=failure), es.Space(dim))
    e, dt = np.linspace(0.0, 0.1, 101)[1:], 1e-4
    point.step(J ** (1.0 / 3.0) * np.eye(3)[:dim, :dim], dt) if dim == 3 else None
    drive = []
    for s in e:
        F = J ** (1.0 / 3.0) * stretched(s) if dim == 3 else np.diag([math.exp(s) * J, math.exp(-s)])
        alpha = float(point.plastic_strain)
        point.step(F, dt)
        rate = (float(point.plastic_strain) - alpha) / dt
        star = KAPPA * math.log(J) / 0.4e9
        borne = (0.1 + 0.8 * math.exp(-1.5 * star)) * (1.0 + 0.05 * math.log(max(rate / 10.0, 1.0)))
        drive.append((float(point.plastic_strain) - alpha) / borne)
    assert float(point.failure_drive) == pytest.approx(sum(drive), rel=1e-6) and sum(drive) > 0.1


@wp.func
def apart(X: wp.vec2d, t: wp.float64) -> wp.vec2d:
    v, ramp = wp.float64(0.05), wp.float64(0.02)
    way = wp.where(t < ramp, wp.float64(0.5) * v / ramp * t * t, v * (t - wp.float64(0.5) * ramp))
    return wp.vec2d(way * wp.sign(X[0] - wp.float64(0.5)), wp.float64(0.0))


def necked(n, failure, jitter, **options):
    """A bar 1 m long with a neck 0.2 m wide of n particles, pulled by its ends; the end that is moved to the right."""
    spacing = 0.2 / n
    x, volume = box((0.0, 0.0), (1.0, 0.4), spacing, jitter=jitter)
    kept = (np.abs(x[:, 0] - 0.5) > 0.05) | (np.abs(x[:, 1] - 0.2) < 0.1)
    x, volume = x[kept], np.broadcast_to(volume, len(kept))[kept]
    column = np.floor(x[:, 0] / spacing)
    body = es.Body(x=x, volume=volume, material=Failing(material=NeoHookean(**SOFT), failure=failure))
    held = [es.Motion(apart, column < 3), es.Motion(apart, column > column.max() - 3)]
    return es.Simulation(body, boundaries=held, **options), held[1]


@pytest.mark.parametrize("jitter", [0.0, 0.1])
@pytest.mark.parametrize("failure", BRITTLE, ids=lambda f: type(f).__name__)
def test_a_crack_takes_the_same_energy_whatever_the_spacing(failure, jitter, caplog):
    """A bar pulled in two at three spacings: G within a tenth; no load left, the event logged, the books closed."""
    taken = []
    for n in (8, 12, 16):
        simulation, end = necked(n, failure, jitter)
        load = []
        while simulation.t < 1.199:
            simulation.run(simulation.t + 0.05)
            load.append(simulation.reaction(end)[0] / 0.2)
        energy, damage = simulation.energy(), simulation.history("damage")
        assert 0.9e4 < max(load) < 1.15e4
        # single layers that were cut have second neighbours across, which hold a little
        assert abs(np.mean(load[-4:])) < 0.15 * max(load)
        assert n <= (damage == 1.0).sum() < 3 * n and "matter has failed by t =" in simulation.broken
        assert abs(energy["residual"]) < 1e-11 and abs(energy["stepping"]) < 1e-3 * -energy["material"]
        taken.append(-energy["material"] / (0.2 * failure.energy))
    assert np.abs(np.array(taken) - 1.0).max() < 0.1, taken
    assert caplog.text.count("is among the first") == 3


@pytest.mark.parametrize("simd", [True, False])
def test_pieces_keep_mass_and_momenta_and_a_restored_run_goes_on(simd):
    """A free plate torn by its own motion: both momenta to round-off, particles that are cut fly straight on."""
    es.execution.set_simd(simd)
    x, volume = box((0.0, 0.0), (1.0, 0.5), 1.0 / 16, jitter=0.1)
    velocity = np.stack([np.where(x[:, 0] > 0.5, 2.0, -1.0) + x[:, 1], 3.0 * (x[:, 0] - 0.4)], axis=1)
    material = Failing(material=NeoHookean(**SOFT), failure=PrincipalStress(energy=5.0, strength=1e4))
    simulation = es.Simulation(es.Body(x=x, volume=volume, material=material, velocity=velocity))
    momenta = simulation.momentum(), simulation.angular_momentum()
    simulation.run(0.1)
    cut = (simulation.history("damage") == 1.0) & (simulation.J > 1.0)
    held, counters = {k: np.array(v.numpy()) for k, v in simulation.evolving().items()}, simulation.counters
    before, speed = simulation.F[cut], simulation.v[cut]
    simulation.step(20)
    assert cut.sum() > 10
    np.testing.assert_array_equal(simulation.F[cut], before)
    np.testing.assert_allclose(simulation.v[cut], speed, rtol=1e-13)
    np.testing.assert_allclose(simulation.momentum(), momenta[0], atol=1e-11)
    energy = simulation.energy()
    assert abs(energy["residual"]) < 1e-12 * energy["total"] and -energy["material"] > 0.03 * energy["total"]
    ahead = simulation.x
    simulation.restore(held, counters)
    simulation.step(20)
    assert np.array_equal(simulation.x, ahead)
    # where pairs were cut M4 of the positions is no longer F, and stress exerts a torque: 1 %
    np.testing.assert_allclose(simulation.angular_momentum(), momenta[1], rtol=0.015)


def test_neighbours_read_anew_bear_pressure_after_failure():
    """A block that has failed is squeezed by its own motion and comes back as a fluid: no shear, no tension, J ≤ 1."""
    x, volume = box((0.0, 0.0), (1.0, 1.0), 1.0 / 12)
    material = Failing(material=NeoHookean(**SOFT), failure=PrincipalStrain(energy=1e-3, strain=1e-4))
    body = es.Body(x=x, volume=volume, material=material, velocity=np.array([-4.0, 2.0]) * (x - 0.5))
    simulation = es.Simulation(body, arrangement=es.Current())
    simulation.run(0.02)
    sigma, failed = simulation.cauchy_stress, simulation.history("damage") == 1.0
    assert failed.mean() > 0.9 and simulation.J[failed].max() < 1.0 + 4.0 * 0.02
    assert sigma[failed][:, [0, 1], [0, 1]].max() < 1e-9 and np.abs(sigma[failed, 0, 1]).max() < 1e-9
    assert sigma[failed, 0, 0].min() < -100.0
    energy = simulation.energy()
    assert abs(energy["residual"]) < 1e-11 * energy["total"] + 1e-11


def test_bodies_that_break_alike_keep_their_own_matter():
    """Two with the same criterion and other stiffnesses: each reacts by its own."""
    x, volume = box((0.0, 0.0), (1.0, 1.0), 0.25)
    bodies = []
    for k, young in enumerate((1e6, 1e3)):
        whole = NeoHookean(density=1000.0, young=young, poisson=0.0)
        velocity = 0.1 * (x - 0.5) * np.array([1.0, 0.0])
        material = Failing(material=whole, failure=BRITTLE[1])
        bodies.append(es.Body(x=x + 5.0 * k, volume=volume, material=material, velocity=velocity, name=str(k)))
    simulation = es.Simulation(bodies)
    simulation.step(3)
    stress, strain = simulation.cauchy_stress[:, 0, 0], simulation.F[:, 0, 0] - 1.0
    young = np.repeat([1e6, 1e3], 16)
    np.testing.assert_allclose(stress, young * strain, rtol=0.02)


def test_damage_is_in_snapshots_and_case_files(tmp_path):
    from warp_eulsph.output import Recording, Run, record

    simulation, _ = necked(6, BRITTLE[0], 0.0)
    record(simulation, tmp_path, 0.3, Recording())
    last = Run(tmp_path)[-1]
    assert np.allclose(last["damage"], simulation.history("damage"), rtol=1e-6) and last["damage"].max() > 0.3
    assert last.units["crack_width"] == "m"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PrincipalStress(energy=0.0, strength=1.0), "energy must be positive"),
        (lambda: PrincipalStress(energy=1.0, strength=-1.0), "strength must be positive"),
        (lambda: PrincipalStrain(energy=1.0, strain=0.0), "strain must be positive"),
        (lambda: JohnsonCookFailure(energy=1.0, D1=-1.0, D2=0.5, D3=-1.0), r"D1 \+ D2 e\^\(1.5 D3\) must be positive"),
        (lambda: JohnsonCookFailure(energy=1.0, D1=1.0, D2=0.5, D3=-1.0, melting=1.0), "melting must be above"),
        (lambda: JohnsonCookFailure(energy=1.0, D1=1.0, D2=0.5, D3=-1.0, D5=-2.0), "D5 must be above -1"),
        (
            lambda: Failing(material=NeoHookean(**SOFT), failure=PlasticStrain(energy=1.0, strain=0.1)),
            "PlasticStrain reads 'plastic_strain', which NeoHookean does not remember",
        ),
        (lambda: Failing(material=LinearElastic(**SOFT), failure=BRITTLE[0]), "LinearElastic is for small turns"),
        (lambda: Failing(material=METAL, failure=BRITTLE[0], layers=0.0), "layers must be positive"),
    ],
)
def test_bad_parameters_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_what_is_no_law_or_has_surface_vectors_is_refused():
    with pytest.raises(ValueError, match=r"^material must be a law with young and poisson"):
        Failing(material=es.TaitLiquid(density=1.0, sound_speed=1.0), failure=BRITTLE[0])
    x, volume = box((0.0, 0.0), (1.0, 1.0), 0.1)
    material = Failing(material=NeoHookean(**SOFT), failure=BRITTLE[0])
    with pytest.raises(ValueError, match="cannot have surface vectors"):
        es.Simulation(es.Body(x=x, volume=volume, material=material, surface=0.0))
