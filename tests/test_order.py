"""Order of convergence on exact standing waves: swinging plate (2-D) and low-dispersion cube (3-D)."""

import math

import numpy as np
import pytest
from bodies import lattice

import warp_eulsph as es
from warp_eulsph.geometry import nodes
from warp_eulsph.validation.standing_wave import DENSITY, POISSON, YOUNG, StandingWave, build

MATERIAL = es.NeoHookean(density=DENSITY, young=YOUNG, poisson=POISSON)


def errors(wave, simulation, volume):
    """Relative L2 errors of v, F − I and P at the end, weighted with the volumes."""

    def relative(numeric, exact):
        weight = np.reshape(volume, (-1,) + (1,) * (exact.ndim - 1))
        return math.sqrt((weight * (numeric - exact) ** 2).sum() / (weight * exact**2).sum())

    own, dim = slice(0, len(wave.u)), simulation.space.dim  # ghosts, if any, come last
    stepper = simulation.stepper
    stepper.flux.compute(stepper.U.F, stepper.grad_v, stepper.configuration, stepper.clock.fields)
    P = stepper.flux.fields.Q.numpy()[own]  # with strains of 1e-6, Q and P differ by less than the errors
    return [
        relative(simulation.v[own], wave.velocity(wave.end)),
        relative(simulation.F[own] - np.eye(dim), wave.strain(wave.end)),
        relative(P, wave.stress(wave.end)),
    ]


def periodic(dim, n, reference, jitter=0.0, scheme=es.Verlet, **options):
    """Errors of the wave extended periodically, n particles per period; jitter in spacings."""
    x = 4.0 * lattice(dim, n)
    x = x + jitter * 4 / n * np.random.default_rng(0).uniform(-1, 1, x.shape)
    wave, volume = StandingWave(x), np.full(len(x), (4 / n) ** dim)
    surface = 0.0 if jitter else None
    body = es.Body(x=x, volume=volume, material=MATERIAL, velocity=wave.velocity(0.0), surface=surface)
    simulation = es.Simulation(body, reference=reference, periodic=(4.0,) * dim, scheme=scheme(**options))
    simulation.run(wave.end)
    return errors(wave, simulation, volume)


def bounded(dim, n, reference, true_surface, scheme=es.Verlet, **options):
    """Errors on the unit plate or cube itself: u_n = 0 at X_i = 0; tangential u = 0, no normal traction at X_i = 1."""
    x, volume, surface = nodes([0.0] * dim, [1.0] * dim, 1 / n)
    wave = StandingWave(x)
    body = es.Body(
        x=x,
        volume=volume,
        spacing=1 / n,
        material=MATERIAL,
        velocity=wave.velocity(0.0),
        surface=surface if true_surface else None,
    )
    conditions = []
    for i in range(dim):
        tangential = [j for j in range(dim) if j != i]
        conditions.append(es.Fixed(lambda X, i=i: X[:, i] == 0.0, axes=[i]))
        conditions.append(es.Fixed(lambda X, i=i: X[:, i] == 1.0, axes=tangential))
    simulation = es.Simulation(body, boundaries=conditions, reference=reference, scheme=scheme(**options))
    simulation.run(wave.end)
    return errors(wave, simulation, volume)


def mirrored(dim, n, reference, scheme=es.Verlet):
    """Errors on the unit plate or cube with ghosts behind all faces: walls at X_i = 0, antisymmetry at X_i = 1."""
    simulation, wave = build(dim, n, reference, scheme=scheme())
    simulation.run(wave.end)
    return errors(wave, simulation, np.full(len(wave.u), n**-dim))


def orders(case, levels, *arguments, **options):
    """Least-squares orders of v, F and P over the levels, printed with the errors."""
    found = np.array([case(arguments[0], n, *arguments[1:], **options) for n in levels])
    observed = np.polyfit(np.log(levels), -np.log(found), 1)[0]
    print("orders of v, F, P:", observed, "errors:", *found, sep="\n  ")
    return observed


def plain(**options):
    """Verlet on M4 and M5 as they are: sharpened (M23), its errors are of time, of faces and of disorder."""
    return es.Verlet(sharpening=None, **options)


SCHEMES = pytest.mark.parametrize("scheme", [plain, es.LaxWendroff])
BOTH = pytest.mark.parametrize("reference", [es.Never(), es.Always()], ids=repr)
CLOSED = {"correction": es.PairAreas(kappa=math.inf, iterations=20)}


@SCHEMES
@BOTH
def test_second_order_in_2d(reference, scheme):
    assert orders(periodic, [48, 64, 80, 112], 2, reference, scheme=scheme).min() >= 1.9


@SCHEMES
@BOTH
def test_second_order_on_the_bounded_plate(reference, scheme):
    """Swinging plate on [0, 1]² with mirror ghosts at its four sides."""
    assert orders(mirrored, [12, 16, 20, 28], 2, reference, scheme=scheme).min() >= 1.9


@pytest.mark.parametrize(
    ("case", "dim", "levels", "parts"),
    [
        (periodic, 2, [48, 64], (0.02, 0.06)),
        (mirrored, 2, [12, 16], (0.02, 0.06)),
        pytest.param(mirrored, 3, [10, 13], (0.02, 0.15), marks=pytest.mark.slow),
        pytest.param(periodic, 3, [44, 52], (0.05, 0.2), marks=pytest.mark.slow),
    ],
)
def test_sharpened_errors_are_a_fraction(case, dim, levels, parts):
    """Of v and of F at the same resolutions; what is left is the error of time, of second order in the step."""
    for n in levels:
        sharp, blunt = (np.array(case(dim, n, es.Never(), scheme=scheme)) for scheme in (es.Verlet, plain))
        v, F, P = sharp / blunt
        assert v < parts[0] and max(F, P) < parts[1]


@pytest.mark.slow
@BOTH
def test_second_order_in_the_bounded_cube(reference):
    """Low-dispersion cube on [0, 1]³ with mirror ghosts at its six sides."""
    assert orders(mirrored, [10, 13, 16, 20], 3, reference, scheme=plain).min() >= 1.9


@pytest.mark.slow
@BOTH
def test_second_order_in_3d(reference):
    # 1.91 without the tie (M16), which lowers the error at the coarsest level by 1 %, and not at the finest: 1.898
    assert orders(periodic, [44, 52, 60, 68], 3, reference, scheme=plain).min() >= 1.89


@pytest.mark.slow
@BOTH
def test_closed_pairs_restore_convergence_on_a_jittered_cloud(reference):
    """10 % jitter: M5 alone stops converging; tied (M16), or closed by M11 with the true (no) surface, it does not.

    M13 closes a part of the defect (docs/measurements.md). Sharpened errors of v and F are smaller, and fall slower.
    """
    levels = [24, 32, 48, 64]
    alone = orders(periodic, levels, 2, reference, jitter=0.1, correction=None, tie=None, scheme=plain)
    tied = orders(periodic, levels, 2, reference, jitter=0.1, correction=None, scheme=plain)
    for n in levels:
        sharp, blunt = (
            periodic(2, n, reference, jitter=0.1, correction=None, scheme=each) for each in (es.Verlet, plain)
        )
        assert sharp[0] < blunt[0] and sharp[1] < blunt[1]
    balanced = orders(periodic, levels, 2, reference, jitter=0.1)
    closed = orders(periodic, levels, 2, reference, jitter=0.1, **CLOSED)
    assert balanced[0] >= 1.8
    assert balanced[1:].min() >= 0.9
    assert closed[0] >= 1.8
    assert closed[1:].min() >= 1.3
    assert tied[0] >= 1.5
    assert tied[1:].min() >= 0.6
    assert alone[1:].max() < 0.5


@pytest.mark.slow
@BOTH
def test_true_surface_vectors_restore_order_at_boundaries(reference):
    """Bounded plate: the arrangement's own surface vectors alternate from layer to layer and cost the order.

    With the exact vectors of the surface and M11: second order in v, and 1.5 in F and P, whose corrected gradient is of
    first order in the outermost layer. By default, without any vectors, errors are below those from 12 across on.
    """
    levels = [12, 16, 24, 32]
    own = orders(bounded, levels, 2, reference, False, scheme=plain, tilt=None)
    sharp = orders(bounded, levels, 2, reference, False)
    true = orders(bounded, levels, 2, reference, True, **CLOSED)
    assert own[1:].max() < 1.0
    assert sharp[0] >= 1.9 and sharp[1:].min() >= 1.25
    assert true[0] >= 1.9
    assert true[1:].min() >= 1.5


@pytest.mark.slow
@BOTH
def test_true_surface_vectors_in_3d(reference):
    true = orders(bounded, [8, 12, 16, 20], 3, reference, True, **CLOSED)
    assert true[0] >= 1.9
    assert true[1:].min() >= 1.5
