"""Steps by graphs equal steps by the host in every bit, also where the host must step in."""

import os
import subprocess
import sys

import numpy as np
import pytest
import warp as wp
from bodies import RUBBER
from clouds import cloud

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.boundaries import Bound
from warp_eulsph.operators.neighbours import NeighbourLists

SIDE = {1: 30, 2: 9, 3: 5}
REFERENCES = [es.Never(), es.Every(3), es.Always(), es.WhenDistorted(1.02)]
SCHEMES = {
    "upwind switched by a sensor": es.Verlet(dissipation=es.Upwind(sensor=es.PaperSensor())),
    "limited": es.Verlet(limiter=es.FluxCorrectedTransport()),
    "shifting": es.Verlet(shifting=es.Shifting()),
    "Lax-Wendroff, smoothed": es.LaxWendroff(smoothing=es.LinearExact()),
    "pair areas": es.LaxWendroff(correction=es.PairAreas()),
    "surface vectors": es.Verlet(correction=es.SurfaceVectors(project=True)),
    "even sweeps": es.Verlet(correction=es.Balance(sweeps=4)),
    "Lax": es.Lax(),
}


def block(dim, reference, **options):
    """A jittered block in irregular motion, whose steps are of the length that its wave speeds allow."""
    x, volume = cloud(dim, SIDE[dim], jitter=0.15)
    velocity = 8.0 * np.random.default_rng(2).normal(size=x.shape)
    body = es.Body(x=x, volume=volume, material=RUBBER, velocity=velocity, **options.pop("body", {}))
    return es.Simulation(body, reference=reference, **{"arrangement": es.Current(), **options})


def bits(simulation):
    """All that evolves, and what is made of it."""
    found = {name: array.numpy().copy() for name, array in simulation.evolving().items()}
    return found | {"steps": np.array(simulation.steps), "energy": np.array([*simulation.energy().values()])}


def both(build, drive):
    """``drive`` a simulation by the host and one by graphs, which must agree; the latter."""
    found = []
    for on in (False, True):
        execution.set_graphs(on)
        simulation = build()
        drive(simulation)
        assert simulation.by_graphs is on
        found.append(bits(simulation))
    assert found[0].keys() == found[1].keys()
    differing = [name for name in found[0] if not np.array_equal(found[0][name], found[1][name])]
    assert not differing
    assert simulation._graphs._graphs, "nothing was recorded"
    return simulation


def steps_and_frames(simulation):
    """Steps of its own length, then times to hit, in batches that end anywhere."""
    simulation.step(13)
    t, dt = simulation.t, simulation.dt
    times = [t + share * dt for share in (0.3, 2.5, 13.7, 21.0)]
    assert [simulation.t for _ in simulation.frames(times)] == times
    simulation.step(5)


@pytest.mark.parametrize("simd", [True, False])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("reference", REFERENCES, ids=repr)
def test_graphs_keep_every_bit(dim, dtype, reference, simd):
    execution.set_simd(simd)
    both(lambda: block(dim, reference, dtype=dtype), steps_and_frames)


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_graphs_keep_every_bit_of_every_scheme(scheme):
    both(lambda: block(2, es.Always(), scheme=scheme), lambda simulation: simulation.step(20))


@pytest.mark.parametrize("simd", [True, False])
def test_graphs_keep_every_bit_in_a_periodic_box(simd):
    execution.set_simd(simd)
    both(lambda: block(2, es.Always(), periodic=(1.0, 1.0), body={"surface": 0.0}), steps_and_frames)


def test_graphs_with_conditions_of_the_device():
    @wp.func
    def swing(x: wp.vec2d, t: wp.float64) -> wp.vec2d:
        return wp.vec2d(wp.float64(0.0), wp.sin(wp.float64(3e3) * t))

    def build():
        held = es.Velocity(lambda X: X[:, 0] < 0.2, swing)
        conditions = [held, es.Roller(lambda X: X[:, 1] < 0.1, normal=(0.0, -1.0)), es.BodyForce((0.0, -9.81))]
        conditions += [es.Pressure(1e4, lambda X: X[:, 0] > 0.6), es.Clamped((1.0, 0.0), (1.0, 0.0))]
        return block(2, es.Always(), boundaries=conditions)

    both(build, steps_and_frames)


class Rest(Bound):
    indices = np.zeros(1, dtype=np.int32)

    def impose(self, state, clock, fraction):
        state.v[:1].zero_()


class Resting(es.Boundary):
    """A condition of a user's own, which does not say that a graph can repeat it."""

    def bind(self, assembly):
        return Rest()


@pytest.mark.parametrize(
    "condition",
    [es.Velocity(lambda X: X[:, 0] < 0.2, lambda x, t: np.sin(t)), Resting()],
    ids=["host", "own"],
)
def test_conditions_that_need_the_host_take_steps_by_the_host(condition):
    execution.set_graphs(True)
    simulation = block(2, es.Always(), boundaries=[condition])
    assert not simulation.by_graphs
    simulation.step(3)
    with pytest.raises(ValueError, match="by_graphs must be False: a condition takes its values"):
        simulation.by_graphs = True


@pytest.mark.parametrize("simd", [True, False])
@pytest.mark.parametrize("reference", [es.Every(3), es.Always()], ids=repr)
def test_lists_that_are_full_let_the_host_step_in(reference, simd, monkeypatch):
    """Lists without spare room, in a motion that needs more of it again and again."""
    execution.set_simd(simd)
    grown = []
    renew = NeighbourLists.make_room

    def counted(lists):
        grown.append(lists.waiting)
        renew(lists)

    def drive(simulation):
        lists = simulation.stepper.configuration.lists
        simulation.step(12)
        for _ in range(10):
            lists._reserve(lists.room)  # the next step refreshes the reference, and fills them
            simulation.step(6)

    monkeypatch.setattr(NeighbourLists, "make_room", counted)
    scheme = es.Verlet(dissipation=None)
    both(lambda: block(2, reference, scheme=scheme, time_step=es.TimeStep(cfl=1.0)), drive)
    assert sum(grown) > 2


def test_box_too_small_is_refused_from_graphs_too():
    """Smoothing lengths follow the volumes until the box is too short for them."""
    for on in (False, True):
        execution.set_graphs(on)
        s = (np.arange(5) + 0.5) / 5
        body = es.Body(x=s[:, None], volume=0.2, material=RUBBER, surface=0.0)
        simulation = es.Simulation(body, periodic=(1.0,), dilation=1.2, arrangement=es.Current())
        simulation.step(5)
        simulation.stepper.particles.h.fill_(0.3)
        with pytest.raises(ValueError, match="box length along axis 0 must be at least twice the support radius"):
            simulation.step(5)


@pytest.mark.parametrize("reference", [es.Never(), es.Always()], ids=repr)
def test_a_run_that_fails_says_the_same(reference):
    messages = []
    for on in (False, True):
        execution.set_graphs(on)
        simulation = block(2, reference, scheme=es.Verlet(dissipation=None), time_step=es.TimeStep(cfl=6.0))
        with pytest.raises(es.UnstableError) as failure:
            simulation.run(1.0)
        messages.append((str(failure.value), failure.value.particle, failure.value.time, failure.value.step))
    assert messages[0] == messages[1]


def test_restored_simulations_go_on_by_graphs():
    execution.set_graphs(True)
    whole, resumed = (block(2, es.Every(4)) for _ in range(2))
    whole.step(11)
    arrays, counters = {name: array.numpy().copy() for name, array in whole.evolving().items()}, whole.counters
    resumed.step(6)
    resumed.restore(arrays, counters)
    whole.step(9)
    resumed.step(9)
    assert all(np.array_equal(value, bits(resumed)[name]) for name, value in bits(whole).items())


@pytest.mark.of_the_cpu
def test_defaults_and_bad_settings():
    execution.set_graphs(None)
    assert execution.graphs("cpu", 100) and not execution.graphs("cpu", 100_000)
    command = [sys.executable, "-c", "from warp_eulsph import execution; execution.graphs('cpu', 1)"]
    run = subprocess.run(command, env={**os.environ, "WARP_EULSPH_GRAPHS": "yes"}, capture_output=True, text=True)
    assert run.returncode != 0
    assert "WARP_EULSPH_GRAPHS must be auto, 0 or 1, got 'yes'" in run.stderr
