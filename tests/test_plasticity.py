"""J2 plasticity: paths with exact or fine-step solutions, invariances, every dimension and reference, the books."""

import dataclasses
import functools
import math

import numpy as np
import pytest
import warp as wp
from scipy.linalg import expm, logm
from scipy.optimize import brentq

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.materials import J2, Hardening, JohnsonCook, LinearHardening, Tabulated, Voce
from warp_eulsph.materials.base import history_row
from warp_eulsph.materials.log_strain import deviatoric_logarithm, exponential
from warp_eulsph.space import Space, matrix_type

COPPER = {"density": 8930.0, "young": 117e9, "poisson": 0.35}
MU, KAPPA = COPPER["young"] / 2.7, COPPER["young"] / 0.9
HARDENINGS = {
    "perfect": LinearHardening(yield_stress=0.4e9),
    "linear": LinearHardening(yield_stress=0.4e9, modulus=0.1e9),
    "voce": Voce(yield_stress=0.1e9, saturation=0.3e9, rate=8.0),
    "table": Tabulated(strains=(0.0, 0.05, 0.2, 1.0), stresses=(0.1e9, 0.25e9, 0.35e9, 0.4e9)),
    "johnson_cook": JohnsonCook(A=90e6, B=292e6, n=0.31, C=0.025, m=1.09),
}
DOUBLE = Space(3)


@functools.cache
def make_point(space, law):
    """Kernel: one step of one particle: update, then stress, energy, and the half step's stress before it."""
    real, mat, row, Constants = space.real, space.mat, history_row(space, law), law.Constants
    stress, energy, update, rebase = law.stress, law.energy, law.update, law.rebase

    @wp.kernel(module="unique", enable_backward=False)
    def point(
        F: wp.array(dtype=mat),
        dt: real,
        anew: int,
        c: Constants,
        h: wp.array(dtype=row),
        ahead: wp.array(dtype=mat),
        P: wp.array(dtype=mat),
        out: wp.array(dtype=real),
    ):
        ahead[0] = stress(F[0], mat(), h[0], dt, c)
        F_new, h_new, lost = update(F[0], mat(), h[0], dt, c)
        if anew == 1:
            F_new, h_new = rebase(F_new, h_new, c)
        F[0] = F_new
        h[0] = h_new
        P[0] = stress(F_new, mat(), h_new, real(0.0), c)
        out[0] = energy(F_new, h_new, c)
        out[1] = lost

    return point


class Point:
    """One particle of a material on a path; ``sigma`` (3, 3) or (dim, dim), ``ahead`` that of the half-step form."""

    def __init__(self, hardening, space=DOUBLE):
        self.space, self.material = space, J2(**COPPER, hardening=hardening)
        self.law = self.material.law(space)
        row = history_row(space, self.law)
        self.h = wp.array([row(*self.law.start)], dtype=row)
        self.constants, self.lost, self.energy = self.material.filled_constants(self.law), [], [0.0]
        self.total, self.F = np.eye(space.dim), np.eye(space.dim)

    def step(self, F, dt=1.0, anew=False):
        """To the total F; from a rebased one by the motion since."""
        dim, mat = self.space.dim, self.space.mat
        start = F @ np.linalg.inv(self.total) @ self.F if anew else F
        new = wp.array(start[None].astype(self.space.numpy), dtype=mat)
        ahead, P = (wp.zeros(1, dtype=mat) for _ in range(2))
        out = wp.zeros(2, dtype=self.space.real)
        arguments = [new, dt, int(anew), self.constants, self.h, ahead, P, out]
        wp.launch(make_point(self.space, self.law), 1, arguments)
        self.total, self.F = F, new.numpy()[0].astype(float).reshape(dim, dim)
        J = np.linalg.det(self.F)
        self.sigma = P.numpy()[0].reshape(dim, dim) @ self.F.T / J
        self.ahead = ahead.numpy()[0].reshape(dim, dim) @ start.T / np.linalg.det(start)
        self.lost.append(float(out.numpy()[1]))
        self.energy.append(float(out.numpy()[0]))
        return self

    def __getattr__(self, name):
        return self.law.by_name(self.h.numpy())[name][0]


def mises(tau):
    deviator = tau - np.trace(tau) / 3.0 * np.eye(3)
    return math.sqrt(1.5 * float(np.sum(deviator**2)))


def stretched(strain):
    """F of an isochoric uniaxial stretch with this logarithmic strain."""
    return np.diag(np.exp([strain, -0.5 * strain, -0.5 * strain]))


def sheared(angle):
    return np.eye(3) + angle * np.outer([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])


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


def reference(path, y, H):
    """(σ, α) at the end of a path of F, by its own J2 algorithm in numpy, logarithms by scipy's."""
    C, alpha = np.eye(3), 0.0
    for F in path:
        e = 0.5 * logm(F @ C @ F.T)
        e = e - np.trace(e) / 3.0 * np.eye(3)
        q = 2.0 * MU * math.sqrt(1.5 * float(np.sum(e**2)))
        if q > y + H * alpha:
            delta = (q - y - H * alpha) / (3.0 * MU + H)
            e, alpha, J = e * (1.0 - 3.0 * MU * delta / q), alpha + delta, np.linalg.det(F)
            G = np.linalg.inv(F)
            C = G @ expm(2.0 * e + 2.0 / 3.0 * math.log(J) * np.eye(3)) @ G.T
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
def test_logarithm_and_exponential(real):
    """Of strains from 1e-6 to 1, by the series and beyond it: to round-off."""
    mat, eps = matrix_type(3, 3, real), np.finfo(Space(3, real).numpy).eps
    logarithm, exp = deviatoric_logarithm(real), exponential(real)

    @wp.kernel(module="unique", enable_backward=False)
    def both(b: wp.array(dtype=mat), e: wp.array(dtype=mat), back: wp.array(dtype=mat)):
        i = wp.tid()
        e[i] = logarithm(b[i])
        back[i] = exp(e[i])

    S = np.random.default_rng(4).normal(size=(80, 3, 3))
    S = (S + S.swapaxes(1, 2)) / np.linalg.norm(S, axis=(1, 2))[:, None, None] * np.logspace(-6, 0, 80)[:, None, None]
    b = wp.array(np.array([expm(s) for s in S]).astype(Space(3, real).numpy), dtype=mat)
    e, back = wp.zeros_like(b), wp.zeros_like(b)
    wp.launch(both, len(S), [b, e, back])
    deviator = S - np.trace(S, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
    np.testing.assert_allclose(e.numpy(), deviator, atol=40 * eps)
    np.testing.assert_allclose(back.numpy(), [expm(d) for d in deviator], atol=80 * eps)


def block(dim, reference, dtype=wp.float64, hardening=HARDENINGS["linear"], **options):
    """A block of copper, 1 cm, squeezed one way and pulled the other by its own motion."""
    n = {1: 20, 2: 8, 3: 5}[dim]
    x, volume = box((0.0,) * dim, (0.01,) * dim, 0.01 / n)
    velocity = -2e4 * (x - 0.005) * np.array([1.0, -0.5, 0.3])[:dim]
    body = es.Body(x=x, volume=volume, material=J2(**COPPER, hardening=hardening), velocity=velocity)
    return es.Simulation(body, reference=reference, arrangement=es.Current(), dtype=dtype, **options)


@pytest.mark.parametrize(
    ("reference", "dim", "dtype"),
    [
        (es.Never(), 3, wp.float64),
        (es.Always(), 3, wp.float32),
        (es.Every(4), 2, wp.float64),
        (es.Always(), 2, wp.float32),
        (es.Always(), 1, wp.float64),
    ],
)
def test_the_books_close(reference, dim, dtype):
    """Every joule is kinetic, stored, plastic or M9's; plastic work is the material's account, stepping stays small."""
    simulation = block(dim, reference, dtype, HARDENINGS["johnson_cook"])
    simulation.run(8e-6)
    energy, start = simulation.energy(), simulation.stepper.ledger.start
    work = float((simulation.history("plastic_work") * simulation.particles.V0.numpy()).sum())
    eps = float(np.finfo(simulation.space.numpy).eps)
    assert energy["material"] == pytest.approx(-work, rel=1e3 * eps)
    assert work > 0.3 * start and abs(energy["residual"]) < 100 * eps * start
    assert abs(energy["stepping"]) < 0.03 * start
    assert simulation.history("temperature").min() > 293.0


@pytest.mark.parametrize("dim", [2, 3])
def test_every_reference_gives_the_same_answer(dim):
    """The arrangement read anew each step, each tenth, and never, without what only the first has: tie, tilt, sharpening."""
    scheme = es.Verlet(tie=None, tilt=None, sharpening=None)
    found = [block(dim, policy, scheme=scheme) for policy in (es.Never(), es.Always(), es.Every(10))]
    for simulation in found:
        simulation.run(4e-6)
    strains = [simulation.history("plastic_strain") for simulation in found]
    np.testing.assert_allclose(strains[2], strains[1], atol=1e-3)
    np.testing.assert_allclose(strains[0].mean(), strains[1].mean(), rtol=0.02)
    assert strains[0].mean() > 0.01


def test_a_field_of_snapshots_and_probes(tmp_path):
    from warp_eulsph.output import PointProbe, Recording, Run, record

    simulation = block(2, es.Always())
    probe = PointProbe(name="middle", X=(0.005, 0.005))
    record(simulation, tmp_path, 2e-6, Recording(probes=[probe]))
    run = Run(tmp_path)
    assert np.allclose(run[-1]["plastic_strain"], simulation.history("plastic_strain"), rtol=1e-6)
    assert run[-1]["plastic_metric"].shape == (64, 3, 3) and run[-1].units["plastic_work"] == "J/m^3"
    table = run.probes["middle"]
    assert table.units["plastic_strain"] == "-" and table["plastic_strain"][-1] > 0.01


def test_sigma_33_of_plane_strain_knows_the_history():
    simulation = block(2, es.Always())
    simulation.run(6e-6)
    sigma, J = simulation.cauchy_stress, simulation.J
    deviator = sigma - np.trace(sigma.T)[:, None, None] / 3.0 * np.eye(3)
    q = J * np.sqrt(1.5 * np.sum(deviator**2, axis=(1, 2)))
    y = 0.4e9 + 0.1e9 * simulation.history("plastic_strain")
    assert (q <= y * (1.0 + 1e-9)).all() and (q > 0.99 * y).any()
    np.testing.assert_allclose(np.trace(sigma.T) / 3.0, KAPPA * np.log(J) / J, atol=1e-9 * KAPPA)


@wp.func
def slide(X: wp.vec2d, t: wp.float64) -> wp.vec2d:
    return wp.vec2d(wp.float64(10.0) * t * X[1], wp.float64(0.0))


def plates(n, surface=None, **options):
    """A jittered block, n across, that yields at 1 % of its modulus, sheared by 10 per second; the free particles."""
    x, volume = box((0.0, 0.0), (1.0, 1.0), 1.0 / n, jitter=0.1)
    layers = np.arange(len(x)) % n  # the last axis of a lattice runs fastest
    law = J2(density=1e3, young=1e6, poisson=0.3, hardening=LinearHardening(yield_stress=1e4))
    velocity = 10.0 * x[:, 1:] * np.array([1.0, 0.0])
    body = es.Body(x=x, volume=volume, material=law, velocity=velocity, surface=surface)
    held = [es.Motion(slide, layers >= n - 3), es.Motion(slide, layers < 3)]
    free = (layers >= 3) & (layers < n - 3)
    return es.Simulation(body, boundaries=held, periodic=(1.0, 0.0), **options), free


def test_shear_without_end_keeps_the_yield_stress():
    """To a shear of 20 Eulerian, kept even and with true surface vectors; the fixed reference to 3, by short steps."""
    layers = np.arange(144) % 12
    surface = ((1.0 * (layers == 11) - 1.0 * (layers == 0)) / 12)[:, None] * np.array([0.0, 1.0])
    even = {"arrangement": es.Current(), "scheme": es.Verlet(shifting=es.Shifting()), "surface": surface}
    for shear, options in ((20.0, even), (3.0, {})):
        simulation, free = plates(12, **options)
        simulation.run(shear / 10.0)
        tau = simulation.cauchy_stress[free, 0, 1] / (1e4 / math.sqrt(3.0))
        assert np.abs(tau - 1.0).max() < 0.03
        assert float(simulation.history("plastic_strain")[free].mean()) > 0.95 * shear / math.sqrt(3.0)
        energy = simulation.energy()
        assert abs(energy["residual"]) < 1e-12 * energy["total"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Falling(Hardening):
    """Yield stress that nobody can follow: none beyond a plastic strain of 1 %."""

    def constants(self):
        return {"y0": 0.1e9}

    @staticmethod
    @functools.cache
    def make_yield_stress(real, Constants):
        @wp.func
        def falling(alpha: real, rate: real, T: real, c: Constants) -> real:
            return c.y0 / wp.sqrt(real(0.01) - alpha)

        return falling


def test_a_mapping_that_does_not_converge_is_named():
    simulation = block(2, es.Always(), hardening=Falling())
    with pytest.raises(es.UnstableError, match=r"particle \d+ of body 'body' at x = .*no state that its material"):
        simulation.run(1e-5)


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
