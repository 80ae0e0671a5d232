"""Damping in proportion to mass, for quasi-static answers."""

import functools
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..execution import Launcher
from ..fields import clock_structure, structure
from ..reduce import SumOfParticles
from ..space import Space, vector_type
from ..structs import ClockArrays, ForceArrays, StateArrays
from .base import Assembly, Bound, Boundary

# Most of its velocity that a particle loses in a step. With c Δt of this the stable step of (M14), from
# ω² Δt² < 4 − 2 c Δt, is 6 % shorter: a small part of what the default Courant number leaves.
MOST = 0.25


@dataclass(frozen=True)
class Damping(Boundary):
    """Force −c m v on all of a body: motion dies away and the bodies come to rest in equilibrium (dynamic relaxation).

    Its work has an account of its own, ``energy()["damping"]``. ``settle`` steps until loads and stresses balance. It
    holds back what moves as a whole too, so it is for bodies that are held. A step takes a quarter of the velocity at
    most.

    By default c is twice the lowest frequency at work, which the body itself tells in every step (critical damping):
    c = 2 ω with ω² = −Σ Δx·Δf / Σ m Δx², the Rayleigh quotient of what moves (Underwood, Dynamic relaxation, in:
    Computational Methods for Transient Analysis, North-Holland, 1983).

    Args:
        rate: c [1/s]; None follows the lowest frequency.
        body: name of the body, all by default.

    Raises:
        ValueError: a rate that is not positive and finite.
    """

    rate: float | None = None
    body: str | None = None

    def __post_init__(self) -> None:
        if self.rate is not None and not (np.isfinite(self.rate) and self.rate > 0.0):
            raise ValueError(f"Damping: rate must be positive and finite, got {self.rate}; None follows the body")

    def bind(self, assembly: Assembly) -> "BoundDamping":
        return BoundDamping(self, assembly)


@functools.cache
def _make_quotient(space: Space) -> wp.Kernel:
    """Kernel of ``SumOfParticles``: −Δx·Δf and m Δx² since the last step, f the forces of the material."""
    vec, Particles, State, Forces = space.vec, *(structure(space, name) for name in ("Particles", "State", "Forces"))
    Clock, precise, pair = clock_structure(space), vector_type(space.dim, wp.float64), wp.vec2d

    @wp.kernel(module="unique", enable_backward=False)
    def quotient(
        first: int,
        bounds: wp.array(dtype=wp.int32),
        places: wp.array(dtype=wp.int32),
        particles: Particles,
        state: State,
        forces: Forces,
        clock: Clock,
        x: wp.array(dtype=vec),
        f: wp.array(dtype=vec),
        out: wp.array(dtype=pair),
    ):
        block = first + wp.tid()
        total = pair()
        for k in range(bounds[block], bounds[block + 1]):
            a = places[k]
            if clock.dt[clock.run[a]] > wp.float64(0.0):
                force = forces.internal[a] + forces.correction[a] + forces.tie[a]
                dx, df = precise(state.x[a] - x[k]), precise(force - f[k])
                total += pair(-wp.dot(dx, df), wp.float64(particles.mass[a]) * wp.dot(dx, dx))
                x[k] = state.x[a]
                f[k] = force
        out[block] = total

    return quotient


@functools.cache
def _make_follow() -> wp.Kernel:
    """Kernel: c = 2 ω, as it was where nothing moves."""

    @wp.kernel(module="unique", enable_backward=False)
    def follow(sums: wp.array(dtype=wp.vec2d), rate: wp.array(dtype=wp.float64)):
        if sums[0][1] > wp.float64(0.0):
            rate[0] = wp.float64(2.0) * wp.sqrt(wp.max(sums[0][0], wp.float64(0.0)) / sums[0][1])

    return follow


@functools.cache
def _make_damp(space: Space) -> wp.Kernel:
    real, Particles, State, Forces = space.real, *(structure(space, name) for name in ("Particles", "State", "Forces"))
    Clock = clock_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def damp(
        first: int,
        places: wp.array(dtype=wp.int32),
        particles: Particles,
        state: State,
        clock: Clock,
        rate: wp.array(dtype=wp.float64),
        forces: Forces,
    ):
        a = places[first + wp.tid()]
        c = rate[0]
        dt = clock.dt[clock.run[a]]
        if dt > wp.float64(0.0):
            c = wp.min(c, wp.float64(wp.static(MOST)) / dt)
        force = -state.v[a] * (real(c) * particles.mass[a])
        forces.damping[a] = forces.damping[a] + force
        forces.external[a] = forces.external[a] + force

    return damp


class BoundDamping(Bound):
    """Adds the force, and measures the frequency that it follows."""

    reads_surface = False
    recordable = True
    sortable = True

    def __init__(self, condition: Damping, assembly: Assembly):
        self.space, self.device, self.particles = assembly.space, assembly.device, assembly.particles
        self._launch = Launcher(assembly.device)
        self.follows = condition.rate is None
        self.indices = assembly.select(None, condition.body, "Damping")
        self.independent = not self.follows or condition.body is not None
        self._places = assembly.order.places_of(self.indices)
        n = len(self.indices)
        self._rate = wp.full(1, condition.rate or 0.0, dtype=wp.float64, device=self.device)
        self._x, self._f = (wp.zeros(n if self.follows else 0, dtype=self.space.vec, device=self.device) for _ in "xf")
        self._sums = wp.zeros(1, dtype=wp.vec2d, device=self.device)
        self._sum = SumOfParticles(wp.vec2d, [n], self.device)

    def start(self, state: StateArrays) -> None:
        if self.follows:
            wp.copy(self._x, state.x[self._places].contiguous())

    def damp(self, state: StateArrays, clock: ClockArrays, forces: ForceArrays) -> None:
        if self.follows:
            arguments = [self._places, self.particles, state, forces, clock, self._x, self._f]
            self._sum(_make_quotient(self.space), arguments, self._sums)
            self._launch.once(_make_follow(), 1, [self._sums, self._rate])
        arguments = [self._places, self.particles, state, clock, self._rate, forces]
        self._launch(_make_damp(self.space), len(self.indices), arguments)

    def evolving(self) -> dict[str, wp.array]:
        return {"rate": self._rate, "x": self._x, "f": self._f} if self.follows else {}
