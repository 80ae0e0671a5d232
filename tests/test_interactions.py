"""Forces between bodies, or with something rigid: momentum pair by pair, an account, a step of their own."""

import dataclasses
import functools
from dataclasses import dataclass

import numpy as np
import pytest
import warp as wp
from bodies import RUBBER, bits, block, lattice

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.fields import clock_structure, structure
from warp_eulsph.geometry import disc
from warp_eulsph.interactions import BoundInteraction
from warp_eulsph.output import Recording, Run, record
from warp_eulsph.output.record import ChangedCaseError
from warp_eulsph.schedule import AtTimes


@functools.cache
def _make_push(space):
    """Kernel: k (reach − r)₊ away from each particle of the other body; the same number at both ends."""
    real, vec, State = space.real, space.vec, structure(space, "State")

    @wp.kernel(module="unique", enable_backward=False)
    def push(
        state: State,
        places: wp.array(dtype=wp.int32),
        split: int,
        stiffness: real,
        reach: real,
        out: wp.array(dtype=vec),
        energy: wp.array(dtype=wp.float64),
    ):
        k = wp.tid()
        a = places[k]
        first = int(0)
        last = split
        if k < split:
            first = split
            last = places.shape[0]
        force = vec()
        stored = wp.float64(0.0)
        for j in range(first, last):
            r = state.x[places[j]] - state.x[a]
            depth = reach - wp.length(r)
            if depth > real(0.0):
                force -= r * (stiffness * depth / wp.length(r))
                stored += wp.float64(real(0.25) * stiffness * depth * depth)
        out[a] = out[a] + force
        energy[k] = stored

    return push


@functools.cache
def _make_ask(space):
    real, Particles, Clock = space.real, structure(space, "Particles"), clock_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def ask(particles: Particles, places: wp.array(dtype=wp.int32), stiffness: real, clock: Clock):
        mass = particles.mass[places[wp.tid()]]
        wp.atomic_max(clock.frequency, 0, wp.sqrt(real(2.0) * stiffness / mass))

    return ask


@dataclass(frozen=True)
class Cushion(es.Interaction):
    """Particles of two bodies nearer than ``reach`` [m] push each other away by k (reach − r), k in N/m."""

    bodies: tuple[str, str]
    stiffness: float
    reach: float
    together: int = 4  # so many pairs of a particle may be within reach

    def bind(self, assembly):
        return BoundCushion(self, assembly)


class BoundCushion(BoundInteraction):
    recordable = sortable = True

    def __init__(self, option, assembly):
        self.option, self.space = option, assembly.space
        sides = [assembly.select(None, name, "Cushion") for name in option.bodies]
        self.indices, self.split = np.concatenate(sides), len(sides[0])
        self.places = assembly.order.places_of(self.indices)
        self._energy = wp.zeros(len(self.indices), dtype=wp.float64, device=assembly.device)
        self._nothing = wp.zeros(len(assembly.X), dtype=assembly.space.vec, device=assembly.device)

    def forces(self, world, state, fraction, out):
        arguments = [state, self.places, self.split, self.option.stiffness, self.option.reach, out, self._energy]
        wp.launch(_make_push(self.space), len(self.places), arguments, device=out.device)

    def rate(self, world):
        stiffness = self.option.stiffness * self.option.together
        arguments = [world.particles, self.places, stiffness, world.clock.fields]
        wp.launch(_make_ask(self.space), len(self.places), arguments, device=world.device)

    def energy(self, world):
        self.forces(world, world.U, 0.0, self._nothing)
        return float(self._energy.numpy().sum())


@dataclass(frozen=True)
class Anchor(es.Interaction):
    """A rigid mass [kg] that moves along, tied to a body by a spring [N/m] from each of its particles."""

    body: str
    mass: float
    stiffness: float

    def bind(self, assembly):
        return BoundAnchor(self, assembly)


class BoundAnchor(BoundInteraction):
    """The mass begins at the body's centre, at rest; the step is written in numpy."""

    def __init__(self, option, assembly):
        self.option, self.space = option, assembly.space
        self.indices = assembly.select(None, option.body, "Anchor")
        centre = assembly.X[self.indices].mean(axis=0)
        self.rest = assembly.X[self.indices] - centre
        self.x = wp.array([centre], dtype=wp.vec2d, device=assembly.device)
        self.v = wp.zeros(1, dtype=wp.vec2d, device=assembly.device)
        self._taken = np.zeros(2)

    def _stretch(self, x, centre):
        return x.numpy()[self.indices] - centre - self.rest

    def forces(self, world, state, fraction, out):
        centre = self.x.numpy()[0] + fraction * world.clock.dt * self.v.numpy()[0]
        pull = -self.option.stiffness * self._stretch(state.x, centre)
        self._taken = -pull.sum(axis=0)
        total = out.numpy()
        total[self.indices] += pull
        out.assign(total)

    def rate(self, world):
        k = self.option.stiffness
        heaviest = k / world.particles.mass.numpy()[self.indices].min() + k * len(self.indices) / self.option.mass
        world.clock.fields.frequency.fill_(np.sqrt(heaviest))

    def advance(self, world):
        before = self.v.numpy()[0].copy()
        after = before + world.clock.dt / self.option.mass * self._taken
        self.v.assign([after])
        self.x.assign([self.x.numpy()[0] + world.clock.dt * 0.5 * (before + after)])

    def energy(self, world):
        stretch = self._stretch(world.U.x, self.x.numpy()[0])
        kinetic = 0.5 * self.option.mass * (self.v.numpy()[0] ** 2).sum()
        return float(0.5 * self.option.stiffness * (stretch**2).sum() + kinetic)

    def evolving(self):
        return {"x": self.x, "v": self.v}


def colliding(dtype=wp.float64, **options):
    """Two blocks of rubber that bounce off each other."""
    left = block(2, 8, velocity=(5.0, 0.5), name="left")
    x = left.x + np.array([1.1, 0.2])
    right = es.Body(x=x, volume=1 / 64, material=RUBBER, velocity=(-3.0, 0.0), name="right")
    cushion = Cushion(("left", "right"), stiffness=2e7, reach=1 / 8)
    return es.Simulation([left, right], interactions=[cushion], dtype=dtype, **options)


@pytest.mark.parametrize("graphs", [False, True], ids=["by the host", "by graphs"])
@pytest.mark.parametrize("scheme", [es.Verlet(), es.LaxWendroff()], ids=["Verlet", "LaxWendroff"])
def test_blocks_bounce_with_their_momentum_and_energy(scheme, graphs):
    simulation = colliding(scheme=scheme)
    simulation.by_graphs = graphs
    momentum, about, start = simulation.momentum(), simulation.angular_momentum(), simulation.energy()["total"]
    simulation.run(0.02)
    pressed = simulation.energy()
    assert pressed["held"] > 0.01 * start
    assert abs(pressed["residual"]) < 1e-12 * start
    simulation.run(0.06)
    energy = simulation.energy()
    left = slice(0, 64)
    assert simulation.v[left, 0].mean() < 0.0 < simulation.v[64:, 0].mean()
    assert energy["held"] == 0.0 and abs(energy["external"]) < 1e-12 * start
    assert abs(energy["interaction"]) < 0.005 * start  # the error of the steps
    assert abs(energy["residual"]) < 1e-12 * start
    scale = 1100.0 * 5.0
    assert np.abs(simulation.momentum() - momentum).max() < 1e-12 * scale
    assert np.abs(simulation.angular_momentum() - about).max() < 1e-3 * scale  # that of M9; pair forces are central


def test_graphs_sorting_and_host_agree():
    found = []
    for graphs in (False, True):
        simulation = colliding()
        assert simulation.sorting.on
        simulation.by_graphs = graphs
        simulation.step(60)
        found.append(bits(simulation))
    assert found[0] == found[1]


def test_the_step_is_what_the_interaction_asks_for():
    simulation = colliding()
    alone = es.Simulation(simulation.bodies)
    for each in (simulation, alone):
        each.step()
    half = 0.5 * np.sqrt(2.0 * 4 * 2e7 / (1100.0 / 64))
    assert simulation.dt == pytest.approx(0.8 / np.hypot(0.8 / alone.dt, half), rel=1e-9)


def anchored(**options):
    """A block that drifts and stretches, and the mass that it takes along."""
    velocity = np.array([2.0, 1.0]) + 1.5 * (lattice(2, 5) - 0.5)
    body = block(2, 5, velocity=velocity, name="body")
    return es.Simulation(body, interactions=[Anchor("body", mass=500.0, stiffness=1e6)], **options)


@pytest.mark.parametrize("scheme", [es.Verlet(), es.LaxWendroff()], ids=["Verlet", "LaxWendroff"])
def test_a_rigid_mass_takes_what_the_body_gives(scheme):
    simulation = anchored(scheme=scheme)
    anchor = simulation.bound_interactions[0]
    momentum, start = simulation.momentum(), simulation.energy()["total"]
    simulation.run(0.05)
    energy = simulation.energy()
    taken = 500.0 * anchor.v.numpy()[0]
    assert np.abs(taken).max() > 100.0
    np.testing.assert_allclose(simulation.momentum() + taken, momentum, rtol=1e-12)
    assert energy["total"] == pytest.approx(energy["kinetic"] + energy["stored"] + energy["tied"] + energy["held"])
    assert abs(energy["interaction"]) < 0.01 * start
    assert abs(energy["residual"]) < 1e-12 * start


@dataclass(frozen=True)
class Springs(es.Interaction):
    """Particles of equal rank of two bodies are tied to each other, k in N/m, and damped, c in N s/m."""

    stiffness: float
    damping: float = 0.0

    def bind(self, assembly):
        return BoundSprings(self, assembly)


class BoundSprings(BoundInteraction):
    def __init__(self, option, assembly):
        self.option, self.ends = option, [np.array(numbers) for numbers in assembly.bodies.values()]
        self.indices = np.concatenate(self.ends)
        self.rest = assembly.X[self.ends[1]] - assembly.X[self.ends[0]]

    def _apart(self, field):
        values = field.numpy().astype(float)
        return values[self.ends[1]] - values[self.ends[0]]

    def forces(self, world, state, fraction, out):
        pull = self.option.stiffness * (self._apart(state.x) - self.rest) + self.option.damping * self._apart(state.v)
        forces = out.numpy()
        forces[self.ends[0]] += pull
        forces[self.ends[1]] -= pull
        out.assign(forces)

    def energy(self, world):
        return float(0.5 * self.option.stiffness * ((self._apart(world.U.x) - self.rest) ** 2).sum())


def sprung(dim, dtype, interaction, **options):
    """Two blocks apart, one of them at rest."""
    n = {1: 6, 2: 5, 3: 3}[dim]
    still = block(dim, n, name="still")
    moving = es.Body(
        x=still.x + 2.0, volume=still.volume, material=RUBBER, velocity=3.0, name="moving", reference=es.Never()
    )
    return es.Simulation([still, moving], interactions=[interaction], dtype=dtype, **options)


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_accounts_close_in_every_dimension(dim, dtype):
    """Springs give and take; dampers take, in their own account."""
    for interaction in (Springs(1e5), Springs(1e5, damping=300.0)):
        simulation = sprung(dim, dtype, interaction)
        start, momentum = simulation.energy()["total"], simulation.momentum()
        simulation.run(0.01)
        energy = simulation.energy()
        precision = 1e-12 if dtype is wp.float64 else 1e-5
        assert energy["held"] > 1e-3 * start
        assert abs(energy["residual"]) < precision * start
        np.testing.assert_allclose(simulation.momentum(), momentum, rtol=precision)
        lost = energy["interaction"] / start
        assert lost < -1e-2 if interaction.damping else abs(lost) < 1e-3


def test_errors_of_the_steps_are_of_second_order():
    found = []
    for steps in (20, 40):
        simulation = sprung(2, wp.float64, Springs(1e6), time_step=es.TimeStep(fixed=5e-3 / steps))
        simulation.step(steps)
        found.append(simulation.energy()["interaction"])
    assert found[1] == pytest.approx(found[0] / 4.0, rel=0.2)


@pytest.mark.parametrize("build", [colliding, anchored])
def test_resumed_runs_go_on_bit_for_bit(build):
    whole, resumed = build(), build()
    whole.step(30)
    arrays, counters = {name: array.numpy().copy() for name, array in whole.evolving().items()}, whole.counters
    resumed.step(4)
    resumed.restore(arrays, counters)
    whole.step(20)
    resumed.step(20)
    assert bits(resumed) == bits(whole)


WATER = es.TaitLiquid(density=1000.0, sound_speed=20.0)


def drop_in_ring(**options):
    """A drop of liquid, Eulerian, drawn out inside a rubber ring, total Lagrangian, until it presses on it."""
    spacing = 0.08
    x, volume = disc(centre=(0.0, 0.0), radius=1.0, spacing=spacing)
    outer = np.linalg.norm(x, axis=1) > 0.7
    material = es.NeoHookean(density=1100.0, young=1e6, poisson=0.4)
    ring = es.Body(x=x[outer], volume=volume[outer], material=material, name="ring", reference=es.Never())
    x, volume = disc(centre=(0.0, 0.0), radius=0.5, spacing=spacing)
    drop = es.Body(x=x, volume=volume, material=WATER, velocity=x * [4.0, -4.0], name="drop")
    cushion = Cushion(("ring", "drop"), stiffness=4e5, reach=spacing)
    return es.Simulation([ring, drop], interactions=[cushion], **options)


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
def test_a_drop_inside_a_total_lagrangian_ring(dtype):
    simulation = drop_in_ring(dtype=dtype)
    ring, drop = (simulation.ranges[name] for name in ("ring", "drop"))
    media = simulation.stepper.media
    assert [medium.configuration.fixed for medium in media] == [True, False]
    first = media[0].configuration.near.index.numpy().copy()
    start = simulation.energy()["total"]
    touched = 0.0
    for _ in simulation.frames(np.linspace(0.01, 0.2, 20)):
        touched = max(touched, simulation.energy()["held"])
    energy, x = simulation.energy(), simulation.x
    assert touched > 0.01 * start
    bulk = simulation.v[ring.start : ring.stop]
    assert (bulk**2).sum() > 0.0 and np.abs(simulation.displacement[ring.start : ring.stop]).max() > 0.01
    # no leaks: every particle of the drop has a particle of the ring further out in its direction
    inside, around = x[drop.start : drop.stop], x[ring.start : ring.stop]
    along = inside / np.linalg.norm(inside, axis=1)[:, None]
    across = np.abs(around[None] @ np.array([[0.0, 1.0], [-1.0, 0.0]]) @ along[..., None])[..., 0]
    out = np.where(across < 0.1, np.einsum("bj,aj->ab", around, along), 0.0).max(axis=1)
    assert (np.linalg.norm(inside, axis=1) < out).all()
    assert np.abs(simulation.momentum()).max() < (1e-9 if dtype is wp.float64 else 0.05)
    assert abs(energy["interaction"]) < 0.01 * start
    round_off = 1e-11 if dtype is wp.float64 else 1e-4
    assert abs(energy["residual"]) < round_off * start
    assert np.array_equal(media[0].configuration.near.index.numpy(), first)


def test_a_drop_inside_a_ring_resumes_bit_for_bit():
    execution.set_graphs(True)
    test_resumed_runs_go_on_bit_for_bit(drop_in_ring)


def test_recorded_runs_go_on_and_know_their_interactions(tmp_path):
    def run(directory, until, stiffness=4e5):
        simulation = drop_in_ring()
        option = dataclasses.replace(simulation.interactions[0], stiffness=stiffness)
        simulation = es.Simulation(simulation.bodies, interactions=[option])
        record(simulation, directory, until, Recording(snapshots=AtTimes([0.09, 0.1, 0.11])), resume=True)
        return simulation

    whole = run(tmp_path / "whole", 0.11)
    run(tmp_path / "parts", 0.1)
    assert bits(run(tmp_path / "parts", 0.11)) == bits(whole)
    log, of_whole = (Run(tmp_path / name).log for name in ("parts", "whole"))
    assert log["held"][-1] == of_whole["held"][-1]
    assert log["held"].max() > 0.0 > log["interaction"].min()
    with pytest.raises(ChangedCaseError, match=r"interactions.0.stiffness: 400000.0, now 500000.0"):
        run(tmp_path / "parts", 0.12, stiffness=5e5)


def test_what_is_no_interaction_is_named():
    with pytest.raises(ValueError, match=r"interactions\[0\] must be such as an Interaction, got Fixed"):
        es.Simulation(block(2, 4), interactions=[es.Fixed([0])])


def test_accounts_are_there_with_interactions_only():
    simulation = es.Simulation(block(2, 4))
    assert not {"held", "interaction"} & simulation.energy().keys()
    assert "Cushion" in repr(colliding())
