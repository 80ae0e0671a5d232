"""Drucker–Prager plasticity: paths with closed forms, invariances, the cut-off, every dimension, books of bodies."""

import math

import numpy as np
import pytest
import warp as wp
from points import DOUBLE, Point, mises, sheared
from scipy.linalg import expm

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.materials import DruckerPrager, Failing, PrincipalStress
from warp_eulsph.space import Space

ELASTIC = {"density": 1800.0, "young": 20e6, "poisson": 0.25}
MU, KAPPA = 8e6, 20e6 / 1.5
LAWS = {
    "sand": DruckerPrager(**ELASTIC, friction=35.0, dilation=5.0),
    "associated": DruckerPrager(**ELASTIC, friction=30.0, dilation=30.0, cohesion=2e4),
    "cut": DruckerPrager(**ELASTIC, friction=30.0, dilation=10.0, cohesion=2e4, tension=5e3),
    "clay": DruckerPrager(**ELASTIC, friction=0.0, cohesion=3e4),
}


def surface(law):
    """A, B, k, T by the definitions."""
    s, c, f = (
        g(math.radians(a)) for g, a in ((math.sin, law.friction), (math.cos, law.friction), (math.sin, law.dilation))
    )
    A, k = 6.0 * s / (3.0 - s), 6.0 * law.cohesion * c / (3.0 - s)
    apex = k / A if A else math.inf
    return A, 6.0 * f / (3.0 - f), k, apex if law.tension is None else min(law.tension, apex)


def kirchhoff(point, F):
    return np.linalg.det(F) * point.sigma


def expected(law, q, t):
    """(q, t) on or within the surface: nearest in energy where flow is associated, along the dilation else; by search.

    Of all returns (q − 3μ a, t − κ (B a + b)), a and b not negative, the one that meets both conditions and works only
    where they are met (Koiter), found by their four cases instead of by order.
    """
    A, B, k, T = surface(law)
    for a, b in (
        (0.0, 0.0),
        ((q + A * t - k) / (3.0 * MU + A * B * KAPPA), 0.0),
        (0.0, (t - T) / KAPPA),
        ((q - k + A * T) / (3.0 * MU), (t - T) / KAPPA - B * (q - k + A * T) / (3.0 * MU)) if A else (math.nan,) * 2,
    ):
        onto = q - 3.0 * MU * a, t - KAPPA * (B * a + b)
        small = 1e-9 * max(q, abs(t), 1.0)
        if min(a, b) >= 0.0 and onto[0] >= -small and onto[0] + A * onto[1] <= k + small and onto[1] <= T + small:
            return max(onto[0], 0.0), onto[1]
    raise AssertionError((q, t))


@pytest.mark.parametrize("name", LAWS)
def test_triaxial_compression_at_constant_confinement(name):
    """By the strains of the closed form, in few steps: Mohr and Coulomb's strength; shear and dilation exact."""
    law, p0 = LAWS[name], 1e5
    A, B, k, _ = surface(law)
    phi = math.radians(law.friction)
    q = (k + A * p0) / (1.0 - A / 3.0)
    Nphi = math.tan(math.pi / 4.0 + phi / 2.0) ** 2
    assert q == pytest.approx(p0 * (Nphi - 1.0) + 2.0 * law.cohesion * math.sqrt(Nphi), rel=1e-12)
    point = Point(law)
    point.step(np.eye(3) * math.exp(-p0 / (3.0 * KAPPA)))  # pressed from all sides
    np.testing.assert_allclose(kirchhoff(point, point.F), -p0 * np.eye(3), atol=1e-9 * p0)
    shear = np.diag([-1.0, 0.5, 0.5])
    for delta in (0.0, 0.01, 0.1, 0.3):
        volume = -(p0 + q / 3.0) / KAPPA + B * delta
        F = expm(shear * (q / (3.0 * MU) + delta) + volume / 3.0 * np.eye(3))
        point.step(F)
        np.testing.assert_allclose(kirchhoff(point, F), -np.diag([p0 + q, p0, p0]), atol=1e-9 * q)
        np.testing.assert_allclose(point.ahead, point.sigma, atol=1e-9 * q)  # the half step's form
        assert float(point.plastic_strain) == pytest.approx(delta, abs=1e-12)
        assert float(point.plastic_volume) == pytest.approx(B * delta, abs=1e-12)
    assert float(point.plastic_work) == pytest.approx(sum(point.lost), rel=1e-12)
    t = -(p0 + q / 3.0)
    assert sum(point.lost) == pytest.approx(0.3 * (q + B * t), rel=1e-9)


def test_uniaxial_strain_pressed_and_pulled():
    """Straight lines in q and t, whatever the steps: yield on the way in, elastic back, the other side, cut-off."""
    law = LAWS["cut"]
    T, point, q, t, last = surface(law)[3], Point(law), 0.0, 0.0, 0.0  # q with its sign, 2/3 of it axial
    for target, steps in ((-0.03, 7), (-0.01, 40), (-0.02, 3), (0.01, 11)):
        for strain in np.linspace(last, target, steps + 1)[1:]:
            trial, mean = q + 2.0 * MU * (strain - last), t + KAPPA * (strain - last)
            size, t = expected(law, abs(trial), mean)
            q, last = math.copysign(size, trial), strain
            F = np.diag([math.exp(strain), 1.0, 1.0])
            point.step(F)
            found = kirchhoff(point, F)
            np.testing.assert_allclose(found, np.diag([t + 2.0 / 3.0 * q, t - q / 3.0, t - q / 3.0]), atol=1e-9 * 1e5)
            np.testing.assert_allclose(point.ahead, point.sigma, atol=1e-9 * 1e5)
    assert t == T and float(point.opening) > 0.0 and min(point.lost) > -1e-9


def test_shear_at_constant_volume_dilates_into_pressure():
    """Pure shear of a plane: q rises by 3μ A B κ/(3μ + A B κ) per strain when it yields; without dilation it stays."""
    for name in ("associated", "sand", "clay"):
        law, p0 = LAWS[name], 5e4
        A, B, k, _ = surface(law)
        point, size = Point(law), math.exp(-p0 / (3.0 * KAPPA))
        point.step(np.eye(3) * size)
        for s in np.linspace(0.0, 0.2, 9)[1:]:
            point.step(np.diag(np.exp([s, -s, 0.0])) * size)
            strain = 2.0 * s / math.sqrt(3.0)  # q = 3μ strain while elastic
            at = (k + A * p0) / (3.0 * MU)
            q = k + A * p0 + (strain - at) * 3.0 * MU * A * B * KAPPA / (3.0 * MU + A * B * KAPPA)
            tau = kirchhoff(point, point.F)
            assert mises(tau) == pytest.approx(q, rel=1e-9)
            assert -np.trace(tau) / 3.0 == pytest.approx(p0 + (q - k - A * p0) / A if A else p0, rel=1e-9)
    law = LAWS["sand"]  # plane strain that keeps volume: against Mohr and Coulomb's radius p sin φ
    A, s = surface(law)[0], math.sin(math.radians(35.0))
    assert A / math.sqrt(3.0) / s == pytest.approx(2.0 * math.sqrt(3.0) / (3.0 - s), rel=1e-12)


def path(s):
    """Pressed, then sheared one way and another, with volumes that change; s from 0 to 1."""
    return (sheared(0.3 * math.sin(3.0 * s)).T @ sheared(0.3 * s)) * (1.0 - 0.004 * min(4.0 * s, 1.0) + 0.003 * s * s)


def reference(law, F_path):
    """(τ, α, θ_p) along a path of F by its own algorithm in numpy."""
    C, alpha, theta = np.eye(3), 0.0, 0.0
    for F in F_path:
        values, R = np.linalg.eigh(F @ C @ F.T)
        e = 0.5 * np.log(values)
        e -= e.mean()
        q, t = math.sqrt(6.0) * MU * np.linalg.norm(e), KAPPA * (math.log(np.linalg.det(F)) - theta)
        onto, mean = expected(law, q, t)
        theta, alpha = theta + (t - mean) / KAPPA, alpha + (q - onto) / (3.0 * MU)
        if onto < q:
            e *= onto / q
            G = np.linalg.inv(F) * np.linalg.det(F) ** (1.0 / 3.0)
            C = G @ (R * np.exp(2.0 * e)) @ R.T @ G.T
    return mean * np.eye(3) + 2.0 * MU * (R * e) @ R.T, alpha, theta


@pytest.mark.parametrize("name", LAWS)
def test_turning_shear_against_fine_steps(name):
    """Stress and strains of 800 steps within 0.1 % of 4000, first order; the same steps in numpy to round-off."""
    law, found = LAWS[name], []
    fine = reference(law, [path(s) for s in np.linspace(0.0, 1.0, 4001)[1:]])
    for steps in (400, 800):
        point = Point(law)
        for s in np.linspace(0.0, 1.0, steps + 1)[1:]:
            point.step(path(s))
        tau = kirchhoff(point, path(1.0))
        found.append(
            np.array([np.abs(tau - fine[0]).max() / mises(fine[0]), float(point.plastic_strain) / fine[1] - 1.0])
        )
    assert (np.abs(found[1]) < 1e-3).all() and (np.abs(found[1]) < 0.6 * np.abs(found[0]) + 1e-6).all()
    own = reference(law, [path(s) for s in np.linspace(0.0, 1.0, 801)[1:]])
    np.testing.assert_allclose(tau, own[0], atol=1e-9 * mises(own[0]))
    assert float(point.plastic_strain) == pytest.approx(own[1], rel=1e-10)
    assert float(point.plastic_volume) == pytest.approx(own[2], abs=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_rotation_turns_the_stress_and_flow_dissipates(name):
    law = LAWS[name]
    A, _, k, T = surface(law)
    plain, turned, anew = Point(law), Point(law), Point(law)
    for s in np.linspace(0.0, 1.0, 41)[1:]:
        Q = expm(s * np.array([[0.0, -7.0, 2.0], [7.0, 0.0, -3.0], [-2.0, 3.0, 0.0]]))
        plain.step(path(s))
        turned.step(Q @ path(s))
        anew.step(path(s), anew=True)
        np.testing.assert_allclose(turned.sigma, Q @ plain.sigma @ Q.T, atol=1e-10 * 1e5)
        np.testing.assert_allclose(anew.sigma, plain.sigma, atol=1e-10 * 1e5)  # rebased
        tau = kirchhoff(plain, path(s))
        assert mises(tau) + A * np.trace(tau) / 3.0 <= k + 1e-9 * 1e5 and np.trace(tau) / 3.0 <= T + 1e-9 * 1e5
        np.testing.assert_allclose(plain.ahead, plain.sigma, atol=1e-9 * 1e5)
        assert np.linalg.det(plain.plastic_metric) == pytest.approx(1.0, abs=1e-12)
    assert min(plain.lost) >= 0.0 and sum(plain.lost) > 0.0
    assert float(anew.plastic_strain) == pytest.approx(float(plain.plastic_strain), rel=1e-9)
    assert anew.energy[-1] == pytest.approx(plain.energy[-1], rel=1e-8)


def test_the_apex_bears_the_cohesion_and_no_more_and_openings_close_freely():
    """What is blown up bears the apex' tension, nothing while it closes, and pressure again where it was before."""
    for name in ("sand", "associated", "cut"):
        law, pressed = LAWS[name], Point(LAWS[name]).step(np.eye(3) * 0.999).sigma
        (A, B, k, T), point = surface(law), Point(law)
        if name == "associated":  # c cot φ
            assert pytest.approx(2e4 / math.tan(math.radians(30.0))) == T
        point.step(np.eye(3) * 1.05 @ sheared(1e-3))
        tau, opened = kirchhoff(point, point.F), 3.0 * math.log(1.05) - T / KAPPA
        assert np.trace(tau) / 3.0 == pytest.approx(T, abs=1e-4)
        assert mises(tau) <= k - A * T + 1e-3
        assert float(point.plastic_volume) == pytest.approx(opened, rel=1e-9)
        assert sum(point.lost) >= T * float(point.opening)
        point.step(np.eye(3) * 1.02)  # on its way back
        left = 3.0 * math.log(1.02)
        assert abs(np.trace(point.sigma)) < 1e-3 and float(point.plastic_volume) == pytest.approx(left, rel=1e-9)
        dilated = B * float(point.plastic_strain)
        assert float(point.opening) == pytest.approx(left - dilated, rel=1e-9) and 0.0 <= dilated < 0.02
        point.step(np.eye(3) * 1.02 @ sheared(0.02))  # what dilates fills the gap, and presses nothing
        assert np.trace(point.sigma) == pytest.approx(0.0, abs=1e-3) and mises(kirchhoff(point, point.F)) <= k + 1e-3
        size = math.exp(B * float(point.plastic_strain) / 3.0) * 0.999
        point.step(size * sheared(0.02))
        assert np.trace(size**3 * point.sigma) == pytest.approx(np.trace(0.999**3 * pressed), rel=1e-6)
        assert float(point.opening) < 1e-12 and min(point.lost) >= 0.0


@pytest.mark.parametrize("dim", [1, 2])
def test_fewer_dimensions_are_those_of_plane_and_uniaxial_strain(dim):
    flat, full = Point(LAWS["cut"], Space(dim)), Point(LAWS["cut"])
    for s in np.linspace(0.0, 1.0, 20)[1:]:
        F = np.eye(3)
        F[:dim, :dim] = (path(s))[:dim, :dim]
        flat.step(F[:dim, :dim], anew=True)
        full.step(F)
        np.testing.assert_allclose(flat.sigma, full.sigma[:dim, :dim], atol=1e-11 * KAPPA)
    assert float(flat.plastic_strain) == pytest.approx(float(full.plastic_strain), rel=1e-9)


def test_float32_follows():
    single, double = Point(LAWS["cut"], Space(3, wp.float32)), Point(LAWS["cut"], DOUBLE)
    for s in np.linspace(0.0, 1.0, 40)[1:]:
        single.step(path(s), anew=True)
        double.step(path(s), anew=True)
    assert float(single.plastic_strain) == pytest.approx(float(double.plastic_strain), rel=1e-3)
    np.testing.assert_allclose(single.sigma, double.sigma, atol=40 * 1.2e-7 * KAPPA)  # ln J of each step


@pytest.mark.parametrize(
    ("reference", "dim", "dtype"),
    [
        (es.Never(), 3, wp.float64),
        (es.Always(), 2, wp.float64),
        (es.Every(4), 2, wp.float64),
        (es.Always(), 1, wp.float32),
    ],
)
def test_the_books_of_bodies_close(reference, dim, dtype):
    """A block that is squeezed, then flies apart: what it lost is its plastic work; steps make little."""
    n = {1: 20, 2: 8, 3: 5}[dim]
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / n)
    velocity = 2.0 * (x - 0.5) * np.array([-1.0, 0.5, 0.2])[:dim]
    body = es.Body(x=x, volume=volume, material=LAWS["cut"], velocity=velocity)
    options = {"scheme": es.Verlet(tie=None), "time_step": es.TimeStep(cfl=0.4), "dtype": dtype}
    simulation = es.Simulation(body, reference=reference, arrangement=es.Current(), **options)
    simulation.run(0.03)
    energy, start = simulation.energy(), simulation.stepper.ledger.start
    work = float((simulation.history("plastic_work") * simulation.particles.V0.numpy()).sum())
    eps = float(np.finfo(simulation.space.numpy).eps)
    assert energy["material"] == pytest.approx(-work, rel=1e4 * eps) and work > 0.05 * start
    assert abs(energy["residual"]) < 100 * eps * start and abs(energy["stepping"]) < 0.02 * start
    assert dim == 1 or simulation.history("shear_share").min() < 0.5


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"friction": 95.0}, r"friction must be an angle in \[0, 90\)"),
        ({"friction": 30.0, "dilation": 40.0}, "dilation must be an angle"),
        ({"friction": 0.0}, "both 0"),
        ({"friction": 30.0, "cohesion": -1.0}, "cohesion must be zero or positive"),
        ({"friction": 30.0, "tension": math.inf}, "tension must be zero or positive"),
    ],
)
def test_bad_parameters_are_named(given, message):
    with pytest.raises(ValueError, match=message):
        DruckerPrager(**ELASTIC, **given)


def test_it_does_not_fail_by_another_law():
    with pytest.raises(ValueError, match="own tension cut-off"):
        Failing(material=LAWS["clay"], failure=PrincipalStress(energy=1.0, strength=1e4))
