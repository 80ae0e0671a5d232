"""Conditions ask for the step that their forces need: a stiff penalty keeps energy."""

import functools
from dataclasses import dataclass

import numpy as np
import pytest
import warp as wp
from clouds import cloud

import warp_eulsph as es
from warp_eulsph.boundaries import Bound
from warp_eulsph.fields import clock_structure, structure

RUBBER = es.NeoHookean(density=1100.0, young=17e6, poisson=0.45)


@functools.cache
def _make_push(space):
    real, vec, State = space.real, space.vec, structure(space, "State")

    @wp.kernel(module="unique", enable_backward=False)
    def push(state: State, stiffness: real, external: wp.array(dtype=vec)):
        a = wp.tid()
        force = vec()
        force[0] = stiffness * wp.max(real(0.0), -state.x[a][0])
        external[a] = external[a] + force

    return push


@functools.cache
def _make_ask(space):
    real, Particles, Clock = space.real, structure(space, "Particles"), clock_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def ask(particles: Particles, stiffness: real, clock: Clock):
        wp.atomic_max(clock.frequency, 0, wp.sqrt(stiffness / particles.mass[wp.tid()]))

    return ask


@dataclass(frozen=True)
class PenaltyWall(es.Boundary):
    """Force k (−x) on particles behind x = 0, k in N/m."""

    stiffness: float
    asks: bool = True

    def bind(self, assembly):
        return (AskingWall if self.asks else BoundWall)(self, assembly)


class BoundWall(Bound):
    recordable = sortable = True
    reads_surface = False

    def __init__(self, condition, assembly):
        self.space, self.k, self.particles = assembly.space, condition.stiffness, assembly.particles
        self.indices = np.arange(len(assembly.X), dtype=np.int32)

    def load(self, state, clock, fraction, external):
        wp.launch(_make_push(self.space), len(external), [state, self.k, external], device=external.device)


class AskingWall(BoundWall):
    def limit(self, state, clock):
        arguments = [self.particles, self.k, clock]
        wp.launch(_make_ask(self.space), len(state.x), arguments, device=state.x.device)


def thrown(wall, **options):
    """A block of 1100 kg/m at 7.07 m/s towards a wall, 27.5 kJ/m."""
    x, volume = cloud(2, 10, jitter=0.0)
    body = es.Body(x=x, volume=volume, material=RUBBER, velocity=(-np.sqrt(50.0), 0.0))
    return es.Simulation(body, boundaries=[wall], **options)


FREE = es.Verlet(dissipation=None)  # so that nothing hides what the penalty makes


@pytest.mark.parametrize("graphs", [False, True], ids=["by the host", "by graphs"])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
def test_a_stiff_penalty_keeps_energy(dtype, graphs):
    simulation = thrown(PenaltyWall(1e9), scheme=FREE, dtype=dtype)
    simulation.by_graphs = graphs
    start = simulation.energy()["total"]
    assert start == pytest.approx(27.5e3, rel=1e-6)
    simulation.run(0.05)
    energy = simulation.energy()
    assert simulation.v[:, 0].mean() > 4.0  # it came back
    # and left: what the wall took it has given back, but for the error of steps of 0.8 times the longest stable one,
    # which is of second order: 4.6, 1.2 % at once and half the step
    assert abs(energy["external"]) < 0.05 * start
    half = thrown(PenaltyWall(1e9), scheme=FREE, dtype=dtype, time_step=es.TimeStep(cfl=0.4))
    half.run(0.05)
    assert abs(half.energy()["external"]) < 0.015 * start
    assert energy["total"] == pytest.approx(start, rel=0.05)


@pytest.mark.parametrize("scheme", [FREE, es.LaxWendroff()], ids=["Verlet", "LaxWendroff"])
def test_without_being_asked_it_makes_energy(scheme):
    """The step of the waves alone is 1.6 times the longest stable one of Verlet on the penalty.

    The midpoint rule grows at any step, by (ω Δt)⁴/8 a step, 5 % at its Courant number, while the wall is touched.
    """
    made = []
    for asks in (True, False):
        simulation = thrown(PenaltyWall(1e9, asks), scheme=scheme)
        simulation.run(0.05)
        made.append(simulation.energy()["external"])
    assert made[1] > 10.0 * max(made[0], 500.0)


def test_the_step_is_that_of_both_frequencies():
    """Δt = CFL/√(rate² + Σ (ω/2)²), no matter how many conditions share the stiffness."""
    omega = np.sqrt(1e9 / 11.0)
    free = thrown(es.Fixed([0]))
    free.step()
    for walls in ([PenaltyWall(1e9)], [PenaltyWall(4e8), PenaltyWall(6e8)]):
        simulation = es.Simulation(free.bodies, boundaries=walls)
        simulation.step()
        assert simulation.dt == pytest.approx(0.8 / np.hypot(0.8 / free.dt, omega / 2.0), rel=1e-12)
        assert simulation.dt * omega < 1.6


def test_graphs_and_host_agree_in_every_bit():
    found = []
    for graphs in (False, True):
        simulation = thrown(PenaltyWall(1e9))
        simulation.by_graphs = graphs
        simulation.step(40)
        found.append((simulation.x, simulation.v, simulation.energy(), simulation.dt))
    assert np.array_equal(found[0][0], found[1][0]) and np.array_equal(found[0][1], found[1][1])
    assert found[0][2:] == found[1][2:]
