"""Eight particles of `J2` at once against each by itself and against eigenvectors: every dimension and precision."""

import functools

import numpy as np
import pytest
import warp as wp
from points import COPPER, HARDENINGS, KAPPA, MU

import warp_eulsph as es
from warp_eulsph import Space, execution
from warp_eulsph.geometry import box
from warp_eulsph.materials import J2
from warp_eulsph.materials.base import history_row
from warp_eulsph.materials.in_eights import EIGHT
from warp_eulsph.scheme.flux_eights import block_of

SPACES = [Space(dim, real) for dim in (1, 2, 3) for real in (wp.float32, wp.float64)]
COUNT = 5 * EIGHT + 3
pytestmark = pytest.mark.of_the_cpu


@functools.cache
def make_both(space, law):
    """Kernels: half step's stress, update, and then stress and energy, singly and by eights."""
    real, mat, row, C = space.real, space.mat, history_row(space, law), law.Constants
    stress, energy, moduli, update, pair = law.stress, law.energy, law.wave_moduli, law.update, space.row(2)
    (stress_of, energy_of, moduli_of, update_of), take = law.eights, block_of(space, law)

    @wp.kernel(module="unique", enable_backward=False)
    def singly(
        F: wp.array(dtype=mat),
        c: C,
        h: wp.array(dtype=row),
        ahead: wp.array(dtype=mat),
        P: wp.array(dtype=mat),
        W: wp.array(dtype=wp.float64),
        lost: wp.array(dtype=real),
        M: wp.array(dtype=pair),
    ):
        a = wp.tid()
        ahead[a] = stress(F[a], mat(), h[a], real(1.0), c)
        _F, h_a, lost_a = update(F[a], mat(), h[a], real(1.0), c)
        h[a] = h_a
        lost[a] = lost_a
        P[a] = stress(F[a], mat(), h_a, real(0.0), c)
        W[a] = wp.float64(energy(F[a], h_a, c))
        M[a] = moduli(F[a], h_a, c)

    @wp.kernel(module="unique", enable_backward=False)
    def by_eights(
        F: wp.array(dtype=mat),
        c: C,
        h: wp.array(dtype=row),
        ahead: wp.array(dtype=mat),
        P: wp.array(dtype=mat),
        W: wp.array(dtype=wp.float64),
        lost: wp.array(dtype=real),
        M: wp.array(dtype=pair),
    ):
        block = take(wp.tid(), 0, F, h)
        stress_of(block, real(1.0), c, ahead)
        update_of(block, real(1.0), c, lost)
        stress_of(block, real(0.0), c, P)
        energy_of(block, c, W)
        both = moduli_of(block, c)
        for k in range(block.count):
            M[block.first + k] = pair(both[0, k], both[1, k])

    return singly, by_eights


def gradients(space, seed):
    """F of strains from 1e-6 to 0.5, most of which metals bear and some of which they do not, (COUNT, dim, dim)."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-6.0, -0.3, (COUNT, 1, 1))
    return np.eye(space.dim) + size * rng.uniform(-0.5, 0.5, (COUNT, space.dim, space.dim))


def run(space, law, constants, kernel, threads, steps):
    """What the kernel leaves after each step."""
    row = history_row(space, law)
    h = wp.array([row(*law.start)] * COUNT, dtype=row)
    found = []
    for F in steps:
        ahead, P = (wp.zeros(COUNT, dtype=space.mat) for _ in range(2))
        W, lost = wp.zeros(COUNT, dtype=wp.float64), wp.zeros(COUNT, dtype=space.real)
        given = wp.array(F.astype(space.numpy), dtype=space.mat)
        M = wp.zeros(COUNT, dtype=space.row(2))
        wp.launch(kernel, threads, [given, constants, h, ahead, P, W, lost, M])
        found.append([array.numpy().astype(float) for array in (ahead, P, W, lost, M, h)])
    return found


@pytest.mark.parametrize(
    ("space", "name"), [*((space, "voce") for space in SPACES), *((space, "johnson_cook") for space in SPACES[4:])]
)
def test_eights_are_those_of_single_particles(space, name):
    """To round-off of strains of one, whether they yield, return to an earlier surface, or are larger than metals'."""
    material, eps = J2(**COPPER, hardening=HARDENINGS[name]), np.finfo(space.numpy).eps
    law = material.law(space)
    constants = material.filled_constants(law)
    singly, by_eights = make_both(space, law)
    first, second = gradients(space, 1), gradients(space, 2)
    steps = [first, first @ second, second, 1.001 * np.eye(space.dim) @ second]
    alone = run(space, law, constants, singly, COUNT, steps)
    together = run(space, law, constants, by_eights, -(-COUNT // EIGHT), steps)
    yielded = 0
    for one, eight in zip(alone, together, strict=True):
        # stresses, energies, moduli; in 1-D and 2-D the latter are each particle's own, by roots of differences
        compared = 5 if space.dim == 3 else 4
        for of_one, of_eight in zip(one[:compared], eight[:compared], strict=True):
            np.testing.assert_allclose(of_eight, of_one, rtol=0.0, atol=200.0 * eps * KAPPA)
        np.testing.assert_allclose(eight[5][:, :7], one[5][:, :7], rtol=0.0, atol=200.0 * eps)
        yielded += int((one[3] > 0.0).sum())
    assert yielded > COUNT // 2 and (alone[0][3] == 0.0).sum() > 10


@pytest.mark.parametrize("real", [wp.float32, wp.float64])
def test_stress_and_energy_are_those_of_eigenvectors(real):
    """To round-off of strains of one, before matter yields."""
    space = Space(3, real)
    material, eps = J2(**COPPER, hardening=HARDENINGS["perfect"]), np.finfo(space.numpy).eps
    law = material.law(space)
    F = gradients(space, 3).astype(space.numpy).astype(float)
    constants, kernels = material.filled_constants(law), make_both(space, law)
    values, vectors = np.linalg.eigh(F @ F.swapaxes(1, 2))
    e, J = 0.5 * np.log(values), np.linalg.det(F)
    dev = e - e.mean(axis=1, keepdims=True)
    size = np.linalg.norm(dev, axis=1)
    elastic = np.sqrt(6.0) * MU * size < 0.4e9
    assert 10 < elastic.sum() < COUNT
    tau = (vectors * (2.0 * MU * dev + KAPPA * np.log(J)[:, None])[:, None, :]) @ vectors.swapaxes(1, 2)
    exact, stored = tau @ np.linalg.inv(F).swapaxes(1, 2), 0.5 * KAPPA * np.log(J) ** 2 + MU * size**2
    for kernel, threads in zip(kernels, (COUNT, -(-COUNT // EIGHT)), strict=True):
        _, P, W, lost, _, _ = run(space, law, constants, kernel, threads, [F])[0]
        assert (lost[elastic] == 0.0).all() and (lost[~elastic] > 0.0).all()
        np.testing.assert_allclose(P[elastic], exact[elastic], rtol=0.0, atol=20.0 * eps * KAPPA)
        np.testing.assert_allclose(W[elastic], stored[elastic], rtol=0.0, atol=20.0 * eps * KAPPA * size.max())


@pytest.mark.parametrize("reference", [es.Never(), es.Always()])
def test_steps_keep_every_bit_and_are_those_of_portable_kernels(reference):
    """With threads, whose ranges of blocks are others, and as graphs; the last of 17³ is a block of its own."""
    x, volume = box((0.0,) * 3, (1.0,) * 3, 1.0 / 17)
    velocity = 100.0 * np.stack([x[:, 1], np.sin(3.0 * x[:, 0]), 0.0 * x[:, 0]], axis=1)
    found = []
    for threads, graphs, simd in ((1, False, True), (2, False, True), (1, True, True), (1, False, False)):
        execution.set_threads(threads)
        execution.set_graphs(graphs)
        execution.set_simd(simd)
        material = J2(**COPPER, hardening=HARDENINGS["linear"])
        body = es.Body(x=x, volume=volume, spacing=1.0 / 17, material=material, velocity=velocity)
        simulation = es.Simulation(body, reference=reference, time_step=es.TimeStep(fixed=2e-6))
        simulation.step(20)
        found.append([simulation.x, simulation.history("plastic_strain"), simulation.history("plastic_metric")])
    first, *same, portable = ([array.copy() for array in each] for each in found)
    assert 100 < (first[1] > 0.0).sum() < len(x)
    for other in same:
        assert all(np.array_equal(a, b) for a, b in zip(first, other, strict=True))
    for a, b in zip(first, portable, strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-11)
