"""Particles change places in memory, and nothing that a user sees does, but by round-off."""

import logging
import sys

import numpy as np
import pytest
import warp as wp
from bodies import RUBBER, bits
from clouds import cloud
from kept_runs import StopAfter, contents, killed_until_done
from test_materials import Remembering
from test_resume import REFERENCES, SCHEMES

import warp_eulsph as es
from warp_eulsph import boundaries, execution, sorting
from warp_eulsph.boundaries import Bound
from warp_eulsph.output import PointProbe, ReactionProbe, Recording, Run, SectionProbe, record
from warp_eulsph.output.checkpoint import take
from warp_eulsph.output.stress import cauchy_stress
from warp_eulsph.schedule import EverySteps

SIDE = {1: 20, 2: 8, 3: 6}
# Wave speeds hold roots of eigenvalues, of which equal ones lose half of the digits: in M9, M13 and time steps.
ROUND_OFF = {wp.float32: 1e-3, wp.float64: 1e-7}


def two_blocks(dim=2, *, order=None, conditions=None, material=RUBBER, **options):
    """Jittered blocks side by side in irregular motion, the first held and driven; particles come in ``order``,
    (particles of a block,)."""
    x, volume = cloud(dim, SIDE[dim], jitter=0.1)
    volume = volume * (1.0 + 0.1 * x[:, 0])
    velocity = 30.0 * np.sin(3.0 * x + np.roll(x, 1, axis=1))
    order = np.arange(len(x)) if order is None else order
    bodies = [
        es.Body(x=(x + shift)[order], volume=volume[order], material=law, velocity=velocity[order], name=name)
        for name, shift, law in (("held", 0.0, RUBBER), ("free", 3.0, material))
    ]
    if conditions is None:
        conditions = [es.Fixed(lambda X: X[:, 0] < 0.2), es.Velocity(lambda X: X[:, 0] > 3.8, lambda x, t: 1e3 * t)]
    options = {"time_step": es.TimeStep(fixed=1e-4), "arrangement": es.Current(), **options}
    return es.Simulation(bodies, boundaries=conditions, **options)


def shuffle(simulation, seed=0):
    """Move all particles to other places, each body within its range."""
    rng = np.random.default_rng(seed)
    places = [rng.permutation(np.arange(body.start, body.stop)) for body in simulation.ranges.values()]
    simulation.sorting.permute(np.concatenate(places))
    return simulation


def seen(simulation):
    """What a user sees of it."""
    reactions = [b for b in simulation.boundaries if isinstance(b, (es.Fixed, es.Velocity, es.Motion, es.Roller))]
    return {
        "x": simulation.x,
        "v": simulation.v,
        "F": simulation.F,
        "J": simulation.J,
        "stress": cauchy_stress(simulation),
        "energy": np.array([*simulation.energy().values()]),
        "reaction": np.array([simulation.reaction(boundary) for boundary in reactions]),
        "t": np.array([simulation.t]),
    }


def assert_alike(found, expected, tolerance=ROUND_OFF[wp.float64]):
    """Equal up to a share of the largest value."""
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        scale = np.abs(values).max(initial=1e-300)
        np.testing.assert_allclose(found[name], values, rtol=0.0, atol=tolerance * scale, err_msg=name)


def undisturbed_and_shuffled(build, tolerance=ROUND_OFF[wp.float64]):
    """A run that stays in its order and one that is shuffled at the start and on the way are the same."""
    whole, mixed = build(sort=False), shuffle(build(sort=False))
    for steps, seed in ((3, 1), (4, 2), (5, 3)):
        whole.step(steps)
        mixed.step(steps)
        assert_alike(seen(mixed), seen(whole), tolerance)
        shuffle(mixed, seed)
        assert_alike(seen(mixed), seen(whole), tolerance)
    assert not np.array_equal(mixed.stepper.U.x.numpy(), mixed.x)
    return whole, mixed


@pytest.mark.parametrize("reference", REFERENCES, ids=repr)
@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_places_change_nothing_in_any_scheme(scheme, reference):
    undisturbed_and_shuffled(lambda **options: two_blocks(scheme=scheme, reference=reference, **options))


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("reference", REFERENCES, ids=repr)
def test_places_change_nothing_in_any_dimension(reference, dim, dtype):
    def build(**options):
        return two_blocks(dim, reference=reference, dtype=dtype, **options)

    undisturbed_and_shuffled(build, ROUND_OFF[dtype])


def test_places_change_nothing_for_portable_kernels(monkeypatch):
    monkeypatch.setattr(execution, "_simd", False)
    undisturbed_and_shuffled(lambda **options: two_blocks(3, **options))


def test_places_change_nothing_in_a_periodic_box():
    x, volume = cloud(2, 8, jitter=0.1)
    body = es.Body(x=x, volume=volume, material=RUBBER, velocity=20.0 * np.sin(2 * np.pi * x), surface=0.0)
    undisturbed_and_shuffled(lambda **options: es.Simulation(body, periodic=(1.0, 1.0), **options))


def test_periodic_images_are_sorted_into_the_box():
    x, volume = cloud(2, 8, jitter=0.1)
    body = es.Body(x=x[np.random.default_rng(0).permutation(64)], volume=volume, material=RUBBER, surface=0.0)
    simulation = es.Simulation(body, periodic=(1.0, 1.0), sort=False)
    places, reference = simulation.sorting.sorted_places(), simulation.configuration.fields
    reference.x.assign(reference.x.numpy() + np.random.default_rng(1).integers(-2, 3, (64, 2)))
    assert np.array_equal(simulation.sorting.sorted_places(), places)


def test_histories_of_materials_change_places():
    material = Remembering(density=1100.0, young=17e6, poisson=0.45)
    whole, mixed = undisturbed_and_shuffled(lambda **options: two_blocks(material=material, **options))
    history, kept = (simulation.stepper.flux.parts[1].history.numpy() for simulation in (mixed, whole))
    places = mixed.order.places[64:] - 64
    assert np.ptp(kept) > 1e-4 and not np.allclose(history, kept)
    np.testing.assert_allclose(history[places], kept, atol=1e-9)


@wp.func
def swing(x: wp.vec2d, t: wp.float64) -> wp.vec2d:
    return wp.vec2d(x[1], x[0]) * (wp.float64(0.1) * wp.sin(wp.float64(1e3) * t))


@wp.func
def push(x: wp.vec2d, t: wp.float64) -> wp.vec2d:
    return wp.vec2d(x[1], x[0]) * wp.float64(1e5)


def each(k):
    """A value of its own for each of k particles."""
    return np.random.default_rng(5).uniform(0.5, 1.0, (k, 2))


LEFT, TOP = np.arange(16), np.flatnonzero(np.arange(64) % 8 > 4)
CONDITIONS = {
    "Fixed": es.Fixed(LEFT, axes=[0]),
    "Velocity of each": es.Velocity(LEFT, 20.0 * each(16)),
    "Velocity on the device": es.Velocity(LEFT, swing),
    "Velocity on the host": es.Velocity(LEFT, lambda x, t: np.c_[x[:, 1] * np.sin(3e3 * t), x[:, 0]]),
    "Motion on the device": es.Motion(swing, LEFT),
    "Motion on the host": es.Motion(lambda X, t: 1e2 * t * X, LEFT),
    "BodyForce of each": es.BodyForce(1e5 * each(128)),
    "BodyForce by present positions": es.BodyForce(lambda x, t: 1e5 * x[:, ::-1], TOP),
    "BodyForce by initial positions": es.BodyForce(lambda X, t: 1e5 * X[:, ::-1], TOP, material=True),
    "BodyForce by initial positions on the device": es.BodyForce(push, TOP, material=True),
    "Clamped": es.Clamped((0.0, 0.0), (-1.0, 0.0)),
    "Damping": es.Damping(body="free"),
    "Gravity": es.Gravity(1e4, body="free"),
    "Pressure": es.Pressure(1e6, body="free"),
    "Pressure on a face": es.Pressure(lambda x, t: 1e6 * x[:, 0], TOP, normal=(0.0, 1.0)),
    "Traction": es.Traction(1e6 * each(len(TOP)), (0.0, 1.0), TOP),
    "Roller": es.Roller(LEFT, (1.0, 0.5)),
}


@pytest.mark.parametrize("condition", CONDITIONS.values(), ids=CONDITIONS)
def test_conditions_follow_their_particles(condition):
    undisturbed_and_shuffled(lambda **options: two_blocks(conditions=[condition], **options))


@pytest.mark.parametrize("image", [es.Wall(), es.Antisymmetry()], ids=repr)
def test_mirror_ghosts_follow_their_particles(image):
    x, volume = cloud(2, 8, jitter=0.1)
    law = es.LinearElastic(density=1100.0, young=17e6, poisson=0.3)
    body = es.Body(x=x, volume=volume, material=law, velocity=np.sin(3.0 * x))
    mirrored, ghosts = es.mirror(body, point=(1.0, 0.0), normal=(1.0, 0.0), depth=0.6, image=image)
    undisturbed_and_shuffled(lambda **options: es.Simulation(mirrored, boundaries=[ghosts], **options))


def test_no_condition_was_forgotten():
    kinds = {kind for kind in vars(boundaries).values() if isinstance(kind, type) and issubclass(kind, es.Boundary)}
    tested = {type(condition) for condition in CONDITIONS.values()} | {es.MirrorGhosts}
    assert kinds - {es.Boundary} == tested


class Shaken(es.Boundary):
    """A condition of a user's own, which finds its particles by numbers of its own."""

    def bind(self, assembly):
        return BoundShaken(assembly)


class BoundShaken(Bound):
    def __init__(self, assembly):
        self.indices = assembly.select(lambda X: X[:, 0] < 0.2, None, "Shaken")

    def impose(self, state, clock, fraction):
        v = state.v.numpy()
        v[self.indices] = (0.0, 1.0)
        state.v.assign(v)


def test_conditions_that_do_not_say_so_keep_particles_where_they_are(caplog):
    order = np.random.default_rng(0).permutation(64)
    with caplog.at_level(logging.INFO, logger="warp_eulsph.sorting"):
        simulation = two_blocks(order=order, conditions=[Shaken()])
    assert "not sorted in memory: a condition or interaction does not say that it is sortable" in caplog.text
    assert simulation.sorting.parted() > 0.4 and np.array_equal(simulation.order.places, np.arange(128))
    plain = two_blocks(conditions=[Shaken()])
    simulation.step(5)
    plain.step(5)
    np.testing.assert_allclose(simulation.x[:64], plain.x[order], atol=1e-12)


def test_shuffled_bodies_are_sorted_and_move_as_they_would(tmp_path):
    """Snapshots, log and probes too."""
    order = np.random.default_rng(0).permutation(216)
    runs = {}
    for name, options in (("given", {}), ("shuffled", {"order": order}), ("left", {"order": order, "sort": False})):
        simulation = two_blocks(3, time_step=es.TimeStep(), **options)
        probes = [
            PointProbe(name="point", X=(3.4, 3.6, 3.5), body="free"),
            SectionProbe(name="section", point=(0.5, 0.5, 0.5), normal=(1.0, 0.3, 0.0)),
            ReactionProbe(name="reaction", boundary=simulation.boundaries[0]),
        ]
        region = order.argsort()[:40] if options else np.arange(40)
        recording = Recording(snapshots=EverySteps(2), probes=probes, dtype=np.float64, region=region, body="held")
        record(simulation, tmp_path / name, 3e-3, recording)
        runs[name] = simulation, Run(tmp_path / name)
    assert np.array_equal(runs["given"][0].order.places, np.arange(432))
    assert np.array_equal(runs["left"][0].order.places, np.arange(432))
    assert runs["shuffled"][0].sorting.parted() < 0.5 * runs["left"][0].sorting.parted()
    back = np.r_[order, 216 + order].argsort()
    assert_alike({"x": runs["shuffled"][0].x[back]}, {"x": runs["given"][0].x})
    for name in ("given", "left"):  # of the same particles
        kept, other = runs["shuffled"][1], runs[name][1]
        for probe in ("point", "section", "reaction"):
            columns = other.probes[probe]
            assert_alike({k: kept.probes[probe][k] for k in columns}, dict(columns))
        assert len(kept) == len(other) > 4
        for frame, expected in zip(kept, other, strict=True):
            numbers = frame.field("particle")
            rows = np.arange(40) if name == "left" else np.argsort(order[numbers])
            for field in other.fields:
                if field != "particle":
                    assert_alike({field: frame.field(field)[rows]}, {field: expected.field(field)})


def sorted_often(monkeypatch):
    """Sort at every look, and look every five steps."""
    monkeypatch.setattr(sorting, "STEPS_BETWEEN_SORTS", 5)
    monkeypatch.setattr(sorting, "MOST_PARTED", -1.0)
    monkeypatch.setattr(sorting, "MUCH_MORE", 0.0)


def unsorted_blocks(reference=es.Always(), conditions=None, **options):
    """Blocks that lie shuffled in memory until the first look after the start."""
    return shuffle(two_blocks(reference=reference, conditions=conditions, **options))


@pytest.mark.parametrize("reference", REFERENCES[1:], ids=repr)
def test_resume_is_bitwise_across_sorts(reference, monkeypatch):
    sorted_often(monkeypatch)
    whole = unsorted_blocks(reference)
    expected, stored = {}, {}
    for step in range(1, 15):
        whole.step()
        stored[step], expected[step] = take(whole, {}, {}), bits(whole)
    assert not np.array_equal(stored[4].arrays["Order.ids"], stored[5].arrays["Order.ids"])
    for step in (3, 4, 5, 6, 11):
        resumed = two_blocks(reference=reference)  # in another order than where it goes on
        resumed.restore(stored[step].arrays, stored[step].counters)
        resumed.step(14 - step)
        assert bits(resumed) == expected[14]


def test_bad_ids_are_refused(monkeypatch):
    simulation = shuffle(two_blocks())
    x, places = simulation.x, simulation.order.places.copy()
    stored = take(simulation, {}, {})
    ids = stored.arrays["Order.ids"].copy()
    ids[0] = ids[1]
    with pytest.raises(ValueError, match="ids must hold each number from 0 to 127 once"):
        simulation.restore({**stored.arrays, "Order.ids": ids}, stored.counters)
    assert np.array_equal(simulation.x, x) and np.array_equal(simulation.order.places, places)


def kept(directory, until=1e-2, **options):
    """Record blocks that are sorted on the way."""
    simulation = unsorted_blocks()
    probe = PointProbe(name="point", X=(0.5, 0.5))
    recording = Recording(snapshots=EverySteps(7), probes=[probe], checkpoint=0.02)
    return record(simulation, directory, until, recording, **options)


@pytest.mark.of_the_cpu
@pytest.mark.skipif(sys.platform == "win32", reason="no fork")
def test_stops_and_kills_between_sorts_leave_no_trace(tmp_path, monkeypatch):
    sorted_often(monkeypatch)
    whole = kept(tmp_path / "whole")
    assert whole.step > 30
    for step in (4, 5, 6, 17):
        stop = StopAfter(step)
        outcome = kept(tmp_path / "stopped", stop=stop, watch=stop.watch, replace=True)
        assert outcome.stopped and kept(tmp_path / "stopped", resume=True).stopped is None
        assert contents(tmp_path / "stopped") == contents(tmp_path / "whole")
    kills = 0
    for run in range(20):
        directory = tmp_path / f"killed {run}"
        kills += killed_until_done(lambda directory=directory: kept(directory, resume=True), 5 - kills)
        assert contents(directory) == contents(tmp_path / "whole")
        if kills == 5:
            break
    assert kills == 5


@pytest.mark.parametrize("reference", REFERENCES[1:], ids=repr)
def test_graphs_keep_every_bit_across_sorts(reference, monkeypatch):
    sorted_often(monkeypatch)
    found = []
    for on in (False, True):
        execution.set_graphs(on)
        simulation = unsorted_blocks(reference, [es.Fixed(lambda X: X[:, 0] < 0.2), es.BodyForce(push)])
        simulation.step(9)
        simulation.run(simulation.t + 7.3 * simulation.dt)
        simulation.step(6)
        assert simulation.by_graphs is on
        found.append(bits(simulation))
    assert found[0] == found[1]


def test_errors_name_the_particle_by_the_users_number():
    simulation = shuffle(two_blocks(3, conditions=[], sort=False))
    v = simulation.v
    v[300] = np.nan
    simulation.stepper.U.v.assign(simulation.order.by_place(v))
    simulation.stepper.rebuild()
    with pytest.raises(es.UnstableError) as caught:
        simulation.step()
    named, X = caught.value.particle, simulation.X
    assert not np.isfinite(simulation.v[named]).all()
    assert named != simulation.order.places[named]
    where = np.array2string(X[named], precision=6)
    assert f"particle {named} of body 'free' at x = {where} m at the start has non-finite values" in str(caught.value)
