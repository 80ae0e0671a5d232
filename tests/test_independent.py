"""Bodies that are runs of their own: each as it is alone, to the last bit, and one that fails ends alone."""

import dataclasses
import json
import logging
import re

import numpy as np
import pytest
import warp as wp
from bodies import RUBBER, block
from clouds import cloud
from kept_runs import StopAfter

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.boundaries import Bound, Boundary
from warp_eulsph.materials import J2, Failing, LinearHardening, PrincipalStrain
from warp_eulsph.output import Recording, Run, record
from warp_eulsph.schedule import EveryTime
from warp_eulsph.settling import residual

SIDE, RUNS = {1: 20, 2: 6, 3: 4}, 3
FOLLOWING = [es.Never(), es.Every(3), es.Always()]
MOVING = {"arrangement": es.Current(), "reference": es.Always()}
WATER = es.TaitLiquid(density=1000.0, sound_speed=20.0)
METAL = J2(density=7800.0, young=2e11, poisson=0.3, hardening=LinearHardening(yield_stress=2e8, modulus=1e9))


@wp.func
def swing(x: wp.vec2d, t: wp.float64) -> wp.vec2d:
    return wp.vec2d(wp.float64(4e3) * wp.sin(wp.float64(900.0) * t), x[0])


@wp.func
def swing_slowly(x: wp.vec2d, t: wp.float64) -> wp.vec2d:
    return wp.vec2d(wp.sin(wp.float64(700.0) * t), x[0] * t)


@wp.func
def blow(x: wp.vec2d, t: wp.float64) -> wp.vec2d:
    f = wp.vec2d()
    if x[0] > wp.float64(1.8) and x[0] < wp.float64(3.2) and t > wp.float64(2.5e-3):
        f[0] = wp.float64(1e308) * wp.float64(1e308)
    return f


def run(k, dim=2, material=RUBBER, speed=8.0, name=None, **options):
    """Body number ``k``: stiffer than the one before, and somewhere else."""
    x, volume = cloud(dim, SIDE[dim], jitter=0.1)
    x[:, 0] += 2.0 * k
    stiffer = {
        name: (1.0 + 0.3 * k) ** p * getattr(material, name)
        for name, p in (("young", 1), ("sound_speed", 0.5))
        if hasattr(material, name)
    }
    velocity = speed * np.random.default_rng(k).normal(size=x.shape)
    material = dataclasses.replace(material, **stiffer)
    return es.Body(x=x, volume=volume, material=material, velocity=velocity, name=name or f"run {k}", **options)


def sides(**options):
    return [es.Fixed(lambda X: X[:, 0] % 2.0 < 0.2), es.BodyForce(swing)]


def compare(bodies, times=(0.2, 0.31, 0.5), loads=(), unit=0.01, **options):
    """Every run of a simulation of all bodies against itself alone, at the end and on the way there."""
    times = [unit * time for time in times]
    together = es.Simulation([body for own in bodies for body in own], boundaries=loads, independent=True, **options)
    list(together.frames(times))
    energy, p, steps = together.runs.energy(), together.runs.momentum(), together.runs.steps
    assert len(set(steps)) > 1, "all had the same steps: nothing waited"
    for k, own in enumerate(bodies):
        alone = es.Simulation(own, boundaries=loads, **options)
        list(alone.frames(times))
        here = together.runs.ranges[k]
        for name in ("x", "v", "F"):
            assert np.array_equal(getattr(together, name)[here], getattr(alone, name)), name
        assert (alone.steps, alone.t, alone.clock.free_dt) == (steps[k], times[-1], together.runs.dt[k])
        assert alone.energy() == {name: energy[name][k] for name in energy}
        assert np.array_equal(alone.momentum(), p[k])
    return together


@pytest.mark.parametrize("graphs", [False, True])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("reference", FOLLOWING, ids=repr)
def test_each_has_the_bits_that_it_has_alone(dim, dtype, reference, graphs):
    execution.set_graphs(graphs)
    compare([[run(k, dim)] for k in range(RUNS)], reference=reference, arrangement=es.Current(), dtype=dtype)


SCHEMES = {
    "sensor": es.Verlet(dissipation=es.Upwind(sensor=es.PaperSensor())),
    "limited": es.Verlet(limiter=es.FluxCorrectedTransport()),
    "shifting": es.Verlet(shifting=es.Shifting()),
    "Lax-Wendroff": es.LaxWendroff(smoothing=es.LinearExact()),
    "pair areas": es.LaxWendroff(correction=es.PairAreas()),
    "surface vectors": es.Verlet(correction=es.SurfaceVectors(project=True)),
    "plain volume": es.Verlet(correction=es.PlainVolume()),
    "Lax": es.Lax(),
}


@pytest.mark.parametrize("reference", FOLLOWING[1:], ids=repr)
@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_schemes(scheme, reference):
    compare([[run(k)] for k in range(RUNS)], scheme=scheme, reference=reference, arrangement=es.Current())


@pytest.mark.parametrize("reference", FOLLOWING, ids=repr)
def test_conditions_by_the_clock_of_each(reference):
    compare([[run(k)] for k in range(RUNS)], loads=sides(), reference=reference, arrangement=es.Current())


@pytest.mark.parametrize("simd", [False, True])
def test_liquids(simd):
    execution.set_simd(simd)
    compare([[run(k, material=WATER, speed=0.3)] for k in range(RUNS)], unit=0.1)


@pytest.mark.parametrize("simd", [False, True])
@pytest.mark.parametrize("options", [{}, MOVING], ids=["total Lagrangian", "Eulerian"])
def test_yielding_eight_at_once_and_one_by_one(options, simd):
    execution.set_simd(simd)
    compare([[run(k, material=METAL, speed=300.0)] for k in range(RUNS)], unit=1e-3, **options)


def test_eight_at_once_of_one_law():
    """Bodies of equal constants do not share blocks either: steps differ."""
    bodies = [run(0, material=METAL, speed=300.0 * (1 + k), name=f"{k}") for k in range(RUNS)]
    compare([[body] for body in bodies], unit=3e-4)


def test_runs_of_several_media():
    """Elastic, liquid and yielding, each by the options that suit it, and two of one medium."""
    metal = {"material": METAL, "speed": 3.0}
    bodies = [run(0), run(1, material=WATER, speed=0.3), run(2, **metal), run(3, **metal)]
    together = compare([[body] for body in bodies], unit=2e-4)
    assert len(together.stepper.media) == 3


@pytest.mark.parametrize("options", [{}, {"material": METAL, "speed": 300.0}], ids=["rubber", "metal"])
def test_bonded_bodies_are_one_run(options):
    pairs = []
    for k in range(RUNS):
        one = run(k, **options)
        other = dataclasses.replace(one, x=one.x + np.array([0.0, 1.0]), name=f"bonded {k}", bonded=one.name)
        pairs.append([one, other])
    together = compare(pairs, unit=1e-3 if options else 0.01)
    assert together.runs.bodies[2] == ("run 2", "bonded 2") and len(together.runs) == RUNS


def test_held_and_breaking_bodies():
    """Planes that hold, mirrors, damping by a rate, and matter that lets go."""
    glass = Failing(material=RUBBER, failure=PrincipalStrain(energy=10.0, strain=0.05))
    loads = [es.Clamped((0.0, 0.0), (0.0, -1.0)), es.Damping(rate=50.0), es.Traction(swing, (0.0, 1.0))]
    compare([[run(k, material=glass)] for k in range(RUNS)], loads=loads)


def test_imposed_velocities_and_a_damping_that_follows_one():
    slope = es.Roller(lambda X: X[:, 1] < 0.2, normal=(0.6, 0.8))
    driven = es.Velocity(lambda X: X[:, 1] > 0.8, value=swing_slowly)
    bodies = [run(k) for k in range(RUNS)]
    loads = [slope, driven]
    compare([[body] for body in bodies], loads=loads)
    damped = [*loads, es.Damping(body="run 1")]
    together = es.Simulation(bodies, boundaries=damped, independent=True)
    alone = es.Simulation(bodies[1], boundaries=damped)
    for simulation in (together, alone):
        list(simulation.frames([0.002, 0.005]))
    assert np.array_equal(together.x[together.runs.ranges[1]], alone.x)


@pytest.mark.of_the_cpu
def test_threads_keep_every_bit():
    found = []
    for threads in (1, 3):
        execution.set_threads(threads)
        execution.set_graphs(False)
        bodies = [
            dataclasses.replace(
                block(2, 40, jitter=0.1, seed=k),
                name=f"{k}",
                x=block(2, 40).x + np.array([2.0 * k, 0.0]),
                velocity=np.random.default_rng(k).normal(size=(1600, 2)),
            )
            for k in range(4)
        ]
        simulation = es.Simulation(bodies, independent=True, **MOVING)
        simulation.step(3)
        found.append((simulation.x.tobytes(), *[energy.tobytes() for energy in simulation.runs.energy().values()]))
    assert found[0] == found[1]


#: Number 1 is not finite any more soon after 2.5 ms.
BLOW = [es.BodyForce(blow)]


@pytest.mark.parametrize("graphs", [False, True])
@pytest.mark.parametrize("reference", [es.Never(), es.Always()], ids=repr)
def test_one_that_fails_ends_alone(reference, graphs, caplog):
    execution.set_graphs(graphs)
    options = {"reference": reference, "arrangement": es.Current(), "boundaries": BLOW}
    alone = es.Simulation(run(1), **options)
    with pytest.raises(es.UnstableError) as failed:
        alone.run(until=0.02)
    together = es.Simulation([run(k) for k in range(RUNS)], independent=True, **options)
    with caplog.at_level(logging.WARNING):
        together.run(until=0.02)
    error = together.runs.failures[1]
    assert together.runs.failures[0] is together.runs.failures[2] is None
    assert (error.time, error.step) == (failed.value.time, failed.value.step)
    assert error.particle == failed.value.particle + together.runs.ranges[1].start
    assert "body 'run 1'" in str(error) and str(error) in caplog.text
    assert together.runs.t.tolist() == [0.02, error.time, 0.02] and together.t == 0.02
    for k in (0, 2):
        other = es.Simulation(run(k), **options)
        other.run(until=0.02)
        assert np.array_equal(together.x[together.runs.ranges[k]], other.x)
        assert together.runs.steps[k] == other.steps
    total, energy = together.energy(), together.runs.energy()
    assert total["kinetic"] == energy["kinetic"][[0, 2]].sum() and np.isfinite(list(total.values())).all()
    assert np.isfinite(together.momentum()).all()


def test_reactions_and_equilibria_are_of_those_that_are_well():
    """An equilibrium is that of each: the largest residual of those alone."""
    loads = [es.Fixed(lambda X: X[:, 0] % 2.0 < 0.2), es.BodyForce(swing_slowly), es.Damping(rate=50.0), *BLOW]
    together = es.Simulation([run(k) for k in range(RUNS)], boundaries=loads, independent=True)
    others = [es.Simulation(run(k), boundaries=loads) for k in (0, 2)]
    for simulation in (together, *others):
        list(simulation.frames([0.006]))
        simulation.step(3)
    assert together.runs.failures[1] is not None
    assert np.isclose(together.reaction(loads[0]), sum(other.reaction(loads[0]) for other in others), rtol=1e-13).all()
    assert residual(together) == max(residual(other) for other in others)


def test_the_last_one_that_fails_is_raised():
    inside_out = [run(k, speed=600.0) for k in range(2)]
    together = es.Simulation(inside_out, independent=True, boundaries=BLOW)
    for _ in range(2):
        with pytest.raises(es.UnstableError):
            together.run(until=0.02)
    assert None not in together.runs.failures


def test_frames_and_looks_are_of_all():
    together = es.Simulation([run(k) for k in range(RUNS)], independent=True)

    class Frames(list):
        def write(self, simulation):
            self.append(simulation.runs.t)

    frames = Frames()
    together.run(until=0.004, every=0.001, output=frames)
    assert [np.unique(t).tolist() for t in frames] == [[0.0], [0.001], [0.002], [0.003], [0.004]]
    together.run(until=0.0063, every=0.001, exact=False, output=frames)
    looked = frames[6]
    assert (looked >= 0.005 - 1e-11).all() and (looked < 0.005 + together.clock.longest_dt).all()
    assert len(set(looked)) > 1 and (together.runs.t == 0.0063).all()


@pytest.mark.parametrize("reference", FOLLOWING, ids=repr)
def test_resume_is_exact(reference, tmp_path):
    """Taken up while runs have steps, times, and an end of their own."""

    def build():
        options = {"reference": reference, "arrangement": es.Current(), "boundaries": BLOW}
        return es.Simulation([run(k) for k in range(RUNS)], independent=True, **options)

    whole, first = build(), build()
    for simulation in (whole, first):
        simulation.step(9)
        list(simulation.frames([0.006]))
        simulation.step(7)
    assert first.runs.failures[1] is not None and len(set(first.runs.t)) == RUNS
    resumed = build()
    resumed.restore({name: array.numpy() for name, array in first.evolving().items()}, first.counters)
    for simulation in (whole, resumed):
        simulation.run(until=0.012)
    for name, array in whole.evolving().items():
        assert array.numpy().tobytes() == resumed.evolving()[name].numpy().tobytes(), name
    assert whole.counters == resumed.counters
    assert (resumed.runs.failures[1].time, resumed.runs.failures[1].step) == (
        whole.runs.failures[1].time,
        whole.runs.failures[1].step,
    )
    assert resumed.runs.failures[0] is None


def test_a_directory_keeps_and_resumes_them(tmp_path):
    """And says which ended, and how far each came."""

    def build():
        return es.Simulation([run(k) for k in range(RUNS)], boundaries=BLOW, independent=True)

    kept = Recording(snapshots=EveryTime(0.002), fields=["velocity", "run_time"], dtype=np.float64)
    whole, resumed = build(), build()
    record(whole, tmp_path / "whole", 0.008, kept)
    stop = StopAfter(13)
    stopped = record(build(), tmp_path / "cut", 0.008, kept, stop=stop, watch=stop.watch)
    assert stopped.stopped is not None and stopped.time < 0.008
    record(resumed, tmp_path / "cut", 0.008, kept, resume=True)
    assert np.array_equal(whole.x, resumed.x, equal_nan=True)
    assert np.array_equal(whole.runs.steps, resumed.runs.steps)
    for one, other in zip(Run(tmp_path / "whole"), Run(tmp_path / "cut"), strict=True):
        assert one.time == other.time and np.array_equal(one["velocity"], other["velocity"], equal_nan=True)
    last = Run(tmp_path / "whole")[-1]
    reached = [np.unique(last["run_time"][numbers]).tolist() for numbers in whole.runs.ranges]
    assert reached == [[0.008], [whole.runs.failures[1].time], [0.008]]
    status = json.loads((tmp_path / "whole" / "status.json").read_text())
    assert status["state"] == "done" and status["ended"] == [str(whole.runs.failures[1])]


class Blind(Boundary):
    """A condition that says nothing of clocks."""

    def bind(self, assembly):
        bound = Bound()
        bound.indices = assembly.select(None, None, "Blind")
        return bound


@pytest.mark.parametrize(
    "options, words",
    [
        ({"interactions": [es.Contact()]}, "cannot touch each other, got Contact"),
        ({"boundaries": [es.BodyForce(lambda x, t: 0.0 * x)]}, "BodyForce must know of clocks"),
        ({"boundaries": [es.Damping()]}, "Damping must know of clocks"),
        ({"boundaries": [Blind()]}, "independent = True"),
        ({"reference": es.WhenDistorted(1.1), "arrangement": es.Current()}, "reference must be Never"),
        ({"arrangement": es.Current(stop_when_torn=True)}, "stop_when_torn"),
    ],
)
def test_what_would_couple_them_is_refused(options, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        es.Simulation([run(0), run(1)], independent=True, **options)


def test_bonded_bodies_with_another_between_are_refused():
    one, other = run(0), run(1)
    third = dataclasses.replace(one, x=one.x + np.array([0.0, 1.0]), name="third", bonded="run 0")
    with pytest.raises(ValueError, match="must follow each other"):
        es.Simulation([one, other, third], independent=True)


def test_all_of_one_clock_are_one_run():
    simulation = es.Simulation([run(0), run(1)])
    simulation.step(3)
    runs = simulation.runs
    assert (len(runs), runs.bodies, runs.steps.tolist()) == (1, [("run 0", "run 1")], [3])
    assert simulation.energy() == {name: value[0] for name, value in runs.energy().items()}
