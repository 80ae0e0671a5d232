"""The user's object: bad input is named, output times are hit, a run that fails says where."""

import numpy as np
import pytest
import warp as wp
from bodies import RUBBER, block, lattice

import warp_eulsph as es
from warp_eulsph.scheme.reference import STEEPER


def square(n=6, velocity=0.0, name="body", shift=0.0, **changes):
    return block(2, n, **{"x": lattice(2, n) + shift, "velocity": velocity, "name": name, **changes})


def test_frames_hit_their_times_exactly():
    simulation = es.Simulation(square())
    times = [1e-4, 1.7e-4, 1e-3]
    assert [simulation.t for _ in simulation.frames(times)] == times


def test_run_writes_first_every_and_last_frame():
    class Record:
        def __init__(self):
            self.times = []

        def write(self, simulation):
            self.times.append(simulation.t)

    record = Record()
    es.Simulation(square()).run(until=1e-3, every=4e-4, output=record)
    assert record.times == [0.0, 4e-4, 8e-4, 1e-3]


def test_step_growth_is_bounded_and_cfl_met():
    simulation = es.Simulation(square(velocity=1.0), time_step=es.TimeStep(cfl=0.3, growth=1.05))
    steps = []
    for _ in range(20):
        simulation.step()
        steps.append(simulation.dt)
    ratios = np.array(steps[1:]) / np.array(steps[:-1])
    assert ratios.max() <= 1.05 * (1 + 1e-12)
    c_p = 242.1  # of this rubber
    assert steps[0] == pytest.approx(0.3 / 6 / c_p / STEEPER, rel=0.03)  # wave_moduli bounds c_p within 3 % at rest


@pytest.mark.parametrize("reference", [es.Always(), es.Never()])
@pytest.mark.parametrize("scheme", [es.Verlet(), es.LaxWendroff(), es.Lax()])
def test_strain_in_a_step_is_bounded(scheme, reference):
    body = square()
    rate = 4.0 * 242.0 * 6.0 * np.array([[0.0, 1.0], [0.0, 0.0]])  # faster than waves cross a spacing
    simulation = es.Simulation(square(velocity=body.x @ rate.T), scheme=scheme, reference=reference)
    simulation.step()
    assert simulation.dt * np.linalg.norm(rate) == pytest.approx(0.25 * simulation.stepper.clock.cfl, rel=1e-9)


def test_fixed_step_is_kept():
    simulation = es.Simulation(square(), time_step=es.TimeStep(fixed=1e-5))
    simulation.step(3)
    assert simulation.t == pytest.approx(3e-5, rel=1e-14)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"volume": 0.0}, "volume must be positive and finite, got 0.0 at particle 0"),
        ({"volume": -1.0}, "volume must be positive"),
        ({"velocity": [np.nan, 0.0]}, "velocity must be finite, got nan at particle 0"),
        ({"x": np.zeros((4, 5))}, r"x must have shape \(n, 1\), \(n, 2\) or \(n, 3\), got \(4, 5\)"),
        ({"volume": np.ones(3)}, r"volume must be a number or have shape \(36,\), got \(3,\)"),
        ({"x": np.full((4, 2), np.inf)}, "x must be finite"),
        ({"spacing": 0.0}, "spacing must be positive"),
    ],
)
def test_bad_bodies_are_named(changes, message):
    with pytest.raises(ValueError, match=message):
        square(**changes)


def test_bad_set_ups_are_named():
    body = square()
    with pytest.raises(ValueError, match="at least one body"):
        es.Simulation([])
    with pytest.raises(ValueError, match="names of bodies must differ"):
        es.Simulation([body, square()])
    line = es.Body(x=np.arange(3.0)[:, None], volume=1.0, material=RUBBER, name="line")
    with pytest.raises(ValueError, match="same dimension"):
        es.Simulation([body, line])
    with pytest.raises(ValueError, match="dilation must be positive"):
        es.Simulation(body, dilation=0.0)
    with pytest.raises(ValueError, match="region selects no particle"):
        es.Simulation(body, boundaries=[es.Fixed(lambda X: X[:, 0] > 9.0)])
    with pytest.raises(ValueError, match="body must be one of"):
        es.Simulation(body, boundaries=[es.Fixed(body="anvil")])
    with pytest.raises(ValueError, match="at least twice the support radius"):
        es.Simulation(body, periodic=(0.5, 0.0))
    with pytest.raises(ValueError, match="until must be finite"):
        es.Simulation(body).run(until=-1.0)


def test_coincident_particles_are_named():
    x = square().x.copy()
    x[7] = x[8]
    with pytest.raises(ValueError, match=r"must not coincide, got 2 .* particle 7 of body 'body'"):
        es.Simulation(square(x=x))


def test_poor_neighbourhoods_are_named():
    with pytest.raises(ValueError, match="must span all 2 directions, 36 particles lack some"):
        es.Simulation(square(), dilation=0.4)
    sheet = es.Body(x=np.c_[square().x, np.zeros(36)], volume=1e-3, spacing=1 / 6, material=RUBBER)
    with pytest.raises(ValueError, match="must span all 3 directions"):
        es.Simulation(sheet)


def test_instability_names_particle_position_time_and_last_frame():
    class Frames:
        last = None

        def write(self, simulation):
            self.last = f"frame at {simulation.t:.3g} s"

    crush = es.Velocity(lambda X: X[:, 1] > 0.8, value=[0.0, -200.0])
    simulation = es.Simulation(
        square(),
        boundaries=[es.Fixed(lambda X: X[:, 1] < 0.2), crush],
        reference=es.Never(),
        time_step=es.TimeStep(cfl=3.0),
    )
    with pytest.raises(
        es.UnstableError, match=r"particle \d+ of body 'body' at x = .*last good snapshot is frame"
    ) as caught:
        simulation.run(until=0.1, every=1e-4, output=Frames())
    assert 0.0 < caught.value.time == simulation.t < 0.1
    assert caught.value.step == simulation.steps


def test_bodies_do_not_feel_each_other():
    """Two overlapping bodies are the two bodies alone, bit for bit."""
    fast, slow = square(velocity=[3.0, 0.0], name="fast"), square(n=5, name="slow", shift=0.05)
    both, alone = es.Simulation([fast, slow]), es.Simulation(fast)
    for simulation in (both, alone):
        simulation.clock.option = es.TimeStep(fixed=1e-5)
        simulation.step(10)
    assert np.array_equal(both.x[:36], alone.x)
    assert np.array_equal(both.v[36:], np.zeros((25, 2)))


def test_bodies_of_different_materials_run_together():
    """Each body of a mixed run is that body alone, with its own law, wave speeds and energy.

    Bit for bit the liquid; alone, solids have no F_k to multiply with, which is the identity here.
    """
    laws = [
        RUBBER,
        es.SaintVenantKirchhoff(density=2700.0, young=70e9, poisson=0.33),
        es.TaitLiquid(density=1e3, sound_speed=1500.0),
    ]
    velocity = 4.0 * np.c_[square().x[:, 1], -(square().x[:, 0] ** 2)]
    bodies = [square(material=law, name=str(i), velocity=velocity) for i, law in enumerate(laws)]
    together = es.Simulation(bodies, time_step=es.TimeStep(fixed=1e-6))
    together.step(10)
    for i, body in enumerate(bodies):
        alone = es.Simulation(body, time_step=es.TimeStep(fixed=1e-6))
        alone.step(10)
        tolerance = 0.0 if body.material.flows else 1e-13
        np.testing.assert_allclose(together.F[36 * i : 36 * (i + 1)], alone.F, rtol=0, atol=tolerance)
    assert abs(together.energy()["residual"]) < 1e-12 * together.energy()["total"]


def test_extrema_are_those_of_the_fields():
    simulation = es.Simulation(square(velocity=[[3.0, 4.0]] + [[0.0, 0.0]] * 35))
    assert simulation.extrema() == {"least J": 1.0, "largest J": 1.0, "speed": 5.0, "mismatch": 0.0}
    simulation.step(5)
    J, speed = np.linalg.det(simulation.F), np.linalg.norm(simulation.v, axis=1)
    expected = {"least J": J.min(), "largest J": J.max(), "speed": speed.max(), "mismatch": simulation.mismatch.max()}
    assert simulation.extrema() == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
def test_runs_are_bit_reproducible(dtype):
    def final():
        simulation = es.Simulation(square(velocity=np.random.default_rng(1).normal(size=(36, 2))), dtype=dtype)
        simulation.step(20)
        return simulation

    first, second = final(), final()
    assert np.array_equal(first.F, second.F)
    assert first.energy() == second.energy()


def test_float32_stays_near_float64():
    """Round-off of 6e-8 grows with the 100 steps' sums, not with the solution: 1e-5 of the speed scale."""
    results = []
    for dtype in (wp.float32, wp.float64):
        x = square(n=8).x - 0.5
        simulation = es.Simulation(square(n=8, velocity=60.0 * np.c_[-x[:, 1], x[:, 0]]), dtype=dtype)
        simulation.clock.option = es.TimeStep(fixed=1e-4)
        simulation.step(100)
        results.append(simulation)
    single, double = results
    assert np.abs(single.x - double.x).max() < 1e-5
    assert np.abs(single.v - double.v).max() < 60.0 * 1e-5 * 5
    assert abs(single.energy()["residual"]) < 1e-5 * single.energy()["total"]


def test_a_run_whose_steps_vanish_ends_with_a_message():
    """One particle so flat that its waves ask for steps a millionth as long: an error instead of a run without end."""
    simulation = es.Simulation(square(), reference=es.Never(), scheme=es.Verlet(dissipation=None))
    simulation.step(2)
    F = simulation.F
    F[7] *= 1e-8
    simulation.stepper.U.F.assign(F)
    with pytest.raises(es.UnstableError, match=r"particle 7 .*time step fell to .*try a smaller cfl"):
        simulation.step(2)
