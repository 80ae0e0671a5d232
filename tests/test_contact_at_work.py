"""Contact at work: restart, threads, searches, which bodies touch, and what is refused."""

import dataclasses

import numpy as np
import pytest
from touching import SOFT, bar, bits, mean_velocity, rectangle, rings

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.output import InteractionProbe, Recording, Run, record
from warp_eulsph.schedule import EverySteps


@pytest.mark.parametrize("scheme", [es.Verlet(), es.LaxWendroff()], ids=["Verlet", "LaxWendroff"])
@pytest.mark.parametrize("arrangement", [es.Convected(), es.Current()], ids=["fixed", "moving"])
def test_resumed_runs_go_on_bit_for_bit(scheme, arrangement):
    """With friction and while they slide; a look at the energy in between changes nothing."""

    def build():
        simulation = rings(0.15, scheme=scheme, arrangement=arrangement)
        return es.Simulation(
            simulation.bodies, interactions=[es.Contact(friction=0.4)], scheme=scheme, arrangement=arrangement
        )

    whole, resumed = build(), build()
    steps = 90 if isinstance(scheme, es.Verlet) else 220
    whole.step(steps)
    assert whole.energy()["held"] > 0.0
    arrays, counters = {name: array.numpy().copy() for name, array in whole.evolving().items()}, whole.counters
    resumed.step(4)
    resumed.restore(arrays, counters)
    whole.step(15)
    resumed.step(7)
    resumed.energy()
    resumed.step(8)
    assert bits(resumed) == bits(whole)
    assert np.abs(whole.bound_interactions[0].slip.numpy()).max() > 0.0


@pytest.mark.of_the_cpu
def test_the_same_bits_on_any_number_of_threads():
    found = []
    for threads in (1, 3):
        execution.set_threads(threads)
        h = 0.02
        lower = es.Body(x=rectangle(100, 50, h), volume=h * h, material=SOFT, name="lower")
        upper = es.Body(
            x=rectangle(100, 50, h, (0.31, 1.0)), volume=h * h, material=SOFT, velocity=(1.0, -2.0), name="upper"
        )
        simulation = es.Simulation([lower, upper], interactions=[es.Contact(friction=0.3)])
        simulation.step(15)
        found.append(bits(simulation))
    assert found[0] == found[1]


@pytest.mark.parametrize("balanced", [True, False])
def test_sorted_in_memory_it_goes_on(balanced):
    """A drop, whose particles are sorted, on a solid beside it or in its sums: the same but for the order of sums."""
    own = {"scheme": es.Verlet(), "weight": es.CubicSpline(), "dilation": 1.3} if balanced else {}
    found = []
    for sort in (False, True):
        h = 0.1
        block = es.Body(x=rectangle(20, 4, h), volume=h * h, material=SOFT, name="block")
        water = es.TaitLiquid(density=1000.0, sound_speed=50.0)
        x = rectangle(8, 6, h, (0.65, 0.4))
        drop = es.Body(x=x, volume=h * h, material=water, velocity=(0.5, -5.0), name="drop", **own)
        simulation = es.Simulation([block, drop], interactions=[es.Contact(friction=0.3)])
        simulation.step(8)
        assert (simulation.energy()["held"] > 0.0) == balanced
        assert np.abs(simulation.interaction_force).max() > 0.0
        if sort:
            random = np.random.default_rng(1)
            simulation.sorting.permute(np.concatenate([random.permutation(80), 80 + random.permutation(48)]))
        simulation.step(30)
        found.append((simulation.x, simulation.v))
    np.testing.assert_allclose(found[1][0], found[0][0], atol=1e-9)
    np.testing.assert_allclose(found[1][1], found[0][1], atol=1e-6)


def test_its_force_is_in_probes_and_snapshots(tmp_path):
    simulation = rings(0.15)
    probe = InteractionProbe(name="push", body="left", schedule=EverySteps(10))
    record(simulation, tmp_path, 0.01, Recording(fields=["interaction_force"], dtype=np.float64, probes=[probe]))
    pushed = simulation.interaction_force
    assert np.abs(pushed).max() > 0.0
    np.testing.assert_array_equal(Run(tmp_path)[-1].field("interaction_force"), pushed)
    measured = probe.bind(simulation)()["force"]
    np.testing.assert_allclose(measured, pushed[simulation.ranges["left"]].sum(axis=0), rtol=1e-12)
    np.testing.assert_allclose(pushed.sum(axis=0), 0.0, atol=1e-9 * np.abs(pushed).sum())
    with pytest.raises(ValueError, match="has no interactions"):
        probe.bind(es.Simulation(simulation.bodies[0]))


def test_it_searches_only_when_something_has_moved():
    simulation = rings(0.05)
    simulation.step(100)
    nearby = simulation.bound_interactions[0].nearby
    assert 0 < nearby.searches < 15


def test_bodies_that_fly_along_together_are_not_searched_for_again():
    """Only relative motion counts: two rings at one speed, hundreds of spacings far."""
    still = rings(0.0)
    bodies = [dataclasses.replace(body, velocity=(40.0, 0.0)) for body in still.bodies]
    simulation = es.Simulation(bodies, interactions=[es.Contact()])
    simulation.run(1.0)
    nearby = simulation.bound_interactions[0].nearby
    assert simulation.x[:, 0].mean() > 40.0 and nearby.searches == 1


@pytest.mark.parametrize("scheme", [es.Verlet(), es.LaxWendroff()], ids=["Verlet", "LaxWendroff"])
@pytest.mark.parametrize("arrangement", [es.Convected(), es.Current()], ids=["fixed", "moving"])
def test_rows_by_a_search_in_every_step_change_no_bit(scheme, arrangement):
    found = []
    for always in (False, True):
        simulation = rings(0.15, scheme=scheme, arrangement=arrangement)
        nearby = simulation.bound_interactions[0].nearby
        for _ in range(110):
            if always:
                nearby.forget()
            simulation.step()
        found.append(bits(simulation))
        assert nearby.searches > 110 if always else 1 < nearby.searches < 80
    assert found[0] == found[1]


@pytest.mark.parametrize("scheme", [es.Verlet(), es.LaxWendroff()], ids=["Verlet", "LaxWendroff"])
@pytest.mark.parametrize("arrangement", [es.Convected(), es.Current()], ids=["fixed", "moving"])
def test_recorded_steps_keep_every_bit(scheme, arrangement):
    """A graph stops where the contact has to search, and the host takes that step."""
    found = []
    for on in (False, True):
        execution.set_graphs(on)
        bodies, contact = rings(0.15).bodies, es.Contact(friction=0.3)
        simulation = es.Simulation(bodies, interactions=[contact], scheme=scheme, arrangement=arrangement)
        assert simulation.by_graphs is on
        simulation.step(60)
        simulation.run(simulation.t * 2.0)
        assert simulation.energy()["held"] > 0.0
        found.append(bits(simulation))
    assert simulation.bound_interactions[0].nearby.searches > 3
    assert found[0] == found[1]


def test_only_the_named_pairs_touch(caplog):
    """The third passes through, and somebody says so; the others are not told of."""
    bodies = [bar(20, 0.0, 1.0, 1.0, velocity=0.3, name="a"), bar(20, 1.1, 1.0, 1.0, name="b")]
    bodies += [bar(20, 2.1, 1.0, 1.0, velocity=-0.3, name="c")]
    simulation = es.Simulation(bodies, interactions=[es.Contact(between=[("a", "b")])])
    simulation.run(1.0)
    assert "'b' and 'c' overlap or touch" in caplog.text and "'a' and 'b'" not in caplog.text
    assert mean_velocity(simulation, "c")[0] == pytest.approx(-0.3, rel=1e-6)
    assert np.abs(simulation.interaction_force[40:]).max() == 0.0


def test_bad_set_ups_get_one_clear_error():
    h = 0.1
    one = es.Body(x=rectangle(8, 8, h), volume=h * h, material=SOFT, name="one")
    two = es.Body(x=rectangle(8, 8, h, (0.33, 0.71)), volume=h * h, material=SOFT, name="two")
    with pytest.raises(
        ValueError, match=r"'one' and 'two' do: \d+ and \d+ particles, the nearest 0\.\d+ spacings apart"
    ):
        es.Simulation([one, two], interactions=[es.Contact()])
    inside = es.Body(x=rectangle(2, 2, h, (0.35, 0.35)), volume=h * h, material=SOFT, name="two")
    with pytest.raises(ValueError, match="must not lie in each other"):
        es.Simulation([one, inside], interactions=[es.Contact()])
    with pytest.raises(ValueError, match="two bodies that are not bonded, or one whose arrangement stays"):
        es.Simulation([one], interactions=[es.Contact()], arrangement=es.Current())
    apart = es.Body(x=rectangle(8, 8, h, (0.0, 2.0)), volume=h * h, material=SOFT, name="two")
    with pytest.raises(ValueError, match=r"bodies must be among \['one', 'two'\], got 'tow'"):
        es.Simulation([one, apart], interactions=[es.Contact(between=[("one", "tow")])])
    with pytest.raises(ValueError, match="between must be pairs of names"):
        es.Contact(between=["one", "two"])
    with pytest.raises(ValueError, match="friction must be 0 or more"):
        es.Contact(friction=-0.1)
    with pytest.raises(ValueError, match="periodic boxes"):
        es.Simulation([one, apart], interactions=[es.Contact()], periodic=[4.0, 4.0])
