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
from warp_eulsph.interactions import Driven, Free, Plane, Sphere
from warp_eulsph.materials import (
    J2,
    DruckerPrager,
    Failing,
    IdealGas,
    JohnsonCook,
    JohnsonCookFailure,
    LinearElastic,
    LinearHardening,
    MieGruneisen,
    MooneyRivlin,
    NearlyIncompressible,
    NeoHookeanLog,
    Newtonian,
    PlasticStrain,
    PowerLaw,
    PrincipalStrain,
    PrincipalStress,
    SaintVenantKirchhoff,
    StiffenedGas,
    Tabulated,
    Voce,
)

CASES = [
    pytest.param(3, wp.float32, 90),
    pytest.param(1, wp.float32, 80, marks=pytest.mark.slow),
    pytest.param(2, wp.float64, 80, marks=pytest.mark.slow),
    pytest.param(3, wp.float64, 90, marks=pytest.mark.slow),
]
# CUDA's sine and cosine of large angles have local memory.
OF_ONE_THREAD = "_make_carry"


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


WATER = es.TaitLiquid(density=1e3, sound_speed=30.0)


def touching(dim, dtype):
    """Water by default on a floor, between two blocks that touch, rub and may break."""
    steel = es.NeoHookean(density=7800.0, young=2e9, poisson=0.3)
    brittle = Failing(material=steel, failure=PrincipalStrain(energy=1e3, strain=0.01))
    solid, up = block(dim, 5), np.eye(dim)[-1]
    lower = dataclasses.replace(solid, material=steel, name="lower")
    upper = dataclasses.replace(solid, x=solid.x + up, material=brittle, name="upper")
    liquid = dataclasses.replace(solid, x=solid.x + 2.0 * up, material=WATER, name="water")
    yield es.Simulation([lower, upper, liquid], interactions=[es.Contact(friction=0.3)], dtype=dtype)
    floor = es.RigidBody(Plane(normal=up), centre=2.0 * up)
    yield es.Simulation(liquid, interactions=[floor], dtype=dtype)


def laws(dim):
    """Those that no other simulation has, of metals by every hardening and failure."""
    rubber = {"density": 1100.0, "young": 17e6, "poisson": 0.3}
    yield from (law(**rubber) for law in (LinearElastic, SaintVenantKirchhoff, NeoHookeanLog))
    yield MooneyRivlin(density=1100.0, c10=1e6, c01=1e5, bulk=1e8)
    yield NearlyIncompressible(density=1100.0, shear=1e6, bulk=1e8)
    metals = [
        J2(**rubber, hardening=hardening)
        for hardening in (
            LinearHardening(yield_stress=1e6),
            Voce(yield_stress=1e6, saturation=2e6, rate=10.0),
            Tabulated(strains=[0.0, 0.1], stresses=[1e6, 2e6]),
        )
    ]
    yield from metals
    metal = metals[0]
    yield Failing(material=metal, failure=PlasticStrain(energy=1e5, strain=0.1))
    yield Failing(material=metal, failure=JohnsonCookFailure(energy=1e5, D1=0.05, D2=3.44, D3=-2.12))
    yield Failing(material=es.NeoHookean(**rubber), failure=PrincipalStress(energy=1e3, strength=1e6))
    yield StiffenedGas(density=1e3, gamma=4.4, stiffness=6e8, pressure=1e5)
    honey = PowerLaw(consistency=10.0, exponent=0.5, least=1.0, largest=100.0)
    yield es.TaitLiquid(density=1e3, sound_speed=30.0, viscosity=honey)


def others(dim, dtype):
    """Every other law, weight, correction, condition and motion of a rigid body."""
    body, along = block(dim, 5), np.eye(dim)[0]
    apart = [
        dataclasses.replace(body, x=body.x + 3.0 * k * along, velocity=0.1 * body.x, material=law, name=f"body {k}")
        for k, law in enumerate(laws(dim))
    ]
    yield es.Simulation(apart, dtype=dtype)
    current = {"arrangement": es.Current(), "dtype": dtype}
    for weight in (es.QuarticSpline(), es.QuinticSpline(), es.WendlandC4(), es.WendlandC6()):
        yield es.Simulation(body, weight=weight, **current)
        yield es.Simulation(dataclasses.replace(body, material=WATER), weight=weight, dilation=1.8, dtype=dtype)
    for correction in (es.PlainVolume(), es.SurfaceVectors()):
        yield es.Simulation(body, scheme=es.Verlet(correction=correction), **current)
    yield es.Simulation(body, reference=es.WhenDistorted(1.01), **current)
    yield es.Simulation(body, scheme=es.Lax(), dtype=dtype)
    end = {"region": lambda X: X[:, 0] > 0.8}
    conditions = [
        es.Clamped(0.0 * along, -along, lambda X: X[:, 0] < 0.2),
        es.Gravity(),
        es.BodyForce(lambda x, t: 1.0 * x),
        es.Traction(along, along, **end),
        es.Pressure(1e3),
        es.Pressure(1e3, **end, normal=along),
        es.Damping(),
        es.Damping(rate=1.0),
    ]
    yield es.Simulation(body, boundaries=conditions, dtype=dtype)
    mirrored, ghosts = es.mirror(body, point=0.0 * along, normal=-along, depth=1.6)
    moved = [ghosts, es.Motion(lambda X, t: 0.1 * t * X, **end), es.Roller(lambda X: X[:, 0] < 0.2, along)]
    yield es.Simulation(mirrored, boundaries=moved, dtype=dtype)
    for motion in (Driven(lambda x, t: 0.1 * t * along), Free(mass=10.0)):
        ball = es.RigidBody(Sphere(0.5), centre=-0.51 * along + 0.5 * (1.0 - along), motion=motion)
        yield es.Simulation(body, interactions=[ball], scheme=es.LaxWendroff(), dtype=dtype)


@pytest.mark.parametrize(("dim", "dtype", "arch"), CASES)
def test_kernels_of_a_step_compile_and_do_not_spill(dim, dtype, arch, monkeypatch, tmp_path):
    launched = {}
    launch = wp.launch

    def recording_launch(kernel, *args, **kwargs):
        launched[kernel.module.name] = kernel.module
        return launch(kernel, *args, **kwargs)

    monkeypatch.setattr(wp, "launch", recording_launch)
    monkeypatch.setattr(execution, "_simd", False)  # the portable kernels, which GPUs run
    simulations = [problems, touching, options]
    if (dim, dtype) != CASES[0].values[:2]:
        simulations.append(others)  # half as much again
    for simulation in itertools.chain.from_iterable(of(dim, dtype) for of in simulations):
        simulation.step(2)
        simulation.energy()
        simulation.momentum()
    assert len(launched) > 25
    found, spilled = {}, {}
    for module in launched.values():
        (path,) = wp.compile_aot_module(module, arch=arch, module_dir=tmp_path, use_ptx=False)
        functions = usage(path)
        found |= functions
        if not any(name.startswith(OF_ONE_THREAD) for name in functions):
            spilled |= {name: function.frame for name, function in functions.items() if function.frame}
    kernels = {name: kernel for name, kernel in found.items() if not name.startswith("$")}  # others are subroutines
    for name, kernel in sorted(kernels.items(), key=lambda item: -item[1].registers):
        print(f"{kernel.registers:4d} registers, {kernel.frame} bytes of local memory: {name}")
    assert len(kernels) >= len(launched)
    assert all(kernel.registers > 0 for kernel in kernels.values())
    assert not spilled
