"""What a simulation will take is known before it is built, and one that will not fit is refused with the number."""

import logging

import numpy as np
import pytest
import warp as wp
from bodies import block

import warp_eulsph as es
from warp_eulsph import execution, memory
from warp_eulsph.bench.memory import USES, table

SIDE = {1: 4000, 2: 80, 3: 20}


@pytest.mark.parametrize("simd", [True, False])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("reference", [es.Never(), es.Always()], ids=repr)
def test_estimate_is_near_what_is_allocated(dim, dtype, reference, simd, device):
    """To a hundredth but for the lists; with them within a tenth, for at the surface there are fewer neighbours."""
    execution.set_simd(simd)
    simulation = es.Simulation(block(dim, SIDE[dim]), reference=reference, arrangement=es.Current(), dtype=dtype)
    simulation.step(3)
    taken = memory.array_bytes(simulation) / len(simulation.x)
    moving = not reference.fixed
    expected = memory.bytes_per_particle(simulation.space, 2.6, moving, device)
    assert 0.9 * taken < expected < 1.1 * taken
    rows = simulation.configuration.lists.rows
    lists = sum({array.ptr: array.capacity for array in (rows.index, rows.w, rows.own)}.values()) / len(simulation.x)
    others = memory.bytes_per_particle(simulation.space, 0.0, moving, device)
    assert others == pytest.approx(taken - lists, rel=0.01)


@pytest.mark.of_the_cpu
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_it_is_known_what_each_array_of_a_step_is_for(dim):
    """The table of ``bench.memory`` is whole, and of nothing that is not there."""
    simulation = es.Simulation(block(dim, SIDE[dim]), reference=es.Never())
    simulation.step()
    lines = table(simulation)
    assert [names for _, names, uses in lines[:-1] if not uses] == []
    assert sum(size for size, _, _ in lines) * len(simulation.x) == pytest.approx(memory.array_bytes(simulation))
    named = {end for _, names, _ in lines for end in USES for name in names.split(", ") if name.endswith(end)}
    assert named == set(USES)


def test_a_fixed_reference_keeps_no_search_and_finds_its_neighbours_again():
    simulation = es.Simulation(block(2, SIDE[2]), reference=es.Never())
    lists = simulation.configuration.lists
    before = lists.rows.index.numpy().copy(), simulation.configuration.fields.L.numpy().copy()
    searching = memory.array_bytes(lists) - 4 * (len(lists.rows.index) + len(lists.rows.start)) - 16 * len(lists.rows.w)
    assert searching < 16 * len(simulation.x)  # h and bodies, which are the particles'
    simulation.stepper.rebuild()  # as after a restore
    assert np.array_equal(lists.rows.index.numpy(), before[0])
    assert np.array_equal(simulation.configuration.fields.L.numpy(), before[1])


def test_a_run_that_does_not_fit_is_refused_with_the_number(monkeypatch):
    monkeypatch.setattr(memory, "available", lambda device: 1_000_000)
    with pytest.raises(
        MemoryError, match=r"8000 particles take about [12]\d\d\d bytes each, 0.0\d* GB, and 0.001 GB are"
    ):
        es.Simulation(block(3, SIDE[3]))


def test_memory_is_reported_before_the_run(caplog):
    with caplog.at_level(logging.INFO, logger="warp_eulsph.memory"):
        es.Simulation(block(2, SIDE[2]))
    assert "6400 particles take about" in caplog.text


def test_available_memory_is_of_this_machine(device):
    there = memory.available(device)
    assert there is None or 1e7 < there < 1e14
