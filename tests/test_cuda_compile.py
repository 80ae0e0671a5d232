"""Every kernel that a step launches compiles for CUDA and spills no register.

No GPU: Warp's ahead-of-time compiler needs no driver. ``-s`` prints the registers of each kernel.
"""

import dataclasses
import itertools

import numpy as np
import pytest
import warp as wp
from bodies import block
from cubin import usage

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.interactions import Free, Plane, Sphere
from warp_eulsph.materials import (
    J2,
    DruckerPrager,
    Failing,
    IdealGas,
    JohnsonCook,
    MieGruneisen,
    Newtonian,
    PrincipalStrain,
)

CASES = [
    pytest.param(3, wp.float32, 90),
    pytest.param(1, wp.float32, 80, marks=pytest.mark.slow),
    pytest.param(2, wp.float64, 80, marks=pytest.mark.slow),
    pytest.param(3, wp.float64, 90, marks=pytest.mark.slow),
]


def problems(dim, dtype):
    """Simulations whose steps launch all kinds of kernels: of the forms of the scheme, of what yields or flows."""
    body, fixed = block(dim, 5), es.Fixed(lambda X: X[:, 0] < 0.2)
    for scheme, reference in (
        (es.Verlet(), es.Always()),
        (es.Verlet(), es.Never()),
        (es.LaxWendroff(smoothing=es.LinearExact()), es.Always()),
    ):
        yield es.Simulation(body, boundaries=[fixed], reference=reference, scheme=scheme, dtype=dtype)
    hardening = JohnsonCook(A=90e6, B=292e6, n=0.31, C=0.025, m=1.09)
    copper = J2(density=8930.0, young=117e9, poisson=0.35, hardening=hardening)
    yielding = dataclasses.replace(body, material=copper, velocity=100.0 * body.x)
    even = {"arrangement": es.Current(), "scheme": es.Verlet(shifting=es.Shifting())}
    for options in ({}, even):
        yield es.Simulation(yielding, boundaries=[fixed], dtype=dtype, **options)
    sand = DruckerPrager(density=1800.0, young=20e6, poisson=0.25, friction=35.0, dilation=5.0)
    yield es.Simulation(dataclasses.replace(yielding, material=sand), boundaries=[fixed], dtype=dtype, **even)
    place = [0.5] * (dim - 1) + [1.51]
    ball = es.RigidBody(Sphere(0.5), centre=place, motion=Free(mass=10.0, gravity=9.81), friction=0.3)
    yield es.Simulation(body, interactions=[ball], dtype=dtype)
    gas = IdealGas(density=1.2, pressure=1e5, viscosity=Newtonian(viscosity=1.0), cavitation=1e3)
    metal = MieGruneisen(density=8930.0, sound_speed=3940.0, slope=1.489, gruneisen=1.99)
    upwind = es.Upwind(sensor=es.DimensionlessSensor(), volume=True)
    for law in (gas, metal):
        flowing = dataclasses.replace(body, material=law, velocity=10.0 * body.x)
        yield es.Simulation(flowing, boundaries=[fixed], scheme=es.Verlet(dissipation=upwind), dtype=dtype)


def options(dim, dtype):
    """What the scheme can be told to do besides."""
    body, sensor = block(dim, 5), es.DimensionlessSensor()
    for scheme, arrangement in (
        (es.Verlet(es.Upwind(sensor=sensor), correction=es.PairAreas()), es.Current()),
        (es.Verlet(es.Upwind(sensor=sensor)), None),
        (es.Verlet(es.Upwind(stress=True)), None),
        (es.LaxWendroff(limiter=es.FluxCorrectedTransport()), es.Current()),
    ):
        yield es.Simulation(body, scheme=scheme, dtype=dtype, **({"arrangement": arrangement} if arrangement else {}))
    apart = [dataclasses.replace(body, x=body.x + 2.0 * k, name=f"run {k}") for k in range(2)]
    held = [es.Fixed(lambda X: X[:, 0] % 2.0 < 0.2), es.Damping(body="run 1")]
    yield es.Simulation(apart, boundaries=held, independent=True, arrangement=es.Current(), dtype=dtype)


def touching(dim, dtype):
    """Water by default on a floor, between two blocks that touch, rub and may break."""
    steel = es.NeoHookean(density=7800.0, young=2e9, poisson=0.3)
    brittle = Failing(material=steel, failure=PrincipalStrain(energy=1e3, strain=0.01))
    solid, up = block(dim, 5), np.eye(dim)[-1]
    lower = dataclasses.replace(solid, material=steel, name="lower")
    upper = dataclasses.replace(solid, x=solid.x + up, material=brittle, name="upper")
    water = es.TaitLiquid(density=1e3, sound_speed=30.0)
    liquid = dataclasses.replace(solid, x=solid.x + 2.0 * up, material=water, name="water")
    yield es.Simulation([lower, upper, liquid], interactions=[es.Contact(friction=0.3)], dtype=dtype)
    floor = es.RigidBody(Plane(normal=up), centre=2.0 * up)
    yield es.Simulation(liquid, interactions=[floor], dtype=dtype)


@pytest.mark.parametrize(("dim", "dtype", "arch"), CASES)
def test_kernels_of_a_step_compile_and_do_not_spill(dim, dtype, arch, monkeypatch, tmp_path):
    launched = {}
    launch = wp.launch

    def recording_launch(kernel, *args, **kwargs):
        launched[kernel.module.name] = kernel.module
        return launch(kernel, *args, **kwargs)

    monkeypatch.setattr(wp, "launch", recording_launch)
    monkeypatch.setattr(execution, "_simd", False)  # the portable kernels, which GPUs run
    for simulation in itertools.chain(problems(dim, dtype), touching(dim, dtype), options(dim, dtype)):
        simulation.step(2)
        simulation.energy()
        simulation.momentum()
    assert len(launched) > 25
    found = {}
    for module in launched.values():
        (path,) = wp.compile_aot_module(module, arch=arch, module_dir=tmp_path, use_ptx=False)
        found |= usage(path)
    kernels = {name: kernel for name, kernel in found.items() if not name.startswith("$")}  # others are subroutines
    for name, kernel in sorted(kernels.items(), key=lambda item: -item[1].registers):
        print(f"{kernel.registers:4d} registers, {kernel.frame} bytes of local memory: {name}")
    assert len(kernels) >= len(launched)
    assert all(kernel.registers > 0 for kernel in kernels.values())
    assert not {name: function.frame for name, function in found.items() if function.frame}
