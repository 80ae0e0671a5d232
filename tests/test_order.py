"""Order of convergence on exact standing waves: swinging plate (2-D) and low-dispersion cube (3-D)."""

import math

import numpy as np
import pytest

import warp_eulsph as es
from warp_eulsph.geometry import box, nodes

RHO, YOUNG, POISSON, AMPLITUDE = 1100.0, 17e6, 0.3, 1e-6  # amplitude small enough for the linear solution
MU, KAPPA = YOUNG / 2 / (1 + POISSON), YOUNG / 3 / (1 - 2 * POISSON)
MATERIAL = es.NeoHookean(density=RHO, young=YOUNG, poisson=POISSON)


class Wave:
    """u = U0 sin(ωt) A_i sin(πX_i/2) Π_{j≠i} cos(πX_j/2); starts undeformed with its largest velocity."""

    def __init__(self, dim, x):
        A = np.array([-1.0, 1.0]) if dim == 2 else np.ones(3)
        c = math.sqrt(MU / RHO) if dim == 2 else math.sqrt((KAPPA + 4 * MU / 3) / RHO)
        self.omega = math.pi / 2 * math.sqrt(dim) * c
        self.end = 0.4 * 2 * math.pi / self.omega  # where v, F and P are all far from zero
        sine, cosine = np.sin(np.pi * x / 2), np.cos(np.pi * x / 2)
        self.u, self.gradient = np.zeros_like(x), np.zeros((*x.shape, dim))
        for i in range(dim):
            factors = [sine[:, k] if k == i else cosine[:, k] for k in range(dim)]
            self.u[:, i] = A[i] * np.prod(factors, axis=0)
            for j in range(dim):
                slope = np.pi / 2 * (cosine[:, j] if j == i else -sine[:, j])
                self.gradient[:, i, j] = A[i] * np.prod([slope if k == j else f for k, f in enumerate(factors)], axis=0)

    @property
    def velocity(self):
        return AMPLITUDE * self.omega * self.u

    def errors(self, simulation, volume, own=slice(None)):
        """Relative L2 errors of v, F − I and P at the end, of the particles ``own``."""

        def relative(numeric, exact):
            weight = np.reshape(volume, (-1,) + (1,) * (exact.ndim - 1))
            return math.sqrt((weight * (numeric - exact) ** 2).sum() / (weight * exact**2).sum())

        phase, eye = self.omega * self.end, np.eye(self.u.shape[1])
        strain = AMPLITUDE * math.sin(phase) * self.gradient
        trace = np.trace(strain, axis1=1, axis2=2)[:, None, None] * eye
        P = (KAPPA - 2 * MU / 3) * trace + MU * (strain + strain.transpose(0, 2, 1))
        stepper = simulation.stepper
        stepper.flux.compute(stepper.U.F, stepper.configuration.fields)
        numeric_P = stepper.flux.fields.Q.numpy()[own]  # with strains of 1e-6, Q and P differ by less than the errors
        return [
            relative(simulation.v[own], math.cos(phase) * self.velocity),
            relative(simulation.F[own] - eye, strain),
            relative(numeric_P, P),
        ]


def periodic(dim, n, reference, jitter=0.0, scheme=es.Verlet, **options):
    """Errors of the wave extended periodically, n particles per period; jitter in spacings."""
    q = (np.arange(n) + 0.5) * 4 / n
    x = np.stack(np.meshgrid(*[q] * dim, indexing="ij"), -1).reshape(-1, dim)
    x = x + jitter * 4 / n * np.random.default_rng(0).uniform(-1, 1, x.shape)
    wave, volume = Wave(dim, x), np.full(len(x), (4 / n) ** dim)
    surface = 0.0 if jitter else None
    body = es.Body(x=x, volume=volume, material=MATERIAL, velocity=wave.velocity, surface=surface)
    simulation = es.Simulation(body, reference=reference, periodic=(4.0,) * dim, scheme=scheme(**options))
    simulation.run(wave.end)
    return wave.errors(simulation, volume)


def bounded(dim, n, reference, true_surface, scheme=es.Verlet, **options):
    """Errors on the unit plate or cube itself: u_n = 0 at X_i = 0; tangential u = 0, no normal traction at X_i = 1."""
    x, volume, surface = nodes([0.0] * dim, [1.0] * dim, 1 / n)
    wave = Wave(dim, x)
    body = es.Body(
        x=x,
        volume=volume,
        spacing=1 / n,
        material=MATERIAL,
        velocity=wave.velocity,
        surface=surface if true_surface else None,
    )
    conditions = []
    for i in range(dim):
        tangential = [j for j in range(dim) if j != i]
        conditions.append(es.Fixed(lambda X, i=i: X[:, i] == 0.0, axes=[i]))
        conditions.append(es.Fixed(lambda X, i=i: X[:, i] == 1.0, axes=tangential))
    simulation = es.Simulation(body, boundaries=conditions, reference=reference, scheme=scheme(**options))
    simulation.run(wave.end)
    return wave.errors(simulation, volume)


def mirrored(dim, n, reference, scheme=es.Verlet, **options):
    """Errors on the unit plate or cube with ghosts behind all faces: walls at X_i = 0, antisymmetry at X_i = 1."""
    x, volume = box([0.0] * dim, [1.0] * dim, 1 / n)
    wave = Wave(dim, x)
    material = es.LinearElastic(density=RHO, young=YOUNG, poisson=POISSON)
    body = es.Body(x=x, volume=volume, material=material, velocity=wave.velocity)
    conditions = []
    for i in range(dim):
        for position, image in ((0.0, es.Wall()), (1.0, es.Antisymmetry())):
            normal = np.zeros(dim)
            normal[i] = 2 * position - 1
            plane = {"point": [position] * dim, "normal": normal, "depth": 2 * 2 * 1.3 / n}
            body, ghosts = es.mirror(body, image=image, **plane)
            conditions.append(ghosts)
    simulation = es.Simulation(body, boundaries=conditions, reference=reference, scheme=scheme(**options))
    simulation.run(wave.end)
    own = slice(0, len(x))
    return wave.errors(simulation, np.full(len(x), volume), own)


def orders(case, levels, *arguments, **options):
    """Least-squares orders of v, F and P over the levels, printed with the errors."""
    errors = np.array([case(arguments[0], n, *arguments[1:], **options) for n in levels])
    observed = np.polyfit(np.log(levels), -np.log(errors), 1)[0]
    print("orders of v, F, P:", observed, "errors:", *errors, sep="\n  ")
    return observed


SCHEMES = pytest.mark.parametrize("scheme", [es.Verlet, es.LaxWendroff])
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


@pytest.mark.slow
@BOTH
def test_second_order_in_the_bounded_cube(reference):
    """Low-dispersion cube on [0, 1]³ with mirror ghosts at its six sides."""
    assert orders(mirrored, [10, 13, 16, 20], 3, reference).min() >= 1.9


@pytest.mark.slow
@BOTH
def test_second_order_in_3d(reference):
    assert orders(periodic, [44, 52, 60, 68], 3, reference).min() >= 1.9


@pytest.mark.slow
@BOTH
def test_closed_pairs_restore_convergence_on_a_jittered_cloud(reference):
    """10 % jitter: M5 stops converging, M11 with the true (no) surface does not.

    M13, the default, closes a part of the defect and stands between; docs/measurements.md.
    """
    levels = [24, 32, 48, 64]
    plain = orders(periodic, levels, 2, reference, jitter=0.1, correction=None)
    orders(periodic, levels, 2, reference, jitter=0.1)
    closed = orders(periodic, levels, 2, reference, jitter=0.1, **CLOSED)
    assert closed[0] >= 1.8
    assert closed[1:].min() >= 1.3
    assert plain[1:].max() < 0.5


@pytest.mark.slow
@BOTH
def test_true_surface_vectors_restore_order_at_boundaries(reference):
    """Bounded plate: the arrangement's own surface vectors alternate from layer to layer and cost the order.

    With the exact vectors of the surface and M11: second order in v, and 1.5 in F and P, whose corrected gradient is of
    first order in the outermost layer.
    """
    levels = [12, 16, 24, 32]
    own = orders(bounded, levels, 2, reference, False)
    true = orders(bounded, levels, 2, reference, True, **CLOSED)
    assert own[1:].max() < 1.0
    assert true[0] >= 1.9
    assert true[1:].min() >= 1.5


@pytest.mark.slow
@BOTH
def test_true_surface_vectors_in_3d(reference):
    true = orders(bounded, [8, 12, 16, 20], 3, reference, True, **CLOSED)
    assert true[0] >= 1.9
    assert true[1:].min() >= 1.5
