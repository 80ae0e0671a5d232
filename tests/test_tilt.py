"""Tilted pair weights (M17): the identities that they keep, the moments that they take out, the step that they bear."""

import dataclasses

import numpy as np
import pytest
import warp as wp
from clouds import BODIES, COUNT, block

import warp_eulsph as es
from warp_eulsph import execution

STEEL = es.LinearElastic(density=1.0, young=1.0, poisson=0.3)


def simulation(x, tilt=es.Tilt(), dtype=wp.float64, tie=None, velocity=None, **options):
    body = es.Body(x=x, volume=1.0, spacing=1.0, material=STEEL, velocity=0.0 if velocity is None else velocity)
    scheme = es.Verlet(tilt=tilt, tie=tie)
    return es.Simulation(body, scheme=scheme, dtype=dtype, sort=False, **options)


def rows(configuration):
    """Both ends, ξ, w_ab t_ab and w_ab t_ba of every directed pair, in numpy."""
    x, near, lists = configuration.fields.x.numpy().astype(float), configuration.near, configuration.lists
    a = np.repeat(np.arange(len(x)), lists.lengths)
    b, w, own = lists.of_pairs(near.index), lists.of_pairs(near.w).astype(float), lists.of_pairs(near.own).astype(float)
    return a, b, x[b] - x[a], own, 2.0 * w - own


@pytest.mark.parametrize("simd", [True, False])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("dim", [1, 2, 3])
class TestIdentities:
    def test_gradient_is_exact_for_linear_fields(self, dim, dtype, simd):
        execution.set_simd(simd)
        x, A = block(dim), np.random.default_rng(0).normal(size=(dim, dim))
        stepper = simulation(x, dtype=dtype, velocity=x @ A.T).stepper
        stepper._velocity_gradient(stepper.U)
        error = np.abs(stepper.grad_v.numpy() - A).max()
        assert error < 2e3 * np.finfo(stepper.space.numpy).eps

    def test_forces_are_the_adjoint_of_the_gradient(self, dim, dtype, simd):
        """Σ f·v = −Σ V Q:∇v for any Q and v; the forces sum to zero, and so do their moments where Q is symmetric."""
        execution.set_simd(simd)
        x, rng = block(dim), np.random.default_rng(1)
        n, v = len(x), rng.normal(size=x.shape)
        made = simulation(x, dtype=dtype, velocity=v)
        stepper, medium = made.stepper, made.stepper.medium
        stepper._velocity_gradient(stepper.U)
        Q = rng.normal(size=(n, dim, dim))
        Q = Q + Q.transpose(0, 2, 1)
        fields = medium.flux.fields
        fields.Q.assign(Q)
        if len(fields.Pi):
            fields.Pi.assign(Q @ medium.configuration.fields.L.numpy().transpose(0, 2, 1))
        medium.stabiliser.compute(dataclasses.replace(medium.sums, epsilon=0.0), stepper.U.x, stepper.U.v)
        f, gradient = (array.numpy().astype(float) for array in (medium.forces.internal, stepper.grad_v))
        scale = np.abs(f).sum()
        noise = 100.0 * np.finfo(stepper.space.numpy).eps
        assert abs((f * v).sum() + (Q * gradient).sum()) < noise * scale
        assert np.abs(f.sum(axis=0)).max() < noise * scale
        turn = np.einsum("ni,nj->ij", x, f)
        assert np.abs(turn - turn.T).max() < noise * scale * COUNT[dim]


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_third_moments_vanish_where_the_bound_lets_them(dim):
    """Σ w t |ξ|² ξ is zero where |μ| < most, and points along μ where it is not: the least Φ within the bound."""
    made = simulation(block(dim))
    a, _, xi, own, _ = rows(made.configuration)
    n = len(made.x)

    def moment(w):
        weighted = (w * (xi**2).sum(axis=1))[:, None] * xi
        return np.stack([np.bincount(a, column, n) for column in weighted.T], axis=1)

    plain = simulation(block(dim), tilt=None).configuration
    untilted = plain.lists.of_pairs(plain.near.w)
    scale = np.bincount(a, untilted * np.linalg.norm(xi, axis=1) ** 3, n)
    before, after = (np.linalg.norm(moment(w), axis=1) / scale for w in (untilted, own))
    # μ from the two weights of a pair: ln(own/w) = −μ·ξ, by least squares over the row
    mu = np.array([np.linalg.lstsq(xi[a == k], -np.log(own / untilted)[a == k], rcond=None)[0] for k in range(n)])
    size = np.linalg.norm(mu, axis=1)
    inside = size < 1.5 * (1.0 - 1e-6)
    assert size.max() < 1.5 * (1.0 + 1e-9)
    assert inside.sum() >= (COUNT[dim] - 2) ** dim
    assert before[inside].max() > 0.02
    assert after[inside].max() < 1e-9
    bound = ~inside
    along = (moment(own)[bound] * mu[bound]).sum(axis=1) / (np.linalg.norm(moment(own)[bound], axis=1) * size[bound])
    assert along.min() > 1.0 - 1e-6


def test_inside_a_lattice_nothing_is_tilted():
    x = block(2, jitter=0.0, shape=(16, 16))
    made, plain = simulation(x).configuration, simulation(x, tilt=None).configuration
    a, _, _, own, dual = rows(made)
    deep = (np.abs(x - 8.0).max(axis=1) < 2.5)[a]
    np.testing.assert_array_equal(own[deep], plain.lists.of_pairs(plain.near.w)[deep])
    np.testing.assert_array_equal(dual[deep], own[deep])


def highest_frequency(x, tilt):
    """ω dx/c of a free body by power iteration on its forces, and the step over 2/ω that it is given."""
    made = simulation(x, tilt=tilt, tie=es.Tie())
    stepper, dim = made.stepper, x.shape[1]
    made.stepper.medium.options = es.Verlet(tilt=tilt, dissipation=None)
    u = np.random.default_rng(2).normal(size=x.shape)
    for _ in range(120):
        u *= 1e-6 / np.abs(u).max()
        stepper.U.v.assign(u)
        stepper._velocity_gradient(stepper.U)
        gradient = stepper.grad_v.numpy().copy()
        stepper.U.v.zero_()
        stepper.U.x.assign(x + u)
        stepper.U.F.assign(np.eye(dim) + gradient)
        stepper._stress(stepper.U, 0.0)
        stepper._sum_forces(stepper.U, stepper.U, 0.0)
        acceleration = stepper.forces.internal.numpy() + stepper.forces.tie.numpy()
        rate, u = np.linalg.norm(acceleration) / np.linalg.norm(u), -acceleration
    step = simulation(x, tilt=tilt, tie=es.Tie())
    step.step()
    return np.sqrt(rate), 0.5 * np.sqrt(rate) * step.dt


def test_the_step_bears_it():
    """The share of 2/ω that a step is, in bodies with edges and corners: 0.81 at most, 0.78 without tilt."""
    without = {name: highest_frequency(x, None)[1] for name, x in BODIES.items()}
    tilted = {name: highest_frequency(x, es.Tilt())[1] for name, x in BODIES.items()}
    assert max(without.values()) < 0.8 and max(tilted.values()) < 0.83, (without, tilted)
    higher = highest_frequency(BODIES["cube"], es.Tilt())[0] / highest_frequency(BODIES["cube"], None)[0]
    assert 1.10 < higher < 1.18


@pytest.mark.parametrize("dim", [2, 3])
def test_dissipation_with_its_stress_takes_no_angular_momentum(dim):
    """M9 with ``stress=True``: a jittered block spun about, with a velocity that is rough from particle to particle."""
    x = block(dim, 0.1)
    middle = x - x.mean(axis=0)
    v = 0.2 * np.random.default_rng(5).normal(size=x.shape)
    v[:, 0] -= 0.05 * middle[:, 1]
    v[:, 1] += 0.05 * middle[:, 0]
    material = es.NeoHookean(density=1.0, young=1.0, poisson=0.3)
    body = es.Body(x=x, volume=1.0, spacing=1.0, material=material, velocity=v)
    made = es.Simulation(body, scheme=es.Verlet(dissipation=es.Upwind(stress=True)))
    before, energy = made.angular_momentum(), made.energy()["total"]
    made.run(30.0)
    assert made.energy()["dissipation"] < -0.3 * energy
    drift = np.linalg.norm(made.angular_momentum() - before) / np.linalg.norm(before)
    assert drift < 1e-13


@pytest.mark.parametrize(("n", "band"), [(5, 0.03), pytest.param(10, 0.01, marks=pytest.mark.slow)])
def test_a_thin_beam_sags_as_it_should(n, band):
    """0.35 m × 0.02 m of Saint Venant–Kirchhoff under g = 2 m/s²: 0.129 m at most, +2.4 and +0.2 % at 5 and 10 across.

    Without tilt and sharpening it sags 26 % too far at 5.
    """
    spacing = 0.02 / n
    cells = round(0.35 / spacing)
    along, across = (np.arange(cells) + 0.5) * (0.35 / cells), (np.arange(n) + 0.5) * spacing
    x, volume = np.stack(np.meshgrid(along, across, indexing="ij"), axis=-1).reshape(-1, 2), 0.35 / cells * spacing
    material = es.SaintVenantKirchhoff(density=1000.0, young=1.4e6, poisson=0.4)
    body = es.Body(x=x, volume=volume, spacing=spacing, material=material)
    clamp = es.Clamped(point=(0.0, 0.0), normal=(-1.0, 0.0))
    made = es.Simulation(body, boundaries=[clamp, es.Gravity(2.0)])
    tip = np.argsort(np.linalg.norm(x - [0.35, 0.01], axis=1))[:2]
    sag = 0.0
    for t in np.arange(0.4, 0.53, 0.01):
        made.run(t)
        sag = max(sag, (x[tip, 1] - made.x[tip, 1]).mean())
    assert sag == pytest.approx(0.129, rel=band)


@pytest.mark.parametrize("most", [0.0, -1.0, 3.5, np.nan])
def test_options_out_of_range_are_refused(most):
    with pytest.raises(ValueError, match=r"the largest tilt must be in \(0, 3\]"):
        es.Tilt(most)


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("stress", [False, True])
def test_simd_and_portable_passes_agree(stress, dim):
    """Forces and energies after ten steps of a rough start, with M9 by forces alone and with its stress.

    To round-off of the largest: by that of K Newton's rounds for one tilt in two hundred end a round sooner or later,
    which changes its L by 1e-12 of it.
    """
    x = block(dim, 0.1)
    v = 0.1 * np.random.default_rng(6).normal(size=x.shape)
    found = []
    for simd in (True, False):
        execution.set_simd(simd)
        material = es.NeoHookean(density=1.0, young=1.0, poisson=0.3)
        body = es.Body(x=x, volume=1.0, spacing=1.0, material=material, velocity=v)
        made = es.Simulation(body, scheme=es.Verlet(dissipation=es.Upwind(stress=stress)), sort=False)
        made.step(10)
        found.append((made.v, made.F, made.energy()["dissipation"]))
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12 * np.abs(one).max())


@pytest.mark.parametrize("stress", [False, True])
@pytest.mark.parametrize("dim", [2, 3])
def test_a_rotation_is_not_dragged_whatever_positions_say(dim, stress):
    """v = Ω x with positions a tenth of a spacing off F: no force of M9, of which Ω × r would be a jump."""
    x = block(dim, 0.1)
    turn = np.zeros((dim, dim))
    turn[1, 0], turn[0, 1] = 1.0, -1.0
    off = x + 0.03 * np.random.default_rng(7).uniform(-1.0, 1.0, x.shape)
    scheme = es.Verlet(dissipation=es.Upwind(stress=stress))
    body = es.Body(x=x, volume=1.0, spacing=1.0, material=STEEL, velocity=off @ turn.T)
    made = es.Simulation(body, scheme=scheme, sort=False)
    stepper = made.stepper
    stepper.U.x.assign(off)
    stepper.grad_v.assign(np.broadcast_to(turn, (len(x), dim, dim)))
    stepper._choose_dt(stepper.U)  # impedances
    stepper._stress(stepper.U, 0.0)
    stepper._sum_forces(stepper.U, stepper.U, 0.0)
    assert stepper.medium.flux.fields.impedance.numpy().min() > 0.1
    assert np.abs(stepper.forces.tie.numpy()).max() > 1e-3
    assert np.abs(stepper.forces.dissipation.numpy()).max() < 1e-13
