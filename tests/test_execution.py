"""How kernels run changes nothing: threads keep every bit, SIMD kernels equal the portable ones up to round-off."""

import os
import platform
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from bodies import COMPRESSIBLE, RUBBER
from clouds import cloud, configuration_of

import warp_eulsph as es
from warp_eulsph import execution

DTYPES = [wp.float32, wp.float64]
SIDE = {1: 40, 2: 12, 3: 7}
WEIGHTS = [subclass() for subclass in es.Weight.__subclasses__()]
pytestmark = pytest.mark.of_the_cpu


def disordered(dim, dtype, reference, **options):
    """A jittered block of rubber in irregular motion, of two bodies that overlap."""
    x, volume = cloud(dim, SIDE[dim], jitter=0.15)
    rng = np.random.default_rng(2)
    bodies = [
        es.Body(x=x + shift, volume=volume, material=RUBBER, velocity=8.0 * rng.normal(size=x.shape), name=name)
        for name, shift in (("one", 0.0), ("two", 0.3))
    ]
    return es.Simulation(
        bodies,
        reference=reference,
        arrangement=es.Current(),
        dtype=dtype,
        time_step=es.TimeStep(fixed=2e-6),
        **options,
    )


def results(simulation, steps):
    simulation.step(steps)
    stepper = simulation.stepper
    fields = {"x": simulation.x, "v": simulation.v, "F": simulation.F, "surface": stepper.U.surface.numpy().copy()}
    for name in ("internal", "dissipation"):
        fields[name] = getattr(stepper.forces, name).numpy().copy()
    return fields | {"rate": np.array(simulation.clock.fields.rate.numpy()), "energy": [*simulation.energy().values()]}


def assert_equal_to_round_off(portable, vector, dtype):
    """Impedances have the root of the spread of the stretches, which near F = 1 turns round-off ε into √ε.

    A step moves v by a hundredth of itself or less. Ten steps round x ten times, by an ulp in either of two ways.
    """
    eps = np.finfo(np.float32 if dtype is wp.float32 else float).eps
    bounds = {"x": 10 * eps, "F": 1e3 * eps, "internal": 1e4 * eps}
    bounds |= {"dissipation": np.sqrt(eps), "v": 1e-2 * np.sqrt(eps)}
    for name, bound in bounds.items():
        assert np.abs(vector[name] - portable[name]).max() <= bound * np.abs(portable[name]).max(), name


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("reference", [es.Never(), es.Always()], ids=repr)
@pytest.mark.parametrize("simd", [True, False])
def test_threads_keep_every_bit(dim, reference, dtype, simd, monkeypatch):
    monkeypatch.setattr(execution, "LEAST_RANGE", 16)
    execution.set_simd(simd)
    found = {}
    for threads in (1, 2, 3):
        execution.set_threads(threads)
        assert (len(execution._ranges(80)) > 1) is (threads > 1)
        found[threads] = results(disordered(dim, dtype, reference), 8)
    for threads in (2, 3):
        for name, values in found[1].items():
            assert np.array_equal(values, found[threads][name]), name


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("reference", [es.Never(), es.Always()], ids=repr)
def test_simd_equals_portable(dim, reference, dtype):
    """Ten steps: differences of round-off in forces and corrections, which the steps do not amplify."""
    found = {}
    for simd in (False, True):
        execution.set_simd(simd)
        simulation = disordered(dim, dtype, reference)
        assert simulation.stepper.configuration.simd is simd
        found[simd] = results(simulation, 10)
    assert_equal_to_round_off(found[False], found[True], dtype)
    assert not np.array_equal(found[True]["internal"], found[False]["internal"])  # it is another kernel


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("weight", WEIGHTS, ids=repr)
def test_simd_pair_sums_equal_portable(weight, dim, dtype):
    """Lists, pair weights, K and its companions, for every weight and different smoothing lengths."""
    x, volume = cloud(dim, SIDE[dim], jitter=0.3)
    h = 1.4 / SIDE[dim] * np.random.default_rng(3).uniform(0.8, 1.3, len(x))
    found = {}
    for simd in (False, True):
        execution.set_simd(simd)
        configuration = configuration_of(x, volume, h, weight=weight, real=dtype)
        near, fields, lists = configuration.near, configuration.fields, configuration.lists
        arrays = [array.numpy().copy() for array in (configuration.K, fields.row, fields.diagonal)]
        found[simd] = [lists.lengths, lists.of_pairs(near.index), lists.of_pairs(near.w), *arrays]
    for k, (portable, vector) in enumerate(zip(found[False], found[True], strict=True)):
        if k < 2:
            assert np.array_equal(portable, vector)
        else:
            tolerance = 200 * np.finfo(portable.dtype).eps
            assert np.abs(vector - portable).max() <= tolerance * np.abs(portable).max()


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_simd_equals_portable_in_a_periodic_box(dim, dtype):
    x, volume = cloud(dim, SIDE[dim], jitter=0.15)
    velocity = 5.0 * np.random.default_rng(4).normal(size=x.shape)
    found = {}
    for simd in (False, True):
        execution.set_simd(simd)
        body = es.Body(x=x, volume=volume, material=COMPRESSIBLE, velocity=velocity, surface=0.0)
        simulation = es.Simulation(
            body, periodic=(1.0,) * dim, dtype=dtype, time_step=es.TimeStep(fixed=2e-6), arrangement=es.Current()
        )
        found[simd] = results(simulation, 10)
    assert_equal_to_round_off(found[False], found[True], dtype)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize(
    "options",
    [
        {"scheme": es.Verlet(dissipation=None)},
        {"scheme": es.Verlet(dissipation=None), "periodic": True},
        {"scheme": es.Verlet(correction=es.PairAreas()), "surface": 0.0},  # its forces take Π that the tie has changed
    ],
    ids=["no dissipation", "periodic", "surface given"],
)
def test_a_tie_alone_by_simd_equals_portable(options, dim, dtype):
    """Where M9 is not, or comes with a correction."""
    x, volume = cloud(dim, SIDE[dim], jitter=0.15)
    body = es.Body(x=x, volume=volume, material=RUBBER, velocity=8.0 * np.sin(7.0 * x), surface=options.get("surface"))
    periodic = (1.0,) * dim if "periodic" in options else None
    options = {"scheme": options["scheme"], "periodic": periodic, "reference": es.Never(), "dtype": dtype}
    found, ties = {}, {}
    for simd in (False, True):
        execution.set_simd(simd)
        simulation = es.Simulation(body, time_step=es.TimeStep(fixed=2e-6), **options)
        found[simd] = results(simulation, 10)
        ties[simd] = simulation.stepper.forces.tie.numpy().copy()
    assert_equal_to_round_off(found[False], found[True], dtype)
    # a tie is what is left of displacements when F has had its share: round-off of these, times the modulus
    scale = np.abs(found[False]["internal"]).max()
    assert np.abs(ties[True] - ties[False]).max() <= 1e4 * np.finfo(ties[True].dtype).eps * scale
    assert not np.array_equal(ties[True], ties[False])  # it is another kernel


def test_long_rows_and_far_away_particles_are_found():
    """A row of more than 512 neighbours, and a cloud with a particle so far away that cells must be widened."""
    rng = np.random.default_rng(5)
    x = np.concatenate([rng.uniform(0.0, 1.0, (900, 2)), [[1e7, -1e7]]])
    found = {}
    for simd in (False, True):
        execution.set_simd(simd)
        configuration = configuration_of(x, np.full(len(x), 1e-3), 0.45)
        lists = configuration.lists
        found[simd] = lists.lengths, lists.of_pairs(lists.rows.index)
    assert found[True][0].max() > 600
    assert all(np.array_equal(*both) for both in zip(found[False], found[True], strict=True))


def test_rows_of_far_apart_indices_are_sorted():
    """Indices that differ by more than 16 bits hold are ranked in full."""
    n = 70_000
    x = np.random.default_rng(6).permutation((np.arange(n) + 0.5) / n)[:, None]
    found = {}
    for simd in (False, True):
        execution.set_simd(simd)
        configuration = configuration_of(x, np.full(n, 1.0 / n), 1.3 / n)
        found[simd] = configuration.lists.of_pairs(configuration.near.index)
    rows = found[True].reshape(-1, 1)
    assert np.ptp(rows) > 65536
    assert np.array_equal(found[False], found[True])


def test_steps_record_their_launches_once():
    """A launch that is recorded anew in every step costs as much as none recorded, and piles up."""
    simulation = disordered(2, wp.float64, es.Always())
    simulation.step()
    stepper, stabiliser, lists = (
        simulation.stepper,
        simulation.stepper.stabiliser,
        simulation.stepper.configuration.lists,
    )
    owners = [stepper, stepper.flux, stepper.ledger, stepper.clock, stepper.configuration, lists, lists.cells]
    owners += [stabiliser, stabiliser._by_simd]
    recorded = []
    for _ in range(4):
        simulation.step(4)
        recorded.append([len(owner._launch._recorded) for owner in owners])
    assert recorded[1:] == recorded[:1] * 3
    assert sum(recorded[0]) > 20


def test_bad_settings_are_named():
    with pytest.raises(ValueError, match="threads must be at least 1, got 0"):
        execution.set_threads(0)
    for name, value in (("WARP_EULSPH_THREADS", "many"), ("WARP_EULSPH_SIMD", "yes")):
        command = [sys.executable, "-c", "from warp_eulsph import execution; execution.simd('cpu')"]
        run = subprocess.run(command, env={**os.environ, name: value}, capture_output=True, text=True)
        assert run.returncode != 0
        assert f"{name} must be" in run.stderr


def test_defaults_are_all_cores_and_simd():
    execution.set_threads(None)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    assert execution.threads() == cores
    run = [sys.executable, "-c", "from warp_eulsph import execution as e; print(e.threads(), e.simd('cpu'))"]
    environment = {**os.environ, "WARP_EULSPH_THREADS": "3", "WARP_EULSPH_SIMD": "0"}
    shown = subprocess.run(run, env=environment, capture_output=True, text=True, check=True).stdout
    assert shown.split()[-2:] == ["3", "False"]


CPUINFO = Path("/proc/cpuinfo")
BLOCK = """
import sys
import warp as wp

wp.config.cpu_compiler_flags = wp.config.cpu_compiler_flags.replace("-march=native", sys.argv[1])
import dataclasses
import numpy as np
from warp_eulsph.bench.cases import CASES

case = next(case for case in CASES if case.name == "eulerian-3d-float64")
simulation = dataclasses.replace(case, side=6).build()
simulation.step(3)
np.save(sys.argv[2], simulation.v)
"""


@pytest.mark.slow
@pytest.mark.skipif(not (platform.machine() == "x86_64" and CPUINFO.exists()), reason="names processors of that kind")
def test_older_processors_find_the_same(tmp_path):
    """Without AVX-512 and without any AVX, by the code that is compiled for them: up to round-off, FMA or not."""
    found = []
    for k, target in enumerate(("-march=native", "-target-cpu haswell", "-target-cpu x86-64")):
        if "haswell" in target and "avx2" not in CPUINFO.read_text():
            continue
        subprocess.run([sys.executable, "-c", BLOCK, target, tmp_path / f"{k}.npy"], check=True, capture_output=True)
        found.append(np.load(tmp_path / f"{k}.npy"))
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], rtol=0.0, atol=1e-11 * np.abs(found[0]).max())


def test_a_weight_without_its_slope_in_cpp_runs_beside_simd_kernels():
    class OwnWeight(es.Weight):
        support, sigma = es.WendlandC2.support, es.WendlandC2.sigma

        def profile(self, real):
            return es.WendlandC2().profile(real)

    own, given = (
        results(disordered(2, wp.float64, es.Always(), weight=weight, dilation=1.5), 3)
        for weight in (OwnWeight(), es.WendlandC2())
    )
    assert_equal_to_round_off(own, given, wp.float64)


def test_what_breaks_into_a_launch_leaves_no_thread_at_work(monkeypatch):
    """It would write into what is launched next."""
    monkeypatch.setattr(execution, "_threads", 2)
    monkeypatch.setattr(execution, "_pool", None)
    started, done = threading.Event(), []

    class Command:
        def launch(self):
            if threading.current_thread() is threading.main_thread():
                started.wait()
                raise KeyboardInterrupt
            started.set()
            time.sleep(0.05)
            done.append(True)

    with pytest.raises(KeyboardInterrupt):
        execution._together([Command(), Command()])
    assert done
    execution._pool.shutdown()
