"""Laws of liquids and gases: equations of state with heat, viscosity, a least pressure."""

import dataclasses
from decimal import Decimal

import numpy as np
import pytest
import warp as wp
from fluid_laws import COPPER, GAS, OIL, THICK, WATER, long_law

from warp_eulsph.materials import Newtonian, PowerLaw
from warp_eulsph.space import Space


def test_gas_and_stiffened_gas_are_on_their_isentropes():
    J = np.array([0.5, 0.9, 1.0, 1.7])
    for gas in (GAS, WATER):
        _, P, psi, moduli, _ = long_law(gas)(J[:, None, None])
        p = (gas.pressure + gas.stiffness) * J**-gas.gamma - gas.stiffness
        np.testing.assert_allclose(-P.ravel(), p, rtol=1e-12)
        np.testing.assert_allclose(
            moduli[:, 0], gas.gamma * (p + gas.stiffness) * J, rtol=1e-12
        )  # ρ0 c² = γ (p + p∞) J
        e = J * (p + gas.gamma * gas.stiffness) / (gas.gamma - 1.0) - gas.gamma * gas.stiffness / (gas.gamma - 1.0)
        np.testing.assert_allclose(psi, e, rtol=1e-9, atol=1e-9 * gas.stiffness)


def test_mie_gruneisen_is_on_its_hugoniot_and_its_isentropes():
    """p_H with the energy ½ p_H η of a shock; p = −dE/dJ; the largest compression ends it."""
    eta = np.array([0.05, 0.2, 0.35])
    law, J = long_law(COPPER), 1.0 - eta
    p_H = 8930.0 * 3940.0**2 * eta / (1.0 - 1.489 * eta) ** 2
    for k in range(3):
        F = J[k : k + 1, None, None]
        cold = law(F)[2][0]
        _, P, psi, _, _ = law(F, q=0.5 * p_H[k] * eta[k] - cold)
        assert psi[0] == pytest.approx(0.5 * p_H[k] * eta[k], rel=1e-9)
        assert -P[0, 0, 0] == pytest.approx(p_H[k], rel=1e-9)
    J = np.linspace(0.4, 1.6, 400)
    psi, p = law(J[:, None, None], q=1e9)[2], -law(J[:, None, None], q=1e9)[1].ravel()
    slopes, middle = -np.diff(psi) / np.diff(J), 0.5 * (p[1:] + p[:-1])
    np.testing.assert_allclose(slopes[60:], middle[60:], rtol=1e-2, atol=1e-3 * np.abs(p).max())
    assert np.isnan(law(np.array([[[1.0 - 1.0 / 1.489]]]))[1]).all()


@pytest.mark.parametrize("gamma", [1.4, 7.0, 17.0])
@pytest.mark.parametrize(("real", "tolerance"), [(wp.float32, 3e-6), (wp.float64, 1e-12)])
def test_the_energy_of_a_liquid_is_right_near_rest(gamma, real, tolerance):
    """Where J is within a few percent of 1 its terms cancel: a sixth of it was round-off in float32 at 5e-4."""
    J = np.array([0.981, 0.9995, 0.9999, 1.0001, 1.0005, 1.019]).astype(Space(1, real).numpy).astype(float)
    law, n = long_law(dataclasses.replace(OIL, gamma=gamma, viscosity=THICK), real=real), Decimal(gamma) - 1
    exact = [float((Decimal(each) ** -n - 1) / n + Decimal(each) - 1) * 900.0 * 400.0 / gamma for each in J]
    np.testing.assert_allclose(law(J[:, None, None])[2], exact, rtol=tolerance)
    either = law(np.array([0.98 - 1e-6, 0.98 + 1e-6])[:, None, None])[2]
    assert either[0] / either[1] == pytest.approx(1.0, abs=5e-4)  # no jump where the series ends


@pytest.mark.parametrize("gas", [GAS, WATER, COPPER])
def test_heat_raises_the_internal_energy_by_itself(gas):
    """At any J, by q, and the pressure by Γ q per volume: (γ − 1)/J of a gas, Γ0 of Mie and Grüneisen."""
    J, q, law = np.array([0.6, 1.0, 1.3]), 3e4, long_law(gas)
    _, P, psi, _, _ = law(J[:, None, None])
    _, hot, warm, _, _ = law(J[:, None, None], q=q)
    np.testing.assert_allclose(warm - psi, q, rtol=1e-6)  # stiffness leaves less of the digits
    rise = gas.gruneisen * q if gas is COPPER else (gas.gamma - 1.0) * q / J
    np.testing.assert_allclose(P.ravel() - hot.ravel(), rise, rtol=1e-5)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_viscous_stress_and_what_it_takes(dim):
    """σ = −p 1 + 2 η dev D with the three-dimensional deviator; its work is lost in a liquid, heat in a gas."""
    rate = np.random.default_rng(dim).normal(size=(dim, dim))
    F = 0.9 ** (1.0 / dim) * np.eye(dim)
    D = np.zeros((3, 3))
    D[:dim, :dim] = 0.5 * (rate + rate.T)
    dev, J = D - np.trace(D) / 3.0 * np.eye(3), 0.9
    work = J * 2.0 * 3.0 * (dev * dev).sum() * 1e-2
    for material in (OIL, GAS):
        still, sticky = (dataclasses.replace(material, viscosity=v) for v in (None, THICK))
        h, P, psi, _, lost = long_law(sticky, dim)(F[None], rate, dt=1e-2)
        space = Space(dim)
        if material is GAS:
            assert lost[0] == 0.0 and h[0, -1] == pytest.approx(work, rel=1e-12)
            before = long_law(still, dim)(F[None])[2]
            assert psi[0] - before[0] == pytest.approx(work, abs=1e-14 * before[0])
        else:
            assert lost[0] == pytest.approx(work, rel=1e-12) and h[0, 0] == pytest.approx(work, rel=1e-12)
            sigma = P[0] @ F.T / J
            p = 900.0 * 20.0**2 / 7.0 * (J**-7.0 - 1.0)
            np.testing.assert_allclose(sigma, -p * np.eye(dim) + 6.0 * dev[:dim, :dim], rtol=1e-11, atol=1e-9)
            assert still.law(space).history == ()


def test_power_law_between_its_bounds():
    """η = K γ̇^(n−1); shear γ̇ alone gives σ_xy = η γ̇."""
    for law, rates, expected in (
        (PowerLaw(consistency=2.0, exponent=0.5, least=0.1, largest=5.0), [0.0, 0.01, 4.0, 1e4], [5.0, 5.0, 1.0, 0.1]),
        (PowerLaw(consistency=2.0, exponent=2.0, largest=50.0), [0.0, 0.5, 100.0], [0.0, 1.0, 50.0]),
    ):
        call = long_law(dataclasses.replace(OIL, viscosity=law), 2)
        for rate, eta in zip(rates, expected, strict=True):
            P = call(np.eye(2)[None], [[0.0, rate], [0.0, 0.0]])[1]
            assert P[0, 0, 1] == pytest.approx(eta * rate, rel=1e-12, abs=1e-15)
    assert law.steepest == 2.0


@pytest.mark.parametrize("material", [OIL, GAS, WATER, COPPER], ids=["tait", "gas", "stiffened", "mie"])
def test_cavitation_holds_pressure_and_closes_the_books(material):
    """Beyond the opening p stays, Ψ is linear in J and the sound speed that of the opening."""
    least = {GAS: 2e4, COPPER: -4e9}.get(material, -3e4)
    opens = dataclasses.replace(material, cavitation=least, viscosity=THICK)
    plain = dataclasses.replace(material, viscosity=THICK)
    J = np.linspace(0.8, 6.0, 2000)[:, None, None]
    _, P, psi, moduli, _ = long_law(opens)(J)
    _, free, psi_free, moduli_free, _ = long_law(plain)(J)
    p, closed = -P.ravel(), -free.ravel() > least
    assert 1 < closed.sum() < 1999 and np.array_equal(psi[closed], psi_free[closed])
    np.testing.assert_allclose(p, np.where(closed, -free.ravel(), least), rtol=1e-9)
    slope = np.diff(psi) / np.diff(J.ravel())
    np.testing.assert_allclose(-slope[~closed[:-1]], least, rtol=1e-6)
    np.testing.assert_allclose(moduli[~closed, 0], moduli[~closed, 0][0], rtol=1e-12)
    assert moduli_free[closed, 0][-1] == pytest.approx(moduli[-1, 0], rel=0.05)  # the last J before it opens


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Newtonian(viscosity=0.0), "viscosity must be positive and finite, got 0.0; give it in Pa s"),
        (lambda: PowerLaw(consistency=1.0, exponent=0.5, least=3.0, largest=2.0), r"least must be in \[0, largest"),
        (lambda: dataclasses.replace(OIL, viscosity=0.1), r"viscosity must be Newtonian\(viscosity=1e-3\)"),
        (lambda: dataclasses.replace(OIL, cavitation=-1e6), r"cavitation must be in \(−B = -51428.6, 0\] Pa"),
        (lambda: dataclasses.replace(GAS, pressure=0.0), "pressure must be finite and above -0 Pa, got 0.0"),
        (lambda: dataclasses.replace(GAS, stiffness=1.0), "stiffness of an ideal gas must be 0, got 1.0"),
        (lambda: dataclasses.replace(WATER, stiffness=-1.0), "stiffness must be zero or positive"),
        (lambda: dataclasses.replace(COPPER, gruneisen=3.0), r"gruneisen must be in \(0, 2 slope = 2.978\], got 3.0"),
        (lambda: dataclasses.replace(COPPER, cavitation=1.0), r"cavitation must be in \(−ρ0 c0²/Γ0 = -6.9"),
        (lambda: dataclasses.replace(GAS, cavitation=2e5), r"cavitation must be in \(-0, pressure = 100000\] Pa"),
    ],
)
def test_bad_parameters_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()
