"""Bodies with options of their own in one simulation: each moves as it would alone, by one clock and in one ledger."""

import dataclasses

import numpy as np
import pytest
import warp as wp
from bodies import bits
from clouds import cloud

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.cases import CaseError, parse_case
from warp_eulsph.defaults import LIQUID
from warp_eulsph.geometry import box, disc
from warp_eulsph.operators.neighbours import NeighbourLists

RUBBER = es.NeoHookean(density=1100.0, young=1e6, poisson=0.4)
WATER = es.TaitLiquid(density=1000.0, sound_speed=20.0)
STEP = es.TimeStep(fixed=2e-4)


@pytest.fixture(autouse=True)
def restored():
    """Leave the setting as it was."""
    before = execution._graphs
    yield
    execution.set_graphs(before)


def ring(**options):
    """A rubber ring of radii 0.7 and 1 m that breathes."""
    x, volume = disc(centre=(0.0, 0.0), radius=1.0, spacing=0.08)
    outside = np.linalg.norm(x, axis=1) > 0.7
    x = x[outside]
    return es.Body(x=x, volume=volume[outside], material=RUBBER, velocity=0.5 * x, name="ring", **options)


def drop(**options):
    """A drop of water of radius 0.5 m in its middle, drawn out along x."""
    x, volume = disc(centre=(0.0, 0.0), radius=0.5, spacing=0.08)
    return es.Body(x=x, volume=volume, material=WATER, velocity=x * [1.0, -1.0], name="drop", **options)


def state(simulation, name):
    where = simulation.ranges[name]
    return {field: getattr(simulation, field)[where.start : where.stop] for field in ("x", "v", "F")}


OPTIONS = {
    "liquid in a fixed solid": ({"reference": es.Never()}, {}),
    "weights and dilations": (
        {"reference": es.Never(), "weight": es.WendlandC2(), "dilation": 1.6},
        {"weight": es.QuarticSpline(), "dilation": 1.2, "scheme": es.Verlet(dissipation=None)},
    ),
    "updated and Eulerian": (
        {"reference": es.Every(3), "arrangement": es.Current(), "scheme": es.Verlet(correction=es.PairAreas())},
        {"scheme": es.Verlet(shifting=es.Shifting(), limiter=es.FluxCorrectedTransport())},
    ),
}


@pytest.mark.parametrize("graphs", [False, True], ids=["by the host", "by graphs"])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize(("solid", "liquid"), OPTIONS.values(), ids=OPTIONS)
def test_each_medium_moves_as_it_would_alone(solid, liquid, dtype, graphs):
    """In every bit, at equal steps: media share nothing but the clock."""
    execution.set_graphs(graphs)
    bodies = [ring(**solid), drop(**liquid)]
    together = es.Simulation(bodies, time_step=STEP, dtype=dtype)
    assert len(together.stepper.media) == 2
    together.step(30)
    momentum, energy, accounts = 0.0, 0.0, {}
    for body in bodies:
        alone = es.Simulation(body, time_step=STEP, dtype=dtype)
        alone.step(30)
        for field, values in state(alone, body.name).items():
            assert np.array_equal(state(together, body.name)[field], values), (body.name, field)
        momentum = momentum + alone.momentum()
        energy += alone.energy()["total"]
        accounts = {name: accounts.get(name, 0.0) + value for name, value in alone.stepper.ledger.accounts().items()}
    books = together.energy()
    round_off = 1e-12 * energy if dtype is wp.float64 else 1e-3 * energy
    assert books["total"] == pytest.approx(energy, rel=1e-9)
    assert together.stepper.ledger.accounts() == pytest.approx(accounts, rel=1e-9, abs=1e-9 * energy)
    assert abs(books["residual"]) < round_off
    np.testing.assert_allclose(together.momentum(), momentum, atol=1e-6)


@pytest.mark.parametrize("scheme", [es.LaxWendroff(), es.Lax()], ids=["LaxWendroff", "Lax"])
def test_every_scheme_takes_media(scheme):
    bodies = [ring(reference=es.Never()), drop()]
    together = es.Simulation(bodies, scheme=scheme, time_step=STEP)
    together.step(20)
    for body in bodies:
        alone = es.Simulation(body, scheme=scheme, time_step=STEP)
        alone.step(20)
        assert all(np.array_equal(state(together, body.name)[f], v) for f, v in state(alone, body.name).items())
    assert abs(together.energy()["residual"]) < 1e-12 * together.energy()["total"]


def test_the_step_is_that_of_the_fastest_medium():
    bodies = [ring(reference=es.Never()), drop()]
    steps = []
    for chosen in (bodies, bodies[:1], bodies[1:]):
        simulation = es.Simulation(chosen)
        simulation.step()
        steps.append(simulation.dt)
    assert steps[0] == min(steps[1:]) < max(steps[1:])


def test_options_of_all_bodies_are_those_of_the_simulation():
    """Bodies that agree are one medium, and the options may stand on either side."""
    own = {"arrangement": es.Current(), "scheme": es.Verlet(), "weight": es.WendlandC4(), "dilation": 1.5}
    of_all = es.Simulation([ring(), drop()], **own)
    of_each = es.Simulation([ring(**own), drop(**own)])
    for simulation in (of_all, of_each):
        assert len(simulation.stepper.media) == 1
        simulation.step(5)
    assert bits(of_each) == bits(of_all)


def test_bodies_between_others_are_media_of_their_own():
    x, n = drop().x, len(drop().x)
    bodies = [es.Body(x=x + np.array([3.0 * k, 0.0]), volume=0.0064, material=RUBBER, name=f"{k}") for k in range(4)]
    other = es.Body(x=x, volume=0.0064, material=RUBBER, dilation=1.4, name="other")
    simulation = es.Simulation([*bodies[:2], other, *bodies[2:]])
    spans = [medium.span for medium in simulation.stepper.media]
    assert spans == [range(2 * n), range(2 * n, 3 * n), range(3 * n, 5 * n)]


FULL = es.Verlet(limiter=es.FluxCorrectedTransport(), shifting=es.Shifting())


@pytest.mark.parametrize("graphs", [False, True], ids=["by the host", "by graphs"])
@pytest.mark.parametrize("scheme", [es.Verlet(), FULL], ids=["default", "limited"])
def test_resumed_runs_go_on_bit_for_bit(scheme, graphs):
    execution.set_graphs(graphs)

    def build():
        solid = ring(reference=es.Every(3), arrangement=es.Current(), dilation=1.5)
        held = es.Fixed(lambda X: X[:, 0] < -0.9)
        return es.Simulation([solid, drop()], scheme=scheme, boundaries=[held, es.Pressure(1e3, body="ring")])

    whole, resumed = build(), build()
    whole.step(8)
    arrays, counters = {name: array.numpy().copy() for name, array in whole.evolving().items()}, whole.counters
    resumed.step(3)
    resumed.restore(arrays, counters)
    for simulation in (whole, resumed):
        simulation.step(9)
        simulation.run(simulation.t + 4.3 * simulation.dt)
    assert bits(resumed) == bits(whole)


def test_sorting_changes_places_within_media_only():
    """Shuffled bodies are sorted, and the answers are those of particles left where they are, to round-off."""
    simulations = []
    for sort in (True, False):
        bodies = []
        for body in (ring(reference=es.Never()), drop()):
            mixed = np.random.default_rng(3).permutation(len(body.x))
            shuffled = {name: getattr(body, name)[mixed] for name in ("x", "volume", "spacing", "velocity")}
            bodies.append(dataclasses.replace(body, **shuffled))
        held = es.Fixed(lambda X: X[:, 0] > 0.9)
        simulations.append(es.Simulation(bodies, sort=sort, boundaries=[held], time_step=STEP))
        simulations[-1].step(20)
    found, left = simulations
    ids, n = found.order.ids.numpy(), len(bodies[0].x)
    assert not np.array_equal(ids, np.arange(len(ids)))
    assert ids[:n].max() < n <= ids[n:].min()
    for name in ("x", "v", "F"):
        np.testing.assert_allclose(getattr(found, name), getattr(left, name), rtol=1e-9, atol=1e-9)
    forces = [simulation.reaction(simulation.boundaries[0]) for simulation in simulations]
    np.testing.assert_allclose(*forces, rtol=1e-9, atol=1e-6)


def test_full_lists_of_any_medium_let_the_host_step_in(monkeypatch):
    """Two moving media whose lists have no spare room: graphs end such steps as the host takes them."""
    waited, make_room = [], NeighbourLists.make_room

    def without_spare_room(lists):
        waited.append(lists.waiting)
        make_room(lists)
        needed = int(lists.count.numpy()[:-1].sum())
        if lists.capacity > needed:
            lists._reserve(needed)

    monkeypatch.setattr(NeighbourLists, "make_room", without_spare_room)
    x, volume = cloud(2, 9, jitter=0.15)
    v = 8.0 * np.random.default_rng(2).normal(size=x.shape)
    own = ({"reference": es.Every(2)}, {"scheme": es.Verlet(dissipation=None, correction=es.PairAreas())})
    found = []
    for graphs in (False, True):
        execution.set_graphs(graphs)
        bodies = [
            es.Body(x=x + 3.0 * k, volume=volume, material=RUBBER, velocity=v, name=f"{k}", **options)
            for k, options in enumerate(own)
        ]
        simulation = es.Simulation(bodies, arrangement=es.Current(), scheme=es.Verlet(dissipation=None))
        simulation.step(60)
        found.append(bits(simulation))
    assert found[0] == found[1]
    assert sum(waited) > 2


def test_what_does_not_fit_is_named():
    with pytest.raises(ValueError, match=r"reference must be Always\(\) for TaitLiquid"):
        es.Simulation([ring(), drop(reference=es.Never())])
    with pytest.raises(ValueError, match=r"schemes must be of one kind.* give body 'drop' scheme=Verlet\(...\)"):
        es.Simulation([ring(), drop(scheme=es.LaxWendroff())])
    with pytest.raises(ValueError, match=r"body 'ring': reference must be an object such as Never\(\), got the class"):
        ring(reference=es.Never)
    with pytest.raises(ValueError, match=r"body 'ring': dilation must be positive and finite, got -1.0"):
        ring(dilation=-1.0)
    simulation = es.Simulation([ring(reference=es.Never()), drop()])
    with pytest.raises(ValueError, match="there are 2 media, none of them is the only one"):
        _ = simulation.stepper.configuration


CASE = {
    "until": 0.01,
    "output": {},
    "body": {
        "ring": {
            "shape": {"kind": "disc", "centre": [0.0, 0.0], "radius": 1.0, "spacing": 0.1},
            "material": {"kind": "NeoHookean", "density": 1100.0, "young": 1e6, "poisson": 0.4},
            "reference": "Never",
            "weight": "WendlandC2",
            "dilation": 1.5,
            "scheme": {"kind": "Verlet", "tie": "None"},
        },
        "drop": {
            "shape": {"kind": "disc", "centre": [3.0, 0.0], "radius": 0.5, "spacing": 0.1},
            "material": {"kind": "TaitLiquid", "density": 1000.0, "sound_speed": 20.0},
        },
    },
}


def test_case_files_have_options_of_bodies():
    case = parse_case(CASE)
    simulation = case.build()
    solid, liquid = simulation.stepper.media
    assert solid.policy == es.Never() and liquid.policy == es.Always()
    assert solid.configuration.weight == es.WendlandC2() and liquid.configuration.weight == LIQUID.weight
    assert solid.options == es.Verlet(tie=None) and liquid.options == LIQUID.scheme
    assert solid.particles.h.numpy()[0] == pytest.approx(0.15, rel=0.1)
    assert parse_case(case.describe()).describe() == case.describe()


def test_mistakes_in_options_of_bodies_are_named():
    wrong = {**CASE, "body": {"ring": {**CASE["body"]["ring"], "reference": "Nevr"}}}
    with pytest.raises(CaseError, match=r"body.ring.reference: unknown kind 'Nevr'; did you mean 'Never'"):
        parse_case(wrong)


@pytest.mark.parametrize("equal", [True, False], ids=["of one material", "of many"])
def test_many_bodies_of_one_kind_of_law_move_as_each_would_alone(equal):
    """In every bit, at equal steps; their laws are evaluated in one launch, each with its own constants."""
    step = es.TimeStep(fixed=1e-4)

    def bar(k):
        x, volume = box((2.0 * k,), (2.0 * k + 1.0,), 0.05)
        material = es.NeoHookean(density=1100.0, young=1e6 if equal else 1e6 * (k + 1), poisson=0.3)
        return es.Body(x=x, volume=volume, material=material, velocity=np.sin(3.0 * (x - 2.0 * k)), name=f"bar {k}")

    bars = [bar(k) for k in range(5)]
    together = es.Simulation(bars, time_step=step)
    assert len(together.stepper.media) == len(together.stepper.flux.kinds) == 1
    together.step(40)
    for body in bars:
        alone = es.Simulation(body, time_step=step)
        alone.step(40)
        assert all(np.array_equal(state(together, body.name)[f], v) for f, v in state(alone, body.name).items())
