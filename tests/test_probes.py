"""Probes measure what they say."""

import bodies
import numpy as np
import pytest
from kept_runs import plate

import warp_eulsph as es
from warp_eulsph.output import BodyProbe, PointProbe, ReactionProbe, SectionProbe


def block(dim, **options):
    """A unit block of rubber, jittered."""
    return bodies.block(dim, 6, jitter=0.1, **options)


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("place", [0.5, 0.43, 1.0], ids=["inside", "between", "corner"])
def test_point_probe_is_exact_for_linear_fields(dim, place):
    A = np.random.default_rng(dim).normal(size=(dim, dim))
    body = block(dim)
    simulation = es.Simulation(es.Body(x=body.x, volume=body.volume, material=body.material, velocity=body.x @ A.T))
    measured = PointProbe(name="p", X=[place] * dim).bind(simulation)()
    assert measured["x"] == pytest.approx([place] * dim, abs=1e-13)
    assert measured["v"] == pytest.approx(A.sum(axis=1) * place, abs=1e-12)
    assert measured["F"] == pytest.approx(np.eye(dim), abs=1e-13)
    assert measured["cauchy_stress"] == pytest.approx(np.zeros((3, 3)), abs=1e-6)


def test_point_probe_has_the_stress_of_its_body():
    simulation = es.Simulation([block(2), block(2, name="second")])
    F = np.tile(np.diag([1.2, 0.9]), (72, 1, 1))
    F[:36] = np.eye(2)
    simulation.stepper.U.F.assign(F)
    from warp_eulsph.output.stress import cauchy_stress

    measured = PointProbe(name="p", X=(0.5, 0.5), body="second").bind(simulation)()
    assert measured["cauchy_stress"] == pytest.approx(cauchy_stress(simulation)[40], rel=1e-12)


def test_body_probe_sums_its_body():
    velocity = np.random.default_rng(1).normal(size=(36, 2))
    simulation = es.Simulation([block(2), block(2, velocity=velocity, name="second")])
    measured = BodyProbe(name="b", body="second").bind(simulation)()
    x, m = block(2).x, 1100.0 / 36
    assert measured["centre"] == pytest.approx(x.mean(axis=0), rel=1e-13)
    assert measured["momentum"] == pytest.approx(m * velocity.sum(axis=0), rel=1e-12)
    turning = m * (x[:, 0] * velocity[:, 1] - x[:, 1] * velocity[:, 0]).sum()
    assert measured["angular_momentum"] == pytest.approx([0.0, 0.0, turning], rel=1e-12)
    assert measured["kinetic"] == pytest.approx(0.5 * m * (velocity**2).sum(), rel=1e-12)


@pytest.mark.parametrize("scheme", [es.Verlet(), es.LaxWendroff(correction=es.PairAreas())], ids=["Verlet", "M12"])
def test_section_force_is_the_rate_of_momentum_behind_the_cut(scheme):
    velocity = 30.0 * np.sin(3.0 * block(2).x[:, ::-1])
    simulation = es.Simulation(block(2, velocity=velocity), scheme=scheme)
    probe = SectionProbe(name="s", point=(0.5, 0.5), normal=(1.0, 0.5))
    measure, behind = probe.bind(simulation), (block(2).x - 0.5) @ [1.0, 0.5] < 0.0
    for _ in range(5):
        before = simulation.v[behind].sum(axis=0) * 1100.0 / 36
        simulation.step()
        after = simulation.v[behind].sum(axis=0) * 1100.0 / 36
        force = measure()["force"]
        assert force == pytest.approx((after - before) / simulation.dt, rel=1e-9)
        assert np.linalg.norm(force) > 1e3


def test_reaction_probe_is_the_reaction():
    simulation = plate()
    simulation.step(3)
    held = simulation.boundaries[0]
    measured = ReactionProbe(name="r", boundary=held).bind(simulation)()
    assert np.array_equal(measured["force"], simulation.reaction(held)) and measured["force"].any()


def test_bad_probes_are_named():
    simulation = plate()
    for probe, message in [
        (PointProbe(name="p", X=(0.5, 0.5, 0.5)), r"X must be \(2,\) finite numbers"),
        (PointProbe(name="p", X=(5.0, 5.0)), "must lie in body 'plate', whose particles lie in"),
        (PointProbe(name="p", X=(0.5, 0.5), body="plat"), r"body must be one of \['plate'\]"),
        (SectionProbe(name="s", point=(2.0, 0.0), normal=(1.0, 0.0)), "the plane must cut body"),
        (SectionProbe(name="s", point=(0.5, 0.0), normal=(0.0, 0.0)), "normal not zero"),
        (ReactionProbe(name="r", boundary=es.Fixed()), "boundary must be one of the simulation's 1"),
    ]:
        with pytest.raises(ValueError, match=message):
            probe.bind(simulation)
    with pytest.raises(ValueError, match="probe name must be of letters"):
        BodyProbe(name="../up")
