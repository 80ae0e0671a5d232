"""A step of a liquid by its defaults: the same bits on any number of threads, as a graph, resumed; SIMD or portable."""

import numpy as np
import pytest
import warp as wp
from bodies import bits
from test_execution import DTYPES, assert_equal_to_round_off, results
from test_resume import resume_is_exact

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.boundaries import mirror
from warp_eulsph.geometry import box
from warp_eulsph.interactions import Moving, Plane, RigidBody

WATER = es.TaitLiquid(density=1000.0, sound_speed=100.0)


SIDES = {1: 40, 2: 20, 3: 10}


def water(dim, dtype=wp.float64, mirrored=False, **options):
    """A jittered block of water in irregular motion, large enough that some of it is shifted."""
    n = SIDES[dim]
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / n, jitter=0.1)
    velocity = np.random.default_rng(2).normal(size=x.shape)
    body = es.Body(x=x, volume=volume, spacing=1.0 / n, material=WATER, velocity=velocity)
    if mirrored:
        body, ghosts = mirror(body, point=(0.0,) * dim, normal=-np.eye(dim)[0], depth=7.3 / n)
        options["boundaries"] = [ghosts]
    return es.Simulation(body, dtype=dtype, **options)


def shifted(simulation):
    return np.abs(simulation.stepper.medium.shifter._moved.numpy()).max() > 0.0


@pytest.mark.of_the_cpu
@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_simd_equals_portable(dim, dtype):
    found, flows = {}, {}
    for simd in (False, True):
        execution.set_simd(simd)
        simulation = water(dim, dtype, time_step=es.TimeStep(fixed=1e-5))
        found[simd] = results(simulation, 10)
        assert shifted(simulation)
        flows[simd] = simulation.stepper.medium.volumes.change.numpy().astype(float)
    assert_equal_to_round_off(found[False], found[True], dtype)
    assert not np.array_equal(*flows.values())  # it is another kernel
    # Volume flows by what two pressures differ by beyond their gradients, a hundredth of them. In half of such runs
    # with other velocities a particle of a thousand has s of F = s I rounded the other way: p by d ρc² ε, 2600 ε of it
    bound = 3e4 * np.finfo(np.float32 if dtype is wp.float32 else float).eps
    assert np.abs(flows[True] - flows[False]).max() <= bound * np.abs(flows[False]).max()


@pytest.mark.of_the_cpu
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_threads_keep_every_bit(dim, monkeypatch):
    monkeypatch.setattr(execution, "LEAST_RANGE", 16)
    found = []
    for threads in (1, 3):
        execution.set_threads(threads)
        found.append(results(water(dim), 5))
    for name, values in found[0].items():
        assert np.array_equal(values, found[1][name]), name


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_graphs_keep_every_bit(dim):
    found = []
    for on in (False, True):
        execution.set_graphs(on)
        simulation = water(dim)
        simulation.step(9)
        found.append(bits(simulation))
    assert found[0] == found[1]


TILTING = RigidBody(Plane(normal=(0.0, 1.0)), centre=(0.0, 0.0), motion=Moving((0.0, 2.0), (1.0,)))
BESIDE = {"nothing": {}, "a wall": {"interactions": [TILTING]}, "a mirror": {"mirrored": True}}


@pytest.mark.parametrize("options", BESIDE.values(), ids=BESIDE)
def test_resume_is_exact(options):
    """Shifting follows ∇v as the last step left it, where a resumed run finds the same: not beside walls, that move."""
    resume_is_exact(lambda: water(2, **options), 5, 4)
