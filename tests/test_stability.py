"""What holds and what does not: the claims of docs/method.md on stability, each with its case."""

import numpy as np
import pytest
from bodies import COMPRESSIBLE, RUBBER

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.validation.cases.bar import DENSITY, LENGTH, SPEED, YOUNG


def spinning_plate(n, **options):
    """Unit square of rubber spinning at 105 rad/s."""
    x, volume = box((-0.5, -0.5), (0.5, 0.5), 1 / n)
    body = es.Body(x=x, volume=volume, material=RUBBER, velocity=105.0 * np.c_[-x[:, 1], x[:, 0]])
    return es.Simulation(body, **options)


def energies(simulation, end, frames=40):
    """Total energy over its start at evenly spaced times; inf from a failure on."""
    start = simulation.energy()["total"]
    ratios = []
    try:
        for _ in simulation.frames(np.linspace(0.0, end, frames + 1)[1:]):
            ratios.append(simulation.energy()["total"] / start)
    except es.UnstableError:
        ratios.append(np.inf)
    return np.array(ratios)


@pytest.mark.parametrize("arrangement", [es.Convected(), es.Current()], ids=repr)
@pytest.mark.parametrize("reference", [es.Never(), es.Every(5), es.Always()], ids=repr)
def test_spinning_plate_holds_with_the_defaults(reference, arrangement):
    """One and two thirds of a turn: energy never grows, and 97 % of it is left."""
    simulation = spinning_plate(16, reference=reference, arrangement=arrangement)
    spin = simulation.angular_momentum()[0]
    ratios = energies(simulation, 0.1)
    assert ratios.max() <= 1.0
    assert ratios[-1] >= 0.97
    assert simulation.angular_momentum()[0] == pytest.approx(spin, rel=6e-3)


def test_plain_dual_form_fails_in_a_moving_reference():
    """M5 alone with neighbours found every step: particles pair up, and what the dissipation then takes is the run."""
    ratios = energies(spinning_plate(16, arrangement=es.Current(), scheme=es.LaxWendroff(correction=None)), 0.1)
    assert not (ratios.max() <= 1.0 and ratios[-1] >= 0.9)


def test_no_dissipation_lets_zero_energy_modes_stand():
    """Without M9 a saw-tooth in the velocity stays for ever; with it, it is gone after a few periods."""
    n = 12
    x, volume = box((0.0, 0.0), (1.0, 1.0), 1 / n)
    ranks = np.rint(x * n - 0.5)
    velocity = 1e-3 * (-1.0) ** ranks.sum(axis=1)[:, None] * [1.0, 0.0]
    left = {}
    for dissipation in (None, es.Upwind()):
        body = es.Body(x=x, volume=volume, material=COMPRESSIBLE, velocity=velocity)
        scheme = es.LaxWendroff(dissipation=dissipation)
        simulation = es.Simulation(body, reference=es.Never(), scheme=scheme, periodic=(1.0, 1.0))
        simulation.step(100)
        left[dissipation] = np.abs(simulation.v).max() / 1e-3
    assert left[None] == pytest.approx(1.0, abs=1e-6)
    assert left[es.Upwind()] < 1e-3


@pytest.mark.parametrize("smoothing", [None, es.LinearExact()], ids=repr)
def test_twice_the_step_gains_energy(smoothing):
    """At CFL 0.8 the total Lagrangian plate gains energy within seven turns, with M7 and without it."""
    scheme, step = es.LaxWendroff(smoothing=smoothing), es.TimeStep(cfl=0.8)
    ratios = energies(spinning_plate(16, reference=es.Never(), scheme=scheme, time_step=step), 0.42)
    assert ratios.max() > 1.1


def test_surface_vectors_of_a_flat_face_alternate():
    """The figures of docs/method.md §7, layer by layer; they sum to the face, half a spacing outside."""
    x, volume = box((0.0,), (1.0,), 1 / 40)
    body = es.Body(x=x, volume=volume, material=es.Bar(density=1.0, young=1.0))
    layers = es.Simulation(body, scheme=es.Verlet(tilt=None, sharpening=None)).stepper.U.surface.numpy()[::-1, 0]
    assert np.round(layers[:4], 3).tolist() == [1.368, -0.245, -0.115, -0.009]
    assert layers[:10].sum() == pytest.approx(1.0, abs=1e-12)
    assert (layers[:10] * np.arange(10)).sum() == pytest.approx(-0.5, abs=1e-12)


def test_linear_exact_smoothing_fails_on_the_bounded_bar():
    """M7 with θ = ½ commutes with M4 and M5 no more than M6 does at the free end: energy grows at CFL 0.4 already."""
    n = 40
    dx = LENGTH / (n - 0.5)
    x = np.arange(n) * dx
    volume = np.where(x == 0.0, 0.5 * dx, dx)
    kept = {}
    for smoothing in (None, es.LinearExact()):
        body = es.Body(
            x=x[:, None],
            volume=volume,
            spacing=dx,
            material=es.Bar(density=DENSITY, young=YOUNG),
            velocity=SPEED * (x > 0.75 * LENGTH)[:, None],
        )
        scheme = es.LaxWendroff(smoothing=smoothing)
        simulation = es.Simulation(body, boundaries=[es.Fixed([0])], reference=es.Never(), scheme=scheme, dilation=1.0)
        kept[smoothing] = energies(simulation, 2e-4).max()
    assert kept[None] <= 1.0
    assert kept[es.LinearExact()] > 10.0
