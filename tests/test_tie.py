"""The tie of positions to deformation gradients (M16): exact where it must be, and felt where nothing else is."""

import numpy as np
import pytest
import warp as wp

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.geometry import box

RUBBER = es.NeoHookean(density=1000.0, young=1e6, poisson=0.3)
MODULUS = 4.0 * 1e6 / 2.6  # 4μ; M = 3.5μ of this law is less
COUNT = {1: 16, 2: 8, 3: 5}


def jittered(dim, dtype=wp.float64, tie=es.Tie(), velocity=0.0, n=None, material=RUBBER, **options):
    """A block with edges and corners, 20 % jitter."""
    n = COUNT[dim] if n is None else n
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / n)
    x = x + 0.2 / n * np.random.default_rng(4).uniform(-1.0, 1.0, x.shape)
    body = es.Body(x=x, volume=volume, material=material, velocity=velocity * np.ones_like(x))
    return es.Simulation(body, scheme=es.Verlet(tie=tie, dissipation=None), dtype=dtype, **options)


def tied(simulation, x, F):
    """Forces [N] and stresses [Pa] of the tie at x and F."""
    stepper = simulation.stepper
    stepper.U.x.assign(x)
    stepper.U.F.assign(F)
    medium, U = stepper.medium, stepper.U
    medium.pairs.compute(medium.sums, U, U.v)
    return stepper.forces.tie.numpy().astype(float), stepper.flux.fields.tie.numpy().astype(float)


def pair_energy(simulation, x, F, modulus):
    """¼ Σ Σ χ Ē V_a w_ab |r_ab|² [J], in numpy."""
    reference, lists, near = (
        simulation.configuration.fields,
        simulation.configuration.lists,
        simulation.configuration.near,
    )
    X, V, w, own = reference.x.numpy(), reference.V.numpy(), lists.of_pairs(near.w), lists.of_pairs(near.own)
    w = w + np.abs(w - own)
    a, b = np.repeat(np.arange(len(X)), lists.lengths), lists.of_pairs(near.index)
    r = x[b] - x[a] - 0.5 * np.einsum("nij,nj->ni", F[a] + F[b], X[b] - X[a])
    return 0.25 * modulus * (V[a] * w * (r**2).sum(axis=1)).sum()


@pytest.mark.parametrize("simd", [True, False])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("dim", [1, 2, 3])
class TestExactness:
    def test_linear_and_quadratic_fields_exert_nothing(self, dim, dtype, simd):
        """Whatever the arrangement: F constant, and F linear with x its integral."""
        execution.set_simd(simd)
        simulation, rng = jittered(dim, dtype), np.random.default_rng(0)
        X = simulation.X
        A, B = np.eye(dim) + 0.3 * rng.normal(size=(dim, dim)), 0.2 * rng.normal(size=(dim, dim, dim))
        B = B + B.transpose(0, 2, 1)
        for bend in (0.0, 1.0):
            x = X @ A.T + 0.5 * bend * np.einsum("ijk,nj,nk->ni", B, X, X)
            F = A + bend * np.einsum("ijk,nk->nij", B, X)
            force, stress = tied(simulation, x, F)
            noise = 200.0 * np.finfo(simulation.space.numpy).eps
            assert np.abs(force).max() < noise * MODULUS / COUNT[dim] ** (dim - 1)
            assert np.abs(stress).max() < noise * MODULUS

    def test_force_and_stress_are_derivatives_of_one_energy(self, dim, dtype, simd):
        """By central differences of the pair energy along a random direction; both momenta to round-off."""
        execution.set_simd(simd)
        simulation, rng = jittered(dim, dtype), np.random.default_rng(1)
        n, h = COUNT[dim], 1.0 / COUNT[dim]
        X, V0 = simulation.X, h**dim
        F = np.eye(dim) + 0.2 * rng.normal(size=(n**dim, dim, dim))
        x = X + 0.3 * h * rng.normal(size=X.shape)
        dx, dF = h * rng.normal(size=x.shape), rng.normal(size=F.shape)
        force, stress = tied(simulation, x, F)
        [(M, mu)] = simulation.stepper.flux.moduli()
        modulus = 0.5 * (M if dim == 1 else min(M, 4.0 * mu))
        plus, minus = (pair_energy(simulation, x + s * dx, F + s * dF, modulus) for s in (1e-4, -1e-4))
        power = -(force * dx).sum() + V0 * (stress * dF).sum()
        exact = 2e-4 if dtype == wp.float32 else 1e-9
        assert power == pytest.approx((plus - minus) / 2e-4, rel=exact)
        assert np.abs(force.sum(axis=0)).max() < exact * np.abs(force).sum()
        # A turn of x and F together costs nothing: torque of the forces against that of the stresses
        turn = np.einsum("ai,aj->ij", x, force) - V0 * np.einsum("aij,akj->ki", stress, F)
        assert np.abs(turn - turn.T).max() < exact * np.abs(force).sum()

    def test_a_body_that_drifts_is_not_strained(self, dim, dtype, simd):
        execution.set_simd(simd)
        runs = []
        for tie in (None, es.Tie()):
            simulation = jittered(dim, dtype, tie, velocity=3.0)
            simulation.step(5)
            runs.append(np.abs(simulation.F - np.eye(dim)).max())
        assert max(runs) < 1e-5


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_books_know_what_the_tie_holds(dim):
    """Its account is the pair energy, to the second order of the step; the total neither grows nor falls with it."""
    simulation = jittered(dim, n=2 * COUNT[dim] if dim < 3 else 6)
    X = simulation.X
    simulation.stepper.U.v.assign(2.0 * np.sin(9.0 * np.roll(X, 1, axis=1) + 5.0 * X))
    simulation.stepper.rebuild()
    simulation.stepper.ledger.open(simulation.stepper.U)
    simulation.clock.option = es.TimeStep(cfl=0.1)
    simulation.clock.cfl = 0.1
    start = simulation.energy()["total"]
    simulation.step(120)
    energy = simulation.energy()
    [(M, mu)] = simulation.stepper.flux.moduli()
    held = pair_energy(simulation, simulation.x, simulation.F, 0.5 * (M if dim == 1 else min(M, 4.0 * mu)))
    assert held > 1e-4 * start
    assert energy["tied"] == pytest.approx(held, rel=0.02)
    assert energy["total"] == pytest.approx(start, rel=2e-3)
    assert abs(energy["residual"]) < 1e-12 * start


@pytest.mark.parametrize("tie", [None, es.Tie()], ids=repr)
def test_hourglass_modes_come_back(tie):
    """A saw-tooth in the positions, which no gradient sees, stays for ever without the tie; with it, it swings."""
    n = 8
    x, volume = box((0.0, 0.0), (1.0, 1.0), 1.0 / n)
    saw_tooth = (-1.0) ** np.rint((x * n - 0.5).sum(axis=1))
    body = es.Body(x=x, volume=volume, material=RUBBER, surface=0.0)
    simulation = es.Simulation(body, reference=es.Never(), periodic=(1.0, 1.0), scheme=es.Verlet(tie=tie))
    simulation.stepper.U.x.assign(x + 1e-4 * saw_tooth[:, None])
    shares = []
    for _ in range(40):
        simulation.step()
        shares.append(((simulation.x - x)[:, 0] * saw_tooth).mean() / 1e-4)
    if tie is None:
        assert shares == pytest.approx([1.0] * 40, abs=1e-6)
    else:
        assert min(shares) < 0.0 and abs(shares[-1]) < 0.3


@pytest.mark.parametrize("reference", [es.Never(), es.Every(50)], ids=repr)
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_mismatch_is_seen(dim, reference):
    """The rms of r over a particle's pairs, in spacings: in numpy, for positions and F that have nothing in common."""
    n = COUNT[dim]
    simulation = jittered(dim, reference=reference, arrangement=es.Current())
    X, rng = simulation.X, np.random.default_rng(3)
    x, F = X + 0.1 / n * rng.normal(size=X.shape), np.eye(dim) + 0.1 * rng.normal(size=(n**dim, dim, dim))
    simulation.stepper.U.x.assign(x)
    simulation.stepper.U.F.assign(F)
    lists = simulation.configuration.lists
    b, w = lists.of_pairs(lists.rows.index), lists.of_pairs(lists.rows.w)
    a = np.repeat(np.arange(n**dim), lists.lengths)
    r = x[b] - x[a] - 0.5 * np.einsum("nij,nj->ni", F[a] + F[b], X[b] - X[a])
    squares, total = (np.bincount(a, w * value, n**dim) for value in ((r**2).sum(axis=1), np.ones(len(a))))
    np.testing.assert_allclose(simulation.mismatch, np.sqrt(squares / total) * n, rtol=1e-12)
    assert simulation.extrema()["mismatch"] == simulation.mismatch.max() > 0.05


@pytest.mark.parametrize(("dim", "n"), [(2, 8), (3, 5)])
def test_it_costs_less_than_a_tenth_of_the_step(dim, n):
    """Highest frequency of a free block with corners, 20 % jitter, by power iteration on its forces."""

    def highest(tie):
        simulation = jittered(dim, n=n, tie=tie, reference=es.Never())
        stepper, X = simulation.stepper, simulation.X
        u, step = np.random.default_rng(2).normal(size=X.shape), 1e-6 / n
        for _ in range(100):
            u *= step / np.linalg.norm(u) * np.sqrt(len(u))
            stepper.U.v.assign(u)
            stepper._velocity_gradient(stepper.U)
            gradient = stepper.grad_v.numpy().copy()
            stepper.U.v.zero_()
            stepper.U.x.assign(X + u)
            stepper.U.F.assign(np.eye(dim) + gradient)
            stepper._stress(stepper.U, 0.0)
            stepper._sum_forces(stepper.U, stepper.U, 0.0)
            forces = stepper.forces
            acceleration = (forces.internal.numpy() + forces.tie.numpy()) / simulation.particles.mass.numpy()[:, None]
            rate, u = np.linalg.norm(acceleration) / np.linalg.norm(u), -acceleration
        return np.sqrt(rate)

    assert 1.0 <= highest(es.Tie()) / highest(None) < 1.1


def test_incompressible_bodies_do_not_lock():
    """A short beam under its weight, four across: ν = 0.49 bends at most a tenth less with the tie than without."""
    n = 4
    x, volume = box((0.0, 0.0), (2.0, 0.5), 0.5 / n)
    sag = {}
    for tie in (None, es.Tie()):
        material = es.NeoHookean(density=1000.0, young=1e6, poisson=0.49)
        base = es.Fixed(lambda X: X[:, 0] < 0.5 / n)
        body = es.Body(x=x, volume=volume, material=material)
        scheme = es.Verlet(tie=tie)
        simulation = es.Simulation(body, boundaries=[base, es.BodyForce([0.0, -0.5])], scheme=scheme)
        simulation.run(0.4)
        sag[tie] = -(simulation.x - x)[:, 1].min()
    assert 0.85 < sag[es.Tie()] / sag[None] < 1.0


@pytest.mark.parametrize("stiffness", [0.0, -1.0, 1.5, np.nan])
def test_options_out_of_range_are_refused(stiffness):
    with pytest.raises(ValueError, match=r"tie stiffness must be in \(0, 1\]"):
        es.Tie(stiffness)
