"""Arrays that users give go where they say, in every order and shape, or are refused; those they get are read-only."""

import inspect
import logging
import math
import re

import numpy as np
import pytest
import warp as wp
from bodies import RUBBER
from hypothesis import given, settings
from hypothesis import strategies as st
from kept_runs import plate

import warp_eulsph as es
from warp_eulsph import overlap
from warp_eulsph.boundaries import Assembly
from warp_eulsph.geometry import box
from warp_eulsph.operators.neighbours import MOST_PAIRS
from warp_eulsph.order import Order
from warp_eulsph.output import Recording
from warp_eulsph.overlap import MOST, SHARE, Encounters
from warp_eulsph.schedule import AnyOf, AtTimes

X = plate().X
N = len(X)


def stepped(*boundaries):
    simulation = es.Simulation(plate().bodies[0], boundaries=boundaries, reference=es.Never())
    simulation.step(2)
    return simulation


regions = st.lists(st.integers(0, N - 1), min_size=3, max_size=8, unique=True)


@settings(max_examples=15, deadline=None)
@given(regions)
def test_rows_of_values_belong_to_the_indices_in_their_order(numbers):
    rows = np.column_stack([np.array(numbers, dtype=float), -2.0 * np.array(numbers)])
    simulation = stepped(es.Velocity(region=numbers, value=rows))
    assert np.array_equal(simulation.v[numbers], rows)


FACE = np.flatnonzero(X[:, 0] == X[:, 0].max()).tolist()
CONDITIONS = {
    "BodyForce": lambda numbers, rows: es.BodyForce(1e3 * rows, region=numbers),
    "Traction": lambda numbers, rows: es.Traction(1e6 * rows, normal=(1.0, 0.0), region=numbers),
    "Pressure": lambda numbers, rows: es.Pressure(1e6 * rows[:, 0], region=numbers),
    "function": lambda numbers, rows: es.BodyForce(lambda x, t: 1e3 * rows, region=numbers),
    "as a tuple": lambda numbers, rows: es.BodyForce(1e3 * rows, region=tuple(int(i) for i in numbers)),
}


@pytest.mark.parametrize("condition", CONDITIONS.values(), ids=CONDITIONS)
@settings(max_examples=4, deadline=None)
@given(regions, st.randoms(use_true_random=False))
def test_the_order_of_a_region_changes_nothing(condition, numbers, random):
    if condition in (CONDITIONS["Traction"], CONDITIONS["Pressure"]):  # named by outermost particles
        numbers = list(dict.fromkeys(FACE[i % len(FACE)] for i in numbers))
    rows = np.array([[i + 1.0, 0.5 * i] for i in numbers])
    shuffled = list(range(len(numbers)))
    random.shuffle(shuffled)
    one = stepped(condition(np.array(numbers), rows))
    other = stepped(condition(np.array(numbers)[shuffled], rows[shuffled]))
    assert np.array_equal(one.v, other.v) and np.array_equal(one.x, other.x)


def test_mirror_ghosts_in_any_order_copy_their_own_source():
    body, ghosts = es.mirror(plate().bodies[0], point=(0.0, 0.0), normal=(-1.0, 0.0), depth=0.4)
    order = np.random.default_rng(0).permutation(len(ghosts.ghosts))
    turned = es.MirrorGhosts(
        ghosts.body, ghosts.sources[order], ghosts.ghosts[order], ghosts.point, ghosts.normal, ghosts.image
    )
    one, other = (es.Simulation(body, boundaries=[condition]) for condition in (ghosts, turned))
    one.step(3), other.step(3)
    assert np.array_equal(one.x, other.x)


def test_regions_that_cannot_be_meant_are_refused(device):
    assembly = Assembly(es.Space(2), device, X, None, {"plate": range(N)}, Order(N, device))
    assert assembly.select([7, 3, 7, 5, 3], None, "who").tolist() == [7, 3, 5]
    for region, message in [
        (np.arange(4)[:, None], r"who: region indices must have shape \(k,\), got \(4, 1\)"),
        (np.ma.array([1, 2], mask=[True, False]), "who: a region must not be a masked array"),
        ((X[:, 0] < 0.5).astype(np.uint8), "who: a region mask must be of type bool, got 36 integers 0 and 1"),
        ([1.0, 2.0], r"who: region indices must be integers in \[0, 36\)"),
        ([-1], r"who: region indices must be integers in \[0, 36\)"),
        ([], "who: the region selects no particle"),
        (lambda X: X[:, :1] < 0.5, r"who: a region predicate must return \(36,\) bool"),
    ]:
        with pytest.raises(ValueError, match=message):
            assembly.select(region, None, "who")


def test_functions_of_users_cannot_move_the_body():
    def region(X):
        X -= 0.5
        return X[:, 0] < -0.4

    with pytest.raises(ValueError, match="read-only"):
        es.Simulation(plate().bodies[0], boundaries=[es.Fixed(region)])

    def load(x, t):
        x *= 0.0
        return x

    with pytest.raises(ValueError, match="read-only"):
        es.Simulation(plate().bodies[0], boundaries=[es.BodyForce(load)])
    body = plate().bodies[0]
    for name in ("x", "volume", "spacing", "velocity"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(body, name)[0] = 1.0


def forced(kept):
    """A user's region that keeps what it was given and writes into it later is given a copy."""
    return es.Fixed(lambda X: kept.append(X) is None and X[:, 0] < 0.2)


def test_what_a_region_keeps_is_a_copy():
    kept = []
    simulation = es.Simulation(plate().bodies[0], boundaries=[forced(kept)])
    kept[0].setflags(write=True)
    kept[0][:] = 7.0
    assert np.array_equal(simulation.x, X)


def shapes_of(*kinds):
    return st.sampled_from([tuple({"n": N, "1": 1, "d": 2, "2": 2, "0": 0}[c] for c in kind) for kind in kinds])


@settings(max_examples=60, deadline=None)
@given(shapes_of("", "1", "d", "n", "n1", "nd", "1d", "dn", "1n", "n1d", "nd1", "0", "d1"))
def test_a_body_takes_numbers_rows_and_one_each_and_nothing_else(shape):
    rng = np.random.default_rng(1)
    velocity, volume = rng.normal(size=shape), 1.0 + rng.random(shape)
    if shape in ((), (2,), (N, 2)):
        assert np.array_equal(
            es.Body(x=X, volume=1.0, material=RUBBER, velocity=velocity).velocity, np.broadcast_to(velocity, (N, 2))
        )
    else:
        with pytest.raises(ValueError, match=r"velocity must be a number, \(2,\) or \(36, 2\), got shape"):
            es.Body(x=X, volume=1.0, material=RUBBER, velocity=velocity)
    if shape in ((), (N,)):
        assert np.array_equal(es.Body(x=X, volume=volume, material=RUBBER).volume, np.broadcast_to(volume, N))
    else:
        with pytest.raises(ValueError, match=r"volume must be a number or have shape \(36,\), got"):
            es.Body(x=X, volume=volume, material=RUBBER)
    given_to_condition = es.Velocity(region=[5, 3, 1], value=velocity)
    if shape in ((), (2,)):
        stepped(given_to_condition)
    else:
        with pytest.raises(ValueError, match=r"Velocity: values must be a number, \(2,\) or \(3, 2\), got shape"):
            stepped(given_to_condition)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (np.ma.array(np.ones((N, 2)), mask=X < 0.5), "must not be a masked array"),
        (np.ones((N, 2)) + 0j, "must be real numbers, got complex numbers"),
        (X < 0.5, "must be real numbers, got truth values"),
        (np.full((N, 2), None), "must be real numbers, got objects"),
        ([[1.0, 2.0], [3.0]], "must be rows of equal length"),
        ("fast", "must be real numbers"),
        (np.inf, "must be (positive and )?finite"),
    ],
    ids=["masked", "complex", "bool", "object", "ragged", "text", "inf"],
)
def test_what_is_not_real_numbers_is_refused_everywhere(given, message):
    for make in (
        lambda: es.Body(x=X, volume=1.0, material=RUBBER, velocity=given),
        lambda: es.Body(x=X, volume=given, material=RUBBER),
        lambda: es.Body(x=given, volume=1.0, material=RUBBER),
        lambda: stepped(es.Velocity(value=given)),
        lambda: stepped(es.BodyForce(lambda x, t: given)),
        lambda: stepped(es.Roller(None, normal=given)),
    ):
        with pytest.raises(ValueError, match=f"{message}|normal must be|x must have shape"):
            make()


def test_wrong_kinds_say_what_to_write():
    body = plate().bodies[0]
    for make, message in [
        (lambda: es.Simulation(body, reference="Always"), r"reference must be such as Always\(\), got str 'Always'"),
        (lambda: es.Simulation(body, reference=es.Always), r"got the class; write Always\(\.\.\.\)"),
        (lambda: es.Simulation(body, dtype=np.float32), r"write dtype=wp\.float32"),
        (lambda: es.Simulation(body, scheme=es.TimeStep()), r"scheme must be such as Verlet\(\), got TimeStep"),
        (lambda: es.Simulation(body, boundaries=[es.Fixed]), r"boundaries\[0\] must be an object such as Fixed"),
        (lambda: es.Simulation(body, boundaries=3), r"boundaries must be a list such as \[Fixed"),
        (lambda: es.Simulation([body, None]), r"bodies\[1\] must be such as Body"),
        (lambda: es.Simulation(body, dilation="1.3"), "dilation must be a number, got '1.3'"),
        (lambda: es.Simulation(body, periodic="ab"), "periodic must be real numbers"),
        (lambda: es.Simulation(body).run(until="1"), "until must be a number, got '1'"),
        (lambda: es.Simulation(body, boundaries=[es.Fixed(axes=1)]), r"write axes=\[1\]"),
        (lambda: es.Simulation(body, boundaries=[es.Fixed(axes=[0.5])]), r"axes must be among \[0, 1\]"),
        (lambda: es.Body(x=X, volume=1.0, material=None), r"material must be a law such as NeoHookean"),
        (lambda: es.Body(x=X, volume=1.0, material=es.NeoHookean), "got the class NeoHookean"),
        (lambda: es.Body(x=np.arange(4.0), volume=1.0, material=RUBBER), r"in 1-D give x\[:, None\]"),
        (lambda: es.Every(1.5), "must be a whole number, at least 1, got 1.5"),
        (lambda: es.Every(True), "must be a whole number, at least 1, got True"),
        (lambda: es.TimeStep(cfl="0.5"), "TimeStep: cfl must be a number or None, got '0.5'"),
        (lambda: es.TimeStep(growth=None), "TimeStep: growth must be a number, got None"),
        (lambda: es.Verlet(dissipation=es.Upwind), r"must be such as Upwind\(\.\.\.\) or None, .*; write Upwind\("),
        (lambda: es.Verlet(tie=True), r"Verlet: tie must be such as Tie\(\.\.\.\) or None, got True"),
        (lambda: es.Verlet(correction="Balance"), r"correction must be such as Balance\(\.\.\.\) or None, got 'Bal"),
        (lambda: es.LaxWendroff(smoothing=3), "LaxWendroff: smoothing must be such as"),
        (lambda: es.NeoHookean(density=None, young=1.0, poisson=0.3), "density must be a number, got None"),
        (lambda: es.Simulation(body, sort="no"), "sort must be True or False, got 'no'"),
        (lambda: es.Simulation(body).step(1.5), "count of steps must be a whole number, at least 0, got 1.5"),
        (lambda: es.Simulation(body).run(until=1e-9, output=3), "directory must be such as 'runs/column', got int 3"),
        (lambda: es.Simulation(body, boundaries=[es.Fixed(lambda x, y: x < y)]), "function of 1 argument such as"),
        (lambda: stepped(es.Velocity(None, value=lambda t: t)), "value must be a function of 2 arguments such as"),
        (lambda: AtTimes(0.1), "times must be finite and increase"),
        (lambda: AtTimes("12"), "times must be real numbers"),
        (lambda: AnyOf([3]), r"schedules\[0\] must be such as EveryTime"),
        (lambda: Recording(fields="velocity"), r"fields must be a list of names, got 'velocity'; write \['velocity'\]"),
        (lambda: Recording(snapshots=0.1), "snapshots must be such as EveryTime"),
        (lambda: box((0.0, 0.0), (1.0, 1.0), "0.1"), "spacing must be a number, got '0.1'"),
    ]:
        with pytest.raises(ValueError, match=message):
            make()
    one, listed = (es.Simulation(body, boundaries=given) for given in (es.Fixed(), [es.Fixed()]))
    assert len(one.boundaries) == len(listed.boundaries) == 1


def test_unknown_keywords_say_who_takes_them():
    body = plate().bodies[0]
    for make, message in [
        (
            lambda: es.Verlet(cfl=3),
            r"^Verlet takes no 'cfl'; TimeStep\(cfl=\.\.\.\) does\. Verlet takes dissipation, corr",
        ),
        (lambda: es.LaxWendroff(cfl=0.3), r"TimeStep\(cfl=\.\.\.\) does"),
        (lambda: es.Simulation(body, cfl=0.3), r"TimeStep\(cfl=\.\.\.\) does"),
        (lambda: es.Simulation(body, material=RUBBER), r"; Body\(material=\.\.\.\) "),
        (lambda: es.Fixed(axis=[0]), r"Fixed takes no 'axis'; did you mean axes\?"),
        (lambda: es.Never(steps=3), r"Every\(steps=\.\.\.\) does\. Never has no options"),
        (lambda: Recording(until=1.0), "Recording takes no 'until'. Recording takes snapshots, fields"),
    ]:
        with pytest.raises(TypeError, match=message):
            make()
    assert list(inspect.signature(es.TimeStep).parameters) == ["cfl", "growth", "fixed"]


def block_of(corner, spacing=0.1):
    x, volume = box([0.0] * 2, [1.0] * 2, spacing)
    return {"x": x + np.array(corner), "volume": volume, "material": RUBBER}


def block(corner, name, spacing=0.1):
    return es.Body(**block_of(corner, spacing), name=name)


@pytest.mark.parametrize(
    ("corner", "other", "periodic", "counts"),
    [
        ((1.0, 0.0), 0.1, None, (10, 10)),  # face to face
        ((1.0, 0.0), 0.05, None, (10, 20)),
        ((0.5, 0.0), 0.1, None, (60, 60)),
        ((0.0, 0.0), 0.1, None, (100, 100)),
        ((1.1, 0.0), 0.1, None, None),
        ((0.0, -2.0), 0.1, None, None),
        ((1.5, 0.0), 0.1, (2.5, 4.0), (10, 10)),  # through the side of the box
        ((1.5, 0.0), 0.1, (2.8, 4.0), None),
    ],
)
def test_bodies_that_overlap_or_touch_are_named(corner, other, periodic, counts, caplog):
    with caplog.at_level(logging.WARNING):
        es.Simulation([block((0.0, 0.0), "left"), block(corner, "right", other)], periodic=periodic)
    if counts is None:
        assert not caplog.records
        return
    (line,) = (record.getMessage() for record in caplog.records)
    assert line.startswith("bodies 'left' and 'right' overlap or touch: ")
    assert f"{counts[0]} particles of 'left' and {counts[1]} particles of 'right' lie within 1.25 spacings" in line


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 3), st.integers(0, 10**6))
def test_overlaps_are_those_of_a_search_through_all_pairs(dim, seed):
    from warp_eulsph.overlap import TOUCHING

    rng = np.random.default_rng(seed)
    x, y = (rng.random((count, dim)) * rng.uniform(0.2, 2.0) for count in (40, 60))
    spacing, other = rng.uniform(0.01, 0.3, 40), rng.uniform(0.01, 0.3, 60)
    bodies = [
        es.Body(x=places, volume=1.0, spacing=s, material=RUBBER, name=name)
        for places, s, name in ((x, spacing, "a"), (y, other, "b"))
    ]
    far = np.linalg.norm(x[:, None] - y[None], axis=2)
    close = far < TOUCHING * 0.5 * (spacing[:, None] + other[None])
    encounters = Encounters(bodies, np.zeros(100, dtype=bool), (0.0,) * dim)
    found = encounters.look(np.concatenate([x, y]), 0.0, 0)
    assert not encounters.look(np.concatenate([x, y]), 0.0, 0) or not found  # once
    if close.any():
        counts = close.any(axis=1).sum(), close.any(axis=0).sum()
        assert f"{counts[0]} particles of 'a' and {counts[1]} particles of 'b'" in found[0]
    else:
        assert not found


@pytest.mark.parametrize("graphs", [False, True])
def test_bodies_that_pass_through_each_other_later_are_named_once(graphs, caplog):
    left = es.Body(**block_of((0.0, 0.0)), velocity=(100.0, 0.0), name="left")
    right, far = es.Body(**block_of((1.5, 0.0)), name="right"), es.Body(**block_of((0.0, 9.0)), name="far")
    with caplog.at_level(logging.WARNING):
        simulation = es.Simulation([left, right, far])
        simulation.by_graphs = graphs
        assert not caplog.records
        simulation.run(until=4e-3)  # the gap of half a metre, less a quarter of a spacing, is closed by 4.75 ms
        assert not caplog.records
        simulation.run(until=0.04)
    (line,) = (record.getMessage() for record in caplog.records)
    found = re.match(r"bodies 'left' and 'right' overlap or touch by t = (\S+) s, step \d+: (\d+) particles of", line)
    assert found and 4.5e-3 < float(found[1]) < 0.02 and int(found[2]) >= 10


def test_looks_for_encounters_are_few_while_bodies_are_apart(monkeypatch):
    looks = []
    look = Encounters.look
    monkeypatch.setattr(
        Encounters, "look", lambda self, x, t, step, *more: looks.append(t) or look(self, x, t, step, *more)
    )
    slow = {"velocity": (1.0, 0.0), "name": "slow"}
    simulation = es.Simulation(
        [es.Body(**block_of((0.0, 0.0)), **slow), block((3.0, 0.0), "far")], reference=es.Never()
    )
    simulation.run(until=0.1)
    assert simulation.steps > 300 and len(looks) - 2 <= simulation.steps // MOST  # one at the start, one soon after


def test_comparing_places_takes_a_small_share_of_the_time(monkeypatch):
    """A ball in a cup, whose boxes meet all the time: a clock that stands still but for the comparisons."""
    x, volume = box((0.0, 0.0), (1.0, 1.0), 0.05)
    inside = np.abs(x - 0.5).max(axis=1)
    made = {"volume": volume, "material": RUBBER}
    bodies = [es.Body(x=x[part], name=name, **made) for part, name in ((inside < 0.2, "ball"), (inside > 0.4, "cup"))]
    now, compared, near = [0.0], [], overlap._near

    def comparing(*given):
        now[0] += 2.0  # s, half of what a comparison takes
        compared.append(now[0])
        return near(*given)

    monkeypatch.setattr(overlap.time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(overlap, "_near", comparing)
    encounters, X = (
        Encounters(bodies, np.zeros(sum(len(b.x) for b in bodies), bool), (0.0, 0.0)),
        np.concatenate([body.x for body in bodies]),
    )
    for step in range(1000):
        now[0] += 1.0
        assert not encounters.look(X, 0.0, step)
    assert len(compared) == 2 * math.ceil(1000 / (4.0 / SHARE))


def test_mirror_ghosts_are_no_overlap(caplog):
    left, ghosts = es.mirror(block((0.0, 0.0), "left"), point=(1.0, 0.0), normal=(1.0, 0.0), depth=0.5)
    with caplog.at_level(logging.WARNING):
        es.Simulation([left, block((1.2, 0.0), "right")], boundaries=[ghosts])
    assert not caplog.records


@pytest.mark.parametrize(("corner", "dtype", "warns"), [(1e5, 32, True), (1e5, 64, False), (1.0, 32, False)])
def test_float32_far_from_the_origin_is_said(corner, dtype, warns, caplog):
    with caplog.at_level(logging.WARNING):
        es.Simulation(block((corner, 0.0), "far"), dtype=wp.float32 if dtype == 32 else wp.float64)
    assert ("put the origin into the bodies, or use float64" in caplog.text) == warns


@pytest.mark.parametrize("pairs", [2**31, 2**32 + 5])
def test_more_pairs_than_can_be_numbered_are_refused(pairs):
    lists = plate().configuration.lists
    with pytest.raises(ValueError, match=f"number at most {MOST_PAIRS} pairs, 36 particles have"):
        many = np.full(len(lists.count), pairs // N + 1, dtype=np.int32)
        lists.count.assign(many)
        lists.make_room()
    lists._total.fill_(-5)  # as the sum on the device is after 2³¹
    with pytest.raises(ValueError, match="number at most"):
        _ = lists.pairs
