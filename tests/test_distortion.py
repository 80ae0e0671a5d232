"""Extreme distortion: the exact motions are what they claim to be, and the published claims that are cheap."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.validation import distortion_map, distortion_problems
from warp_eulsph.validation.cases import drop, kinematic_vortex, shear, vortex

POINTS = box((0.55, 0.35), (0.95, 0.75), 0.1)[0]  # radii from 0.72 m to 1.13 m


def derivative(f, step):
    """Fourth-order central difference of f at 0."""
    return (8.0 * (f(step) - f(-step)) - (f(2.0 * step) - f(-2.0 * step))) / (12.0 * step)


def stress(X, t, amplitude):
    """P of the vortex's exact deformation gradient."""
    F = vortex.exact(X, t, amplitude)[2]
    F_inverse_T, J = np.linalg.inv(F).transpose(0, 2, 1), np.linalg.det(F)
    lam = vortex.RING.constants()["lam"]
    return vortex.MU * (F - F_inverse_T) + (lam * np.log(J))[:, None, None] * F_inverse_T


def applied(force, t):
    """Body force per mass [m/s²] on particles that lie at POINTS and have moved away since."""
    body = es.Body(x=POINTS, volume=0.01, material=vortex.RING)
    simulation = es.Simulation(body, boundaries=[es.BodyForce(force, material=True)])
    simulation.stepper.U.x.assign(POINTS + 0.3)
    simulation.clock.fields.t.fill_(t)
    forces = wp.zeros_like(simulation.stepper.forces.external)
    simulation.conditions[0].load(simulation.stepper.U, simulation.clock.fields, 0.0, forces)
    return forces.numpy() / (0.01 * vortex.RING.density)


@pytest.mark.parametrize("amplitude", [0.05, 1.0])
@pytest.mark.parametrize("t", [0.1, 0.5, 0.8])
class TestVortexSolution:
    def test_velocity_and_deformation_are_derivatives_of_the_motion(self, t, amplitude):
        _, v, F = vortex.exact(POINTS, t, amplitude)
        rate = derivative(lambda s: vortex.exact(POINTS, t + s, amplitude)[0], 1e-4)
        np.testing.assert_allclose(v, rate, rtol=0, atol=1e-8)
        for j, axis in enumerate(np.eye(2)):
            column = derivative(lambda s, axis=axis: vortex.exact(POINTS + s * axis, t, amplitude)[0], 1e-4)
            np.testing.assert_allclose(F[:, :, j], column, rtol=0, atol=1e-6)
        np.testing.assert_allclose(np.linalg.det(F), 1.0, rtol=0, atol=1e-12)

    def test_body_force_balances_the_exact_stress(self, t, amplitude):
        """On 10^4 rings the mean over a particle's cell is the force at its point, to 1e-8."""
        acceleration = derivative(lambda s: vortex.exact(POINTS, t + s, amplitude)[1], 1e-3)
        divergence = 0.0
        for j, axis in enumerate(np.eye(2)):
            divergence += derivative(lambda s, axis=axis: stress(POINTS + s * axis, t, amplitude), 1e-4)[:, :, j]
        exact = acceleration - divergence / vortex.RING.density
        force = applied(vortex.make_force(amplitude, 10**4), t)
        np.testing.assert_allclose(force, exact, rtol=0, atol=1e-6 * np.abs(exact).max())


@pytest.mark.parametrize("rings", [7, 16])
def test_ring_of_particles_is_whole_and_feels_no_torque(rings):
    """Volumes sum to the ring's; the torque about the centre is that of the accelerations, 1e-3 of the force's."""
    x, volume = vortex.annulus((0.0, 0.0), vortex.INNER, vortex.OUTER, rings)
    assert volume.sum() == pytest.approx(np.pi * (vortex.OUTER**2 - vortex.INNER**2), rel=1e-12)
    simulation = vortex.build(rings, es.Never(), 0.05)
    simulation.stepper.U.x.assign(vortex.exact(x, 0.5, 0.05)[0])
    simulation.clock.fields.t.fill_(0.5)
    forces = wp.zeros_like(simulation.stepper.forces.external)
    simulation.conditions[0].load(simulation.stepper.U, simulation.clock.fields, 0.0, forces)
    places, pull = simulation.x, forces.numpy()
    torque = places[:, 0] * pull[:, 1] - places[:, 1] * pull[:, 0]
    h = vortex.profile(np.linalg.norm(x, axis=1))[0]
    spin = -(vortex.RING.density * volume * np.square(x).sum(axis=1)) @ h * 0.05 * np.pi**3
    assert torque.sum() == pytest.approx(spin, rel=1e-8)


def test_drop_ends_at_the_exact_semi_axes():
    for t, (A, B) in drop.SEMI_AXES.items():
        assert drop.exact(t)[0] == pytest.approx(A, abs=5e-7)
        assert 1.0 / drop.exact(t)[0] == pytest.approx(B, abs=5e-7)


def test_flow_of_the_kinematic_vortex_is_isochoric_and_its_gradient_right():
    x = np.random.default_rng(0).uniform(size=(20, 2))
    L = kinematic_vortex.flow(x, 0.3, 1.0)[1]
    for j, axis in enumerate(np.eye(2)):
        column = derivative(lambda s, axis=axis: kinematic_vortex.flow(x + s * axis, 0.3, 1.0)[0], 1e-3)
        np.testing.assert_allclose(L[:, :, j], column, rtol=0, atol=1e-8)
    back, F = kinematic_vortex.exact(x, 1.0, 1.0)
    np.testing.assert_allclose(back, x, rtol=0, atol=1e-7)
    np.testing.assert_allclose(F, np.tile(np.eye(2), (20, 1, 1)), rtol=0, atol=1e-6)


@pytest.mark.parametrize("case", [drop, kinematic_vortex, shear], ids=lambda case: case.CASE.name)
def test_quick_cases_hold(case):
    outside = [figure for figure in case.CASE.run(True) if not figure.accepted]
    assert not outside


@pytest.mark.slow
@pytest.mark.parametrize("case", [drop, kinematic_vortex], ids=lambda case: case.CASE.name)
def test_full_cases_hold(case):
    outside = [figure for figure in case.CASE.run(False) if not figure.accepted]
    assert not outside


@pytest.mark.slow
def test_vortex_converges_at_a_shear_of_one():
    assert not [figure for figure in vortex.CASE.run(True) if not figure.accepted]


@pytest.mark.parametrize("reference", [es.Never(), es.Every(10), es.Always()], ids=repr)
def test_uniform_shear_exerts_no_force_with_exact_surface_vectors(reference):
    """M10: whatever the arrangement, the particles keep the exact motion."""
    scheme = es.Verlet(correction=es.SurfaceVectors())
    simulation, upper = shear.build(12, reference, arrangement=es.Current(), scheme=scheme)
    simulation.run(2.0 / shear.RATE)
    now = shear.errors(simulation, upper)
    assert max(now["F"], now["stress"]) < 1e-10
    # The plate's own surface vectors see its pull; the mean over the last step lags by half a step, and M9 acts.
    assert abs(now["reaction"]) < 0.02


def test_whole_correction_keeps_the_sheared_block():
    """M11 without the bound on energy: 0.1 % of F and stress at a shear of 5, as in docs/distortion.md."""
    scheme = es.Verlet(correction=es.PairAreas(kappa=np.inf))
    simulation, upper = shear.build(12, es.Always(), arrangement=es.Current(), scheme=scheme)
    simulation.run(5.0 / shear.RATE)
    now = shear.errors(simulation, upper)
    assert max(now["F"], now["stress"]) < 1e-3


def test_total_lagrangian_block_is_accurate_at_a_shear_of_two():
    simulation, upper = shear.build(12, es.Never())
    simulation.run(2.0 / shear.RATE)
    now = shear.errors(simulation, upper)
    assert max(now["F"], now["stress"]) < distortion_map.ACCURATE


# the map


def test_map_tells_accurate_from_failed_and_writes_its_files(tmp_path):
    """A run with steps far beyond its limit fails, at its mark and at all later ones, and says why."""

    def start(n, reference, **options):
        if isinstance(reference, es.Always):
            options["time_step"] = es.TimeStep(fixed=2e-2)
        return distortion_problems.start_shear(n, reference, **options)

    problem = replace(
        distortion_problems.PROBLEMS[0], levels=(12,), marks={0.2: 0.02, 0.5: 0.05, 3.0: 0.3}, start=start
    )
    verdicts = list(distortion_map.judge(problem, "default", 12))
    assert verdicts[-1].verdict == "failed" and verdicts[-1].reason and verdicts[-1].error is None
    problem = replace(problem, marks={0.2: 0.02, 0.5: 0.05})
    names = ("current, every 10", "current, criterion")
    verdicts = distortion_map.run([problem], names, False, tmp_path)
    assert [(v.reference, v.distortion, v.verdict) for v in verdicts] == [
        (name, mark, "accurate") for name in names for mark in problem.marks
    ]
    lines = (tmp_path / "distortion.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 5 and lines[0].startswith("problem,reference,level,distortion,verdict")
    assert "| current, every 10 | accurate" in (tmp_path / "distortion.md").read_text(encoding="utf-8")
    assert (tmp_path / "distortion_map.png").read_bytes().startswith(b"\x89PNG")
