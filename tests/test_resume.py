"""A simulation restored into a freshly built one goes on bit for bit, whatever its arrays held before."""

import dataclasses

import numpy as np
import pytest
import warp as wp
from bodies import RUBBER, bits, lattice

import warp_eulsph as es
from warp_eulsph.boundaries import Bound
from warp_eulsph.commands.loading import examples, load_case
from warp_eulsph.output.checkpoint import decode, encode, take
from warp_eulsph.output.description import describe, differences

REFERENCES = [es.Never(), es.Every(3), es.WhenDistorted(1.01), es.Always()]
SCHEMES = {
    "default": es.Verlet(),
    "M10": es.Verlet(correction=es.SurfaceVectors()),
    "M11": es.Verlet(correction=es.PairAreas(kappa=float("inf"))),
    "M12": es.LaxWendroff(correction=es.PairAreas()),
    "limiter": es.LaxWendroff(limiter=es.FluxCorrectedTransport(sensor=es.DimensionlessSensor())),
    "limiter, sensor": es.Verlet(
        dissipation=es.Upwind(sensor=es.DimensionlessSensor()),
        limiter=es.FluxCorrectedTransport(sensor=es.DimensionlessSensor(), values=es.Linear(), conservative=False),
    ),
    "paper": es.LaxWendroff(smoothing=es.NeighbourAverage()),
    "linear": es.LaxWendroff(smoothing=es.LinearExact()),
    "Lax": es.Lax(),
    "shifting": es.Verlet(shifting=es.Shifting()),
}


def blocks(dim, reference=es.Always(), scheme=es.Verlet(), dtype=wp.float64):
    """Two jittered blocks in shear and stretch: one held and driven, one free and under pressure."""
    n = {1: 9, 2: 9, 3: 4}[dim]  # in 2-D some particles are far enough from the surface to be shifted
    x = lattice(dim, n)
    x += 0.05 / n * np.random.default_rng(3).uniform(-1, 1, x.shape)
    velocity = 60.0 * np.sin(2.0 * np.roll(x, 1, axis=1) + x)
    bodies = [
        es.Body(x=x + 3 * k, volume=n**-dim, material=RUBBER, velocity=velocity * (1 - 0.3 * k), name=name)
        for k, name in enumerate(("held", "free"))
    ]
    boundaries = [
        es.Fixed(lambda X: X[:, 0] < 1.0 / n, body="held"),
        es.Velocity(lambda X: X[:, 0] > 1.0 - 1.0 / n, value=lambda x, t: 5.0 * np.sin(1e3 * t), body="held"),
        es.Pressure(1e5, body="free"),
        es.Pressure(1e5, lambda X: X[:, 0] > 4.0 - 1.0 / n, body="free"),
        es.Clamped([3.0] * dim, -np.eye(dim)[0], body="free"),
    ]
    simulation = es.Simulation(
        bodies,
        boundaries=boundaries,
        reference=reference,
        arrangement=es.Current(),
        scheme=scheme,
        time_step=es.TimeStep(growth=1.05),
        dtype=dtype,
    )
    simulation.clock.fields.free_dt.fill_(1e-4)  # as after shorter steps, so that the last bounds the next
    return simulation


def reachable(simulation):
    """Every Warp array and number that the simulation's own objects hold, by path; each array once."""
    arrays, numbers, seen = {}, {}, set()

    def walk(value, path):
        if id(value) in seen or isinstance(value, str | bytes | type | np.ndarray | wp.Function | wp.Module):
            return
        if isinstance(value, bool | int | float):
            numbers[path] = value
            return
        seen.add(id(value))
        if isinstance(value, wp.array):
            arrays[path] = value
        elif isinstance(value, dict):
            for key, item in value.items():
                if not isinstance(key, tuple):  # recorded launches: their arrays belong to others
                    walk(item, f"{path}.{key}")
        elif isinstance(value, list | tuple):
            for i, item in enumerate(value):
                walk(item, f"{path}.{i}")
        elif hasattr(value, "_cls") and hasattr(value, "_ctype"):  # an instance of a wp.struct
            for name in value._cls.vars:
                walk(getattr(value, name), f"{path}.{name}")
        elif type(value).__module__.startswith(("warp_eulsph", __name__)) and not dataclasses.is_dataclass(value):
            for name, item in vars(value).items():
                walk(item, f"{path}.{name}")

    walk(simulation, "simulation")
    return arrays, numbers


def rows(array):
    """The bytes of each element, (n, size)."""
    values = np.ascontiguousarray(array.numpy())
    return values.view(np.uint8).reshape(len(values), -1) if len(values) else np.zeros((0, 1), dtype=np.uint8)


def spoil(simulation, changed):
    """Not-a-number into every real element that steps change, by path of its array."""
    arrays, _ = reachable(simulation)
    for path in changed.keys() & arrays.keys():
        if arrays[path].dtype in (wp.int32, wp.uint64):
            continue  # lists, whose old entries are as wrong as any but crash no kernel
        values = arrays[path].numpy().copy()
        values[changed[path] if len(changed[path]) == len(values) else slice(None)] = np.nan
        arrays[path].assign(values)


def resume_is_exact(build, before, after):
    whole = build()
    fresh, _ = reachable(whole)
    fresh = {path: rows(array).copy() for path, array in fresh.items()}
    whole.step(before)
    arrays, numbers = reachable(whole)
    changed = {}
    for path, array in arrays.items():
        now, before_it = rows(array), fresh.get(path)
        same_shape = before_it is not None and before_it.shape == now.shape
        moved = (now != before_it).any(axis=1) if same_shape else np.ones(len(now), dtype=bool)
        if moved.any():
            changed[path] = moved
    known = {id(whole.stepper.U.x), id(whole.stepper.ledger._total)}  # under whatever name they were met first
    assert known <= {id(arrays[path]) for path in changed}, "the walk misses arrays"
    stored = decode(b"".join(encode(take(whole, {}, {}))))
    whole.step(after)

    resumed = build()
    spoil(resumed, changed)
    resumed.stepper.steps, resumed.stepper.ledger.start = 12345, -1.0
    resumed.restore(stored.arrays, stored.counters)
    resumed.step(after)
    assert bits(resumed) == bits(whole)
    # But room in the lists, which is not what is in them, how often, and when it is looked whether bodies have met
    theirs = ("lists._builds", "lists.cells._stride", "encounters._due", "nearby.searches")
    kept = [path for path in numbers if not path.endswith(theirs)]
    there, here = reachable(resumed)[1], reachable(whole)[1]
    assert not [path for path in kept if there[path] != here[path]]


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("reference", REFERENCES, ids=repr)
def test_resume_is_bitwise_for_every_reference(reference, dim, dtype):
    resume_is_exact(lambda: blocks(dim, reference, dtype=dtype), before=7, after=8)


@pytest.mark.parametrize("reference", REFERENCES, ids=repr)
@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_resume_is_bitwise_for_every_scheme(scheme, reference):
    resume_is_exact(lambda: blocks(2, reference, scheme), before=5, after=6)


def test_histories_of_materials_are_restored():
    from test_materials import Remembering

    body = blocks(2).bodies[0]
    material = Remembering(density=1100.0, young=17e6, poisson=0.45)
    remembering = es.Body(x=body.x, volume=body.volume, material=material, velocity=body.velocity)
    resume_is_exact(lambda: es.Simulation(remembering), before=5, after=6)
    simulation = es.Simulation(remembering)
    simulation.step(5)
    assert simulation.evolving()["Flux.history.0"].numpy().any()


class Ratchet(es.Boundary):
    """A condition with a memory: it holds what was the greatest speed so far as a load."""

    def bind(self, assembly):
        return BoundRatchet(assembly)


@wp.kernel
def hold(v: wp.array(dtype=wp.vec2d), greatest: wp.array(dtype=wp.float64), external: wp.array(dtype=wp.vec2d)):
    a = wp.tid()
    greatest[a] = wp.max(greatest[a], wp.length(v[a]))
    external[a] = external[a] + wp.vec2d(greatest[a], wp.float64(0.0))


class BoundRatchet(Bound):
    def __init__(self, assembly):
        self.indices = assembly.select(None, None, "Ratchet")
        self.greatest = wp.zeros(len(self.indices), dtype=wp.float64, device=assembly.device)

    def load(self, state, clock, fraction, external):
        wp.launch(hold, len(self.greatest), [state.v, self.greatest, external], device=self.greatest.device)

    def evolving(self):
        return {"greatest": self.greatest}


def test_conditions_with_a_memory_are_restored():
    body = blocks(2).bodies[0]
    resume_is_exact(lambda: es.Simulation(body, boundaries=[Ratchet()]), before=5, after=6)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(BoundRatchet, "evolving", Bound.evolving)
        with pytest.raises((AssertionError, ValueError, es.UnstableError)):
            resume_is_exact(lambda: es.Simulation(body, boundaries=[Ratchet()]), before=5, after=6)


@pytest.mark.parametrize("name", ["State.x", "Clock.t", "Clock.free_dt", "Ledger.total", "Reference.F"])
def test_an_array_that_is_not_listed_is_found_out(name, monkeypatch):
    everything = es.Simulation.evolving
    monkeypatch.setattr(
        es.Simulation, "evolving", lambda self: {key: a for key, a in everything(self).items() if key != name}
    )
    with pytest.raises((AssertionError, ValueError, es.UnstableError)):
        resume_is_exact(lambda: blocks(2, es.Every(4)), before=6, after=3)


def test_arrays_of_another_simulation_are_refused():
    small, large = blocks(2), blocks(3)
    x = small.x
    with pytest.raises(ValueError, match=r"restore: arrays must have names and shapes of this simulation, .* differs"):
        small.restore(take(large, {}, {}).arrays, large.counters)
    assert np.array_equal(small.x, x)


def test_description_tells_simulations_apart():
    assert not differences(describe(blocks(2)), describe(blocks(2)))
    changes = differences(describe(blocks(2)), describe(blocks(2, es.Never(), es.LaxWendroff())))
    assert "reference.type: Always, now Never" in changes and "scheme.type: Verlet, now LaxWendroff" in changes


@pytest.mark.parametrize("name", [name for name in examples() if name not in ("amplification", "cosine_profile")])
def test_resume_is_bitwise_for_every_example(name):
    """Those of transported quantities are in test_transport.py."""
    coarse = load_case(f"example:{name}", ["parameters.n=6"])
    resume_is_exact(coarse.build, before=4, after=4)
