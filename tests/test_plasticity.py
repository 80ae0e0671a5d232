"""J2 plasticity of one particle: paths with exact or fine-step solutions, invariances, every dimension."""

import math

import numpy as np
import pytest
import warp as wp
from points import HARDENINGS, KAPPA, MU, Point, mises, sheared, stretched
from scipy.linalg import expm
from scipy.optimize import brentq

from warp_eulsph.materials import JohnsonCook, LinearHardening, Tabulated, Voce
from warp_eulsph.materials.log_strain import strain_functions
from warp_eulsph.space import Space, matrix_type


def simple(hardening, alpha):
    """y(α) of a hardening that knows no rate, in numpy."""
    if isinstance(hardening, Voce):
        return hardening.yield_stress + hardening.saturation * (1.0 - math.exp(-hardening.rate * alpha))
    if isinstance(hardening, Tabulated):
        return float(np.interp(alpha, hardening.strains, hardening.stresses))
    return hardening.yield_stress + hardening.modulus * alpha


@pytest.mark.parametrize("name", ["perfect", "linear", "voce", "table"])
def test_uniaxial_and_cyclic_paths_are_exact(name):
    """Strain along one direction, forth, back and forth: 3μ (e − e_p) = ± y(α), whatever the steps."""
    hardening, point = HARDENINGS[name], Point(HARDENINGS[name])
    plastic, alpha, strain = 0.0, 0.0, 0.0
    for target, steps in ((0.3, 7), (-0.2, 40), (0.25, 3)):
        for value in np.linspace(strain, target, steps + 1)[1:]:
            trial = 3.0 * MU * (value - plastic)

            def left(delta, trial=trial, alpha=alpha):
                return abs(trial) - 3.0 * MU * delta - simple(hardening, alpha + delta)

            delta = brentq(left, 0.0, abs(trial) / (3.0 * MU), xtol=1e-16, rtol=1e-15) if left(0.0) > 0.0 else 0.0
            plastic, alpha = plastic + math.copysign(delta, trial), alpha + delta
            point.step(stretched(value))
            axial = 2.0 / 3.0 * 3.0 * MU * (value - plastic)
            np.testing.assert_allclose(point.sigma, np.diag([axial, -0.5 * axial, -0.5 * axial]), atol=1e-9 * 0.4e9)
        strain = target
    assert float(point.plastic_strain) == pytest.approx(alpha, rel=1e-9) and alpha > 1.0


def of_symmetric(function, A):
    """A function of a symmetric matrix by its eigenvectors: scipy's of any matrix take a hundred times as long."""
    values, vectors = np.linalg.eigh(A)
    return (vectors * function(values)) @ vectors.T


def reference(path, y, H):
    """(σ, α) at the end of a path of F, by its own J2 algorithm in numpy."""
    C, alpha = np.eye(3), 0.0
    for F in path:
        e = 0.5 * of_symmetric(np.log, F @ C @ F.T)
        e = e - np.trace(e) / 3.0 * np.eye(3)
        q = 2.0 * MU * math.sqrt(1.5 * float(np.sum(e**2)))
        if q > y + H * alpha:
            delta = (q - y - H * alpha) / (3.0 * MU + H)
            e, alpha, J = e * (1.0 - 3.0 * MU * delta / q), alpha + delta, np.linalg.det(F)
            G = np.linalg.inv(F)
            C = G @ of_symmetric(np.exp, 2.0 * e + 2.0 / 3.0 * math.log(J) * np.eye(3)) @ G.T
    return (KAPPA * math.log(np.linalg.det(F)) * np.eye(3) + 2.0 * MU * e) / np.linalg.det(F), alpha


def turning(s):
    """A path that is not proportional: shear one way, then another, with a change of volume; s from 0 to 1."""
    return (sheared(0.5 * math.sin(3.0 * s)).T @ sheared(0.4 * s) @ stretched(0.2 * s * s)) * (1.0 + 0.01 * s)


def test_shear_against_fine_steps():
    """Stress and plastic strain within 0.1 % of 4000 steps with 800, first order or better."""
    y, H = 0.4e9, 0.1e9
    fine, alpha = reference([turning(s) for s in np.linspace(0.0, 1.0, 4001)[1:]], y, H)
    errors = []
    for steps in (200, 400, 800):
        point = Point(HARDENINGS["linear"])
        for s in np.linspace(0.0, 1.0, steps + 1)[1:]:
            point.step(turning(s))
        errors.append([np.abs(point.sigma - fine).max() / mises(fine), abs(float(point.plastic_strain) / alpha - 1.0)])
    errors = np.array(errors)
    assert (errors[-1] < 1e-3).all()
    assert (np.log2(errors[0] / errors[-1]) / 2.0 > 0.95).all()
    own, own_alpha = reference([turning(s) for s in np.linspace(0.0, 1.0, 801)[1:]], y, H)
    np.testing.assert_allclose(point.sigma, own, atol=1e-10 * 0.4e9)
    assert float(point.plastic_strain) == pytest.approx(own_alpha, rel=1e-12)


@pytest.mark.parametrize("name", HARDENINGS)
def test_superposed_rotation_turns_the_stress_and_no_more(name):
    plain, turned = Point(HARDENINGS[name]), Point(HARDENINGS[name])
    for s in np.linspace(0.0, 1.0, 31)[1:]:
        Q = expm(s * np.array([[0.0, -7.0, 2.0], [7.0, 0.0, -3.0], [-2.0, 3.0, 0.0]]))
        plain.step(turning(s), 1e-4)
        turned.step(Q @ turning(s), 1e-4)
        np.testing.assert_allclose(turned.sigma, Q @ plain.sigma @ Q.T, atol=1e-11 * KAPPA)
    assert float(turned.plastic_strain) == pytest.approx(float(plain.plastic_strain), rel=1e-11)


@pytest.mark.parametrize("name", HARDENINGS)
def test_flow_dissipates_keeps_volume_and_stays_on_the_surface(name):
    """With a rate too; the half step's stress is on the surface as well, and plastic work is what was dissipated."""
    hardening, point, T = HARDENINGS[name], Point(HARDENINGS[name]), 293.0
    for s in np.linspace(0.0, 1.0, 41)[1:]:
        before = float(point.plastic_strain)
        point.step(turning(s), 1e-5)
        alpha, J = float(point.plastic_strain), np.linalg.det(turning(s))
        rate = (alpha - before) / 1e-5
        if name == "johnson_cook":
            hot = (T - 293.0) / (1356.0 - 293.0)
            y = (90e6 + 292e6 * alpha**0.31) * (1.0 + 0.025 * math.log(max(rate, 1.0))) * (1.0 - hot**1.09)
            T = float(point.temperature)
        else:
            y = simple(hardening, alpha)
        assert alpha > before and mises(J * point.sigma) == pytest.approx(y, rel=1e-9)
        np.testing.assert_allclose(point.ahead, point.sigma, atol=1e-9 * y)
        assert np.linalg.det(point.plastic_metric) == pytest.approx(1.0, abs=1e-12)
        assert -np.trace(point.sigma) / 3.0 == pytest.approx(-KAPPA * math.log(J) / J, rel=1e-9)
    assert min(point.lost) > 0.0 and float(point.plastic_work) == pytest.approx(sum(point.lost), rel=1e-12)
    if name == "johnson_cook":
        assert float(point.temperature) == pytest.approx(293.0 + 0.9 * sum(point.lost) / (8930.0 * 383.0), rel=1e-12)


def test_work_of_the_stress_is_stored_or_plastic():
    """∫ τ : d dt = stored + plastic work, the better the finer."""
    left = []
    for steps in (50, 100):
        point, work, before = Point(HARDENINGS["voce"]), 0.0, np.zeros((3, 3))
        F_before = np.eye(3)
        for s in np.linspace(0.0, 1.0, steps + 1)[1:]:
            F = turning(s)
            point.step(F)
            mean, change = 0.5 * (F + F_before), F - F_before
            tau = 0.5 * (np.linalg.det(F) * point.sigma + before)
            work += float(np.sum(tau * (change @ np.linalg.inv(mean))))
            before, F_before = np.linalg.det(F) * point.sigma, F
        left.append(work / (point.energy[-1] + sum(point.lost)) - 1.0)
    assert abs(left[1]) < 3e-3 and abs(left[1]) < 0.5 * abs(left[0])


def test_steps_of_no_length_and_within_the_surface_change_nothing():
    point = Point(HARDENINGS["linear"]).step(sheared(0.1))
    before = point.h.numpy()
    point.step(sheared(0.1))
    assert float(point.plastic_strain) == pytest.approx(float(before[0, 6]), rel=1e-12)
    before = point.h.numpy()
    point.step(sheared(0.099))
    assert np.array_equal(point.h.numpy(), before) and point.lost[-1] == 0.0


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_rebasing_is_the_same_algorithm(dim):
    """F and C_p⁻¹ for good, or F_e alone from step to step: the same stress, energy and plastic strain; det F kept."""
    kept, anew = Point(HARDENINGS["voce"], Space(dim)), Point(HARDENINGS["voce"], Space(dim))
    for s in np.linspace(0.0, 1.0, 60)[1:]:
        F = turning(s)[:dim, :dim] if dim < 3 else turning(s)
        kept.step(F)
        anew.step(F, anew=True)
        assert np.linalg.det(anew.F) == pytest.approx(np.linalg.det(F), rel=1e-12)
        np.testing.assert_allclose(anew.sigma, kept.sigma, atol=1e-11 * KAPPA)
    assert float(anew.plastic_strain) == pytest.approx(float(kept.plastic_strain), rel=1e-10)
    assert anew.energy[-1] == pytest.approx(kept.energy[-1], rel=1e-9)
    if dim == 3:
        np.testing.assert_allclose(anew.plastic_metric, np.eye(3), atol=1e-15)


@pytest.mark.parametrize("dim", [1, 2])
def test_fewer_dimensions_are_those_of_plane_and_uniaxial_strain(dim):
    """With the strains across that are elastic one way and plastic the other."""
    flat, full = Point(HARDENINGS["linear"], Space(dim)), Point(HARDENINGS["linear"])
    for s in np.linspace(0.0, 1.0, 20)[1:]:
        F = np.eye(3)
        F[:dim, :dim] = (sheared(0.4 * s) @ stretched(0.3 * s))[:dim, :dim]
        flat.step(F[:dim, :dim])
        full.step(F)
        np.testing.assert_allclose(flat.sigma, full.sigma[:dim, :dim], atol=1e-12 * KAPPA)
        np.testing.assert_allclose(flat.plastic_metric, full.plastic_metric, atol=1e-13)
    assert abs(full.plastic_metric[2, 2] - 1.0) > 1e-3


def test_float32_follows():
    single, double = Point(HARDENINGS["johnson_cook"], Space(3, wp.float32)), Point(HARDENINGS["johnson_cook"])
    for s in np.linspace(0.0, 1.0, 40)[1:]:
        single.step(turning(s), 1e-5, anew=True)
        double.step(turning(s), 1e-5, anew=True)
    assert float(single.plastic_strain) == pytest.approx(float(double.plastic_strain), rel=1e-4)
    np.testing.assert_allclose(single.sigma, double.sigma, atol=1e-6 * KAPPA)


@pytest.mark.parametrize("real", [wp.float32, wp.float64])
def test_logarithm_and_powers(real):
    """Of strains from 1e-6 to 1, by both series and beyond them: to round-off."""
    mat, eps = matrix_type(3, 3, real), np.finfo(Space(3, real).numpy).eps
    deviator, logarithm, size, power = strain_functions(real)

    @wp.kernel(module="unique", enable_backward=False)
    def all_of(
        b: wp.array(dtype=mat),
        e: wp.array(dtype=mat),
        norm: wp.array(dtype=real),
        root: wp.array(dtype=mat),
        inverse: wp.array(dtype=mat),
    ):
        i = wp.tid()
        X = deviator(b[i], wp.identity(n=3, dtype=real))
        e[i] = logarithm(X)
        norm[i] = size(X)
        root[i] = power(X, real(0.5))
        inverse[i] = power(X, real(-1.7))

    S = np.random.default_rng(4).normal(size=(80, 3, 3))
    S = (S + S.swapaxes(1, 2)) / np.linalg.norm(S, axis=(1, 2))[:, None, None] * np.logspace(-6, 0, 80)[:, None, None]
    given = np.array([expm(s) for s in S]).astype(Space(3, real).numpy)
    b = wp.array(given, dtype=mat)
    e, root, inverse = (wp.zeros_like(b) for _ in range(3))
    norm = wp.zeros(len(S), dtype=real)
    wp.launch(all_of, len(S), [b, e, norm, root, inverse])
    deviator_of = S - np.trace(S, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
    np.testing.assert_allclose(e.numpy(), deviator_of, atol=40 * eps)
    np.testing.assert_allclose(norm.numpy(), np.linalg.norm(deviator_of, axis=(1, 2)), atol=40 * eps)
    given = given.astype(float)
    of_X = 3.0 * given / np.trace(given, axis1=1, axis2=2)[:, None, None]
    for found, p in ((root, 0.5), (inverse, -1.7)):
        exact = np.array([of_symmetric(lambda value, p=p: value**p, m) for m in of_X])
        scale = np.linalg.norm(exact, axis=(1, 2))[:, None, None]
        np.testing.assert_allclose(found.numpy() / scale, exact / scale, atol=40 * eps)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: LinearHardening(yield_stress=0.0), "yield_stress must be positive"),
        (lambda: LinearHardening(yield_stress=1e6, modulus=-1.0), "modulus must be zero or positive"),
        (lambda: Voce(yield_stress=1e6, saturation=1e6, rate=0.0), "rate must be positive"),
        (lambda: Tabulated(strains=(0.0, 0.1), stresses=(1e6, 0.5e6)), "stresses must be 2 positive numbers"),
        (
            lambda: Tabulated(strains=(0.1, 0.2), stresses=(1e6, 2e6)),
            "strains must be 2 to 64 numbers",
        ),
        (lambda: JohnsonCook(A=1e6, B=1e6, n=0.0), "n must be positive"),
        (lambda: JohnsonCook(A=1e6, B=1e6, n=0.5, melting=200.0), "melting must be finite and above temperature"),
        (lambda: JohnsonCook(A=1e6, B=1e6, n=0.5, taylor_quinney=1.5), r"taylor_quinney must be in \[0, 1\]"),
    ],
)
def test_bad_parameters_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()
