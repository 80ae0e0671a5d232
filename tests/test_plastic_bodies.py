"""J2 plasticity of bodies: the books, every reference, snapshots, a tie that yields, shear without end."""

import dataclasses
import functools
import math

import numpy as np
import pytest
import warp as wp
from bodies import RUBBER
from points import COPPER, HARDENINGS, KAPPA, MU

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.geometry import box
from warp_eulsph.materials import J2, Hardening, LinearHardening


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
    simulation = block(dim, reference, dtype, HARDENINGS["johnson_cook"], scheme=es.Verlet(tie=None))
    simulation.run(8e-6)
    energy, start = simulation.energy(), simulation.stepper.ledger.start
    work = float((simulation.history("plastic_work") * simulation.particles.V0.numpy()).sum())
    eps = float(np.finfo(simulation.space.numpy).eps)
    assert energy["material"] == pytest.approx(-work, rel=1e3 * eps)
    assert work > 0.3 * start and abs(energy["residual"]) < 100 * eps * start
    assert abs(energy["stepping"]) < 0.03 * start
    assert simulation.history("temperature").min() > 293.0


def tied_by_pairs(simulation, secant):
    """¼ Σ Σ χ Ē V_a w_ab √(s_a s_b) |r_ab|² [J] of secants s, in numpy."""
    reference, lists, near = (
        simulation.configuration.fields,
        simulation.configuration.lists,
        simulation.configuration.near,
    )
    X, V, w, own = reference.x.numpy(), reference.V.numpy(), lists.of_pairs(near.w), lists.of_pairs(near.own)
    w, x, F, root = w + np.abs(w - own), simulation.x, simulation.F, np.sqrt(secant)
    a, b = np.repeat(np.arange(len(X)), lists.lengths), lists.of_pairs(near.index)
    r = x[b] - x[a] - 0.5 * np.einsum("nij,nj->ni", F[a] + F[b], X[b] - X[a])
    [(M, mu)] = simulation.stepper.flux.moduli()
    return 0.25 * 0.5 * min(M, 4.0 * mu) * (V[a] * w * root[a] * root[b] * (r**2).sum(axis=1)).sum()


@pytest.mark.parametrize("simd", [True, False])
def test_the_tie_yields_and_its_books_close(simd):
    """It holds its pair energy by y/(y + 3μ α); what it lost is the material's, with the plastic work; all adds up."""
    execution.set_simd(simd)
    simulation = block(2, es.Never(), hardening=HARDENINGS["linear"], time_step=es.TimeStep(cfl=0.1))
    simulation.step(800)
    energy, start, alpha = simulation.energy(), simulation.stepper.ledger.start, simulation.history("plastic_strain")
    y = 0.4e9 + 0.1e9 * alpha
    secant = y / (y + 3.0 * MU * alpha)
    held, work = tied_by_pairs(simulation, secant), float((simulation.history("plastic_work") * 1e-4 / 64).sum())
    lost = -energy["material"] - work
    assert secant.min() < 0.1 and 0.0 < held < 0.1 * tied_by_pairs(simulation, np.ones(64))
    assert energy["tied"] == pytest.approx(held, abs=0.02 * lost)  # of first order in the step: 12 % by cfl=0.8
    assert 0.0 < lost < 0.1 * work and abs(energy["residual"]) < 1e-12 * start
    held = {name: np.array(array.numpy()) for name, array in simulation.evolving().items()}
    counters = simulation.counters
    simulation.step(5)
    ahead = simulation.x
    simulation.restore(held, counters)
    simulation.step(5)
    assert np.array_equal(simulation.x, ahead)


@pytest.mark.parametrize("dim", [2, 3])
def test_every_reference_gives_the_same_answer(dim):
    """The arrangement read anew each step, each tenth, and never, without what fixed ones have."""
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


def test_shear_without_end_needs_no_surface_vectors():
    """20² particles to a shear of 10: mean and rms within 1 % of the yield stress."""
    simulation, free = plates(20, arrangement=es.Current(), scheme=es.Verlet(shifting=es.Shifting()))
    simulation.run(1.0)
    tau = simulation.cauchy_stress[free, 0, 1] / (1e4 / math.sqrt(3.0))
    assert abs(tau.mean() - 1.0) < 0.01 and tau.std() < 0.01


@wp.func
def apart(X: wp.vec2d, t: wp.float64) -> wp.vec2d:
    way = wp.where(t < wp.float64(0.1), wp.float64(5.0) * t * t, t - wp.float64(0.05))
    return wp.vec2d(way * wp.sign(X[0] - wp.float64(0.5)), wp.float64(0.0))


@functools.cache
def without_secant(law):
    return law._replace(secant=None)


class Stiff(J2):
    """The same, tied by its elastic moduli."""

    def law(self, space):
        return without_secant(super().law(space))


def test_a_pulled_block_holds_and_its_tie_yields():
    """Jittered, 12², to twice its length in plane strain: load, and what the tie holds, over the work."""
    found = []
    for material, tie in ((J2, None), (J2, es.Tie()), (Stiff, es.Tie())):
        x, volume = box((0.0, 0.0), (1.0, 1.0), 1.0 / 12, jitter=0.1)
        rows = np.arange(144) // 12
        law = material(density=1e3, young=1e6, poisson=0.3, hardening=LinearHardening(yield_stress=1e4, modulus=2e3))
        held = [es.Motion(apart, rows < 2), es.Motion(apart, rows >= 10)]
        body = es.Body(x=x, volume=volume, material=law)
        simulation = es.Simulation(body, boundaries=held, reference=es.Never(), scheme=es.Verlet(tie=tie))
        simulation.run(0.55)
        energy = simulation.energy()
        work = energy["constraint"]
        found.append((simulation.reaction(held[1])[0], energy["tied"] / work, simulation.mismatch.max()))
        assert abs(energy["residual"]) < 1e-12 * work and abs(energy["stepping"]) < 1e-3 * work
    free, tied, stiff = found
    assert tied[0] == pytest.approx(free[0], rel=0.08) and tied[2] < 0.9 * free[2]
    assert tied[1] < 0.04 and stiff[1] > 0.2 and stiff[0] > 1.8 * free[0]


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


def test_it_is_named_in_the_second_medium_too():
    metal = block(2, es.Always(), hardening=Falling()).bodies[0]
    rubber = es.Body(x=metal.x + 10.0, volume=metal.volume, material=RUBBER, dilation=1.2, name="before it")
    simulation = es.Simulation([rubber, metal])
    assert len(simulation.stepper.media) == 2
    with pytest.raises(es.UnstableError, match=r"of body 'body' at x = .*no state that its material") as failed:
        simulation.run(1e-5)
    assert failed.value.particle >= len(rubber.x)
