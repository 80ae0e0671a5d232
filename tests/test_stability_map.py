"""The stability tool finds known limits, and what docs/stability.md says of the defaults."""

import math
from dataclasses import replace

import numpy as np
import pytest

import warp_eulsph as es
from warp_eulsph.validation import stability
from warp_eulsph.validation.cases import saw_tooth
from warp_eulsph.validation.stability_rates import rates
from warp_eulsph.validation.stability_step import (
    RESOLVED,
    Point,
    Step,
    eigenvalues,
    growth,
    largest_cfl,
    spectral_radius,
)

LW, Verlet = es.LaxWendroff, es.Verlet


def frequencies(across, dilation):
    """ω dx/c of a periodic line: |d(θ)|, the symbol of M4 with the cubic spline."""
    j = np.arange(1, math.ceil(2.0 * dilation))
    g = np.array([abs(saw_tooth.slope(k / dilation)[0]) / k for k in j])
    theta = 2.0 * np.pi * np.arange(across) / across
    return np.abs((g * j * np.sin(np.outer(theta, j))).sum(axis=1) / (g * j**2).sum())


def test_three_particles_are_stable_up_to_two():
    """The paper's scheme is the classical Lax-Wendroff on three particles: an exact shift at CFL 2, nothing beyond."""
    scheme = LW(smoothing=es.NeighbourAverage(), dissipation=None)
    point = Point(dim=1, across=16, dilation=1.0, scheme=scheme)
    assert spectral_radius(replace(point, cfl=2.0)) == pytest.approx(1.0, abs=1e-10)
    assert spectral_radius(replace(point, cfl=2.02)) == pytest.approx(2.02**2 / 2.0 - 1.0, abs=1e-9)  # at θ = π/2
    assert largest_cfl(point) == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("cfl", [0.1, 0.4, 1.0])
def test_explicit_midpoint_gains_exactly_what_it_should(cfl):
    """Without smoothing and dissipation |λ|² = 1 + (ωΔt)⁴/4 for every wave, so the midpoint rule never holds alone."""
    point = Point(dim=1, across=16, scheme=LW(dissipation=None), cfl=cfl)
    omega = frequencies(16, 1.3)
    expected = np.sqrt(1.0 + (omega * cfl) ** 4 / 4.0)
    found = np.sort(np.abs(eigenvalues(point)))  # v and F: two per wave
    np.testing.assert_allclose(
        found, np.sort(np.repeat(expected, 2)), atol=1e-7
    )  # pairs at λ = 1 split by 1e-6 or less


@pytest.mark.parametrize("cfl", [0.4, 1.0, 2.4])
def test_verlet_keeps_every_wave_as_it_is(cfl):
    """Without dissipation and tie |λ| = 1 as long as ωΔt < 2: up to CFL 2.55 on a line, not sharpened."""
    point = Point(dim=1, across=16, scheme=Verlet(dissipation=None, tie=None, sharpening=None), cfl=cfl)
    assert frequencies(16, 1.3).max() * cfl < 2.0
    np.testing.assert_allclose(np.abs(eigenvalues(point)), 1.0, atol=1e-6)
    assert spectral_radius(replace(point, cfl=2.6)) > 1.1


def test_rates_of_a_line_are_those_of_its_symbol():
    found = rates(Point(dim=1, across=16))
    assert found.frequency == pytest.approx(frequencies(16, 1.3).max(), rel=1e-7)
    assert found.turning < 1e-12 and found.gain < 1e-12


def test_dissipation_never_limits_the_step():
    """M9 has rates well below 2 c/dx, all but real; at a free face the fastest waves are faster than in a box."""
    box, body = Point(dim=2, across=8), Point(dim=2, across=7, periodic=False)
    assert rates(body).frequency > 1.5 * rates(box).frequency
    for point in (box, body):
        assert rates(point).damping < 1.0
        assert rates(point).gain < 1e-12 and rates(point).turning < 0.01


def test_bloch_and_whole_jacobian_agree():
    """One particle's response tells what all of them do."""
    point = Point(dim=1, across=12, strain=0.1, reference=es.Always(), scheme=Verlet(correction=None))
    shifted = replace(point, jitter=1e-13)  # too little to matter, enough to form the whole Jacobian
    assert not shifted.translates
    assert spectral_radius(shifted) == pytest.approx(spectral_radius(point), abs=1e-8)


@pytest.mark.parametrize("reference", [es.Never(), es.Always()], ids=repr)
@pytest.mark.parametrize(
    "point",
    [
        Point(dim=1, across=16),
        Point(dim=2, across=8),
        Point(dim=3, across=6),
        Point(dim=1, across=16, periodic=False),
        Point(dim=1, across=16, periodic=False, jitter=0.2),
        Point(dim=2, across=4, periodic=False),
    ],
    ids=["line", "square", "cube", "bounded line", "jittered line", "bounded square"],
)
def test_the_defaults_hold_at_rest(point, reference):
    """CFL 0.8 is inside, total Lagrangian and Eulerian, and so is midpoint with its own 0.4."""
    point = replace(point, reference=reference)
    assert (point.scheme, point.cfl) == (Verlet(), Verlet.cfl)
    assert spectral_radius(point) <= 1.0 + RESOLVED
    assert spectral_radius(replace(point, scheme=LW(), cfl=LW.cfl)) <= 1.0 + RESOLVED


def test_less_dissipation_does_not_lower_the_limit_of_verlet():
    """What M9 takes it takes from the step of Verlet, while midpoint needs it to hold at all."""
    body = Point(dim=1, across=24, periodic=False)

    def holds(scheme, cfl):
        return spectral_radius(replace(body, scheme=scheme, cfl=cfl)) <= 1.0 + RESOLVED

    less = es.Upwind(0.25)
    assert holds(Verlet(dissipation=less, tie=None, tilt=None, sharpening=None), 1.55)
    assert not holds(Verlet(tie=None, tilt=None, sharpening=None), 1.55)
    assert holds(LW(), 0.7) and not holds(LW(dissipation=less), 0.7)


def test_smoothing_of_the_half_step_and_dissipation_do_not_go_together():
    """S turns the saw-tooth's sign (s = −1), so M9 of the smoothed half step feeds it."""
    point = Point(dim=1, across=16, dilation=1.0, cfl=0.1, scheme=LW(smoothing=es.NeighbourAverage()))
    assert spectral_radius(point) > 1.01
    assert spectral_radius(replace(point, scheme=LW(smoothing=es.NeighbourAverage(), dissipation=None))) <= 1 + RESOLVED


@pytest.mark.parametrize("dilation", [1.0, 1.2, 1.5])
def test_saw_tooth_in_tension_grows_by_the_closed_form(dilation):
    """α of M5 alone; at 1.0 and 1.5 neighbours on knots of the spline cost the quotient some accuracy."""
    exact = {1.0: math.sqrt(8.0), 1.2: math.sqrt(2.264151), 1.5: 0.0}[dilation]
    assert saw_tooth.closed_form(dilation) == pytest.approx(exact, abs=1e-6)
    assert saw_tooth.measured(dilation, 0.03) == pytest.approx(exact, abs=0.03)


@pytest.mark.parametrize("strain", [-0.1, 0.1])
@pytest.mark.parametrize(("dim", "across"), [(1, 16), (2, 8)])
def test_closed_pair_areas_keep_strained_lattices(dim, across, strain):
    """M11 holds in tension and compression; M5 alone pairs particles up in tension, by eigenvalues and by stepping."""
    closed = Verlet(correction=stability.CLOSED)
    point = Point(dim=dim, across=across, strain=strain, reference=es.Always(), scheme=closed)
    assert spectral_radius(point) <= 1.0 + RESOLVED
    if strain > 0.0:
        plain = replace(point, scheme=Verlet(correction=None))
        rate = math.log(spectral_radius(plain))
        assert rate > 0.08
        assert growth(plain, 200) == pytest.approx(rate, rel=0.1)  # few waves share the largest rate


@pytest.mark.parametrize("dilation", [1.2, 1.3, 1.5])
@pytest.mark.parametrize("strain", [-0.1, 0.1])
@pytest.mark.parametrize(("dim", "across"), [(1, 16), (2, 8), (3, 8)])
def test_balanced_pairs_do_not_grow(dim, across, strain, dilation):
    """The default, M13, holds strained lattices in tension and compression, where M5 alone pairs particles up."""
    if dim == 3 and dilation != 1.3:
        pytest.skip("the map's command measures the other dilations in 3-D")
    point = Point(dim=dim, across=across, strain=strain, dilation=dilation, reference=es.Always())
    assert spectral_radius(point) <= 1.0 + RESOLVED
    if strain > 0.0:
        assert spectral_radius(replace(point, scheme=Verlet(correction=None))) > 1.05


def test_more_iterations_than_needed_do_no_harm():
    """Conjugate gradients of M11 stop at round-off, also when the right-hand side is nothing else."""
    closed = Verlet(correction=es.PairAreas(kappa=math.inf, iterations=100))
    point = Point(dim=3, across=6, strain=-0.03, reference=es.Always(), scheme=closed)
    assert spectral_radius(point) <= 1.0 + RESOLVED


def test_lattices_keep_their_dilation_under_strain():
    """h follows the volume (M13 and all others alike): a strained lattice is measured at the dilation asked for."""
    for reference in (es.Never(), es.Always()):
        step = Step(Point(dim=2, across=8, dilation=1.2, strain=0.1, reference=reference))
        np.testing.assert_allclose(step.simulation.stepper.configuration.fields.h.numpy(), 1.2, rtol=1e-12)


def test_states_that_are_not_at_rest_are_refused():
    with pytest.raises(ValueError, match="at rest"):
        spectral_radius(Point(dim=1, across=12, jitter=0.2, strain=0.1, reference=es.Always()))
    with pytest.raises(ValueError, match="periodic"):
        Point(periodic=False, strain=0.1)
    with pytest.raises(ValueError, match="Never"):
        Point(reference=es.Every(2))


def test_a_scan_writes_its_figures_and_its_map(tmp_path):
    point = Point(dim=1, across=12, periodic=False)
    wanted = [
        stability.Study("options", "default", point, "largest cfl"),
        stability.Study("growth", "default", point, "growth per step"),
        stability.Study("weights", "CubicSpline", point, "largest cfl"),
        stability.Study("strained", "M11", replace(point, periodic=True, strain=0.1), "growth rate dx/c"),
    ]
    results = stability.scan(wanted)
    stability.write(results, tmp_path / "stability.csv")
    stability.draw(results, tmp_path / "map.png")
    lines = (tmp_path / "stability.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1 + len(wanted) and lines[0].startswith("group,name,dim,body")
    assert (tmp_path / "map.png").stat().st_size > 10_000


@pytest.mark.slow
def test_the_defaults_hold_in_a_bounded_cube():
    """3-D with free faces, where the step is nearest its limit."""
    point = Point(dim=3, across=4, periodic=False)
    assert spectral_radius(point) <= 1.0 + RESOLVED
    assert spectral_radius(replace(point, jitter=0.2)) <= 1.0 + RESOLVED


@pytest.mark.parametrize(("dim", "across"), [(2, 8), (3, 6)])
@pytest.mark.parametrize("stretch", [1.5, 2.0, 5.0])
def test_lattices_pulled_one_way_do_not_grow(dim, across, stretch):
    """The default, about uniaxial stress: any wave, to a stretch of five."""
    strain = (stretch - 1.0, *[stretch**-0.4 - 1.0] * (dim - 1))
    assert spectral_radius(Point(dim=dim, across=across, strain=strain)) <= 1.0 + RESOLVED
