"""When particles are sorted, and that nothing grows by it."""

import numpy as np
import pytest
from bodies import RUBBER, bits, lattice
from test_resume import reachable
from test_sorting import shuffle, two_blocks

import warp_eulsph as es
from warp_eulsph import sorting
from warp_eulsph.bench.mixing import stirred_cube


def test_lattices_stay_as_they_are(monkeypatch):
    """Also where their rows are short or run along the first axis."""
    monkeypatch.setattr(sorting, "STEPS_BETWEEN_SORTS", 4)
    ticks = (np.arange(7) + 0.5) / 7
    for rows in ((7, 7, 7), (7, 7, 2), (2, 7, 7), (7, 3, 4)):
        for axes in ((0, 1, 2), (2, 1, 0)):
            x = np.stack(np.meshgrid(*[ticks[:m] for m in rows], indexing="ij"), -1)
            x = x.transpose(*axes, 3).reshape(-1, 3)
            body = es.Body(x=x, volume=7.0**-3, material=RUBBER, velocity=20.0 * np.sin(3.0 * x))
            simulation, plain = (es.Simulation(body, sort=on) for on in (True, False))
            for each_one in (simulation, plain):
                each_one.step(9)
            assert bits(simulation) == bits(plain)
            assert np.array_equal(simulation.order.places, np.arange(len(x)))


@pytest.mark.parametrize("reference", [es.Never(), es.Always()], ids=repr)
def test_room_in_the_lists_does_not_grow_by_sorting(reference):
    order = np.random.default_rng(0).permutation(216)
    rooms = {
        on: two_blocks(3, order=order, sort=on, reference=reference).configuration.lists.capacity
        for on in (True, False)
    }
    assert rooms[True] == rooms[False]


def test_stirred_liquids_are_sorted_as_they_part(monkeypatch):
    monkeypatch.setattr(sorting, "STEPS_BETWEEN_SORTS", 50)
    x = lattice(3, 12)
    cubes = {on: stirred_cube(x, 12, sort=on) for on in (True, False)}
    assert np.array_equal(cubes[True].order.places, np.arange(len(x)))
    for cube in cubes.values():
        cube.step(400)
    assert not np.array_equal(cubes[True].order.places, np.arange(len(x)))
    assert cubes[True].sorting.parted() < 0.6 * cubes[False].sorting.parted()
    # The flow is chaotic for none of these steps: round-off has grown, but not far
    np.testing.assert_allclose(cubes[True].x, cubes[False].x, atol=1e-6)


def test_every_array_lies_where_it_was():
    """Recorded launches and graphs hold pointers."""
    simulation = two_blocks()
    simulation.step(3)
    before = {path: array.ptr for path, array in reachable(simulation)[0].items()}
    shuffle(simulation)
    assert len(before) > 50 and {path: array.ptr for path, array in reachable(simulation)[0].items()} == before
