"""Particle shifting: particles move towards an even arrangement, and what they carry moves with them (M15)."""

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..boundaries import Bound
from ..execution import Launcher
from ..fields import clock_structure, structure
from ..linalg import inverse
from ..space import Space
from ..structs import ClockArrays, ParticleArrays, StateArrays
from .exposure import Exposure
from .flux import Flux
from .laws import Part
from .projection import Projection, pad
from .reference import Configuration
from .time_step import takes_step

# Least value of what has none: a constant of a kernel must be finite, in float32 too.
NO_BOUND = -1e38


@dataclass(frozen=True)
class Shifting:
    """Before each refresh particles move by ½ rate ψ, ψ from the balance of the last one, with v and F remapped (M15).

    It keeps the arrangement even where stress is several times the modulus, for shear without end. It is not exact: a
    remap changes energy (account "shifting"), by some 1e-4 in bodies that need none. Momenta are kept by the least
    change. Particles with velocity conditions stay, and so do those at a free surface, or beside another body that
    they are bonded to, and all their neighbours: there sums are one-sided, and so is what says where to go. Positions
    of material points are not carried: conditions given by initial positions keep those of the particles.

    Args:
        rate: share of ½ψ taken in one refresh; 1 is the tested value.
        bound: largest distance moved in one refresh, over the particle's spacing.
    """

    rate: float = 1.0
    bound: float = 0.05

    def __post_init__(self) -> None:
        if not (math.isfinite(self.rate) and 0.0 < self.rate <= 2.0):
            raise ValueError(f"shifting rate must be in (0, 2], got {self.rate}; 1 is the tested value")
        if not (math.isfinite(self.bound) and 0.0 < self.bound <= 0.25):
            raise ValueError(
                f"shifting bound must be in (0, 0.25] spacings, got {self.bound}; 0.05 is the tested value"
            )

    def build(
        self, space: Space, particles: ParticleArrays, flux: Flux, held: np.ndarray, device: wp.DeviceLike
    ) -> "Shifter":
        """Allocate; ``held`` are places of particles that stay, (k,)."""
        return Shifter(self, space, particles, flux, held, device)


@functools.cache
def _make_stretch(space: Space) -> wp.Kernel:
    """Kernel: s of F = s I."""
    mat, row = space.mat, space.row(1)

    @wp.kernel(module="unique", enable_backward=False)
    def stretch(first: int, F: wp.array(dtype=mat), out: wp.array(dtype=row)):
        a = first + wp.tid()
        out[a] = row(F[a][0, 0])

    return stretch


@functools.cache
def _make_shift(space: Space, even: bool) -> wp.Kernel:
    """Kernel: x += G δ, F += ∇_k F · δ, impulse m ∇_k v · δ and its couple, δ = ½ rate ψ in the reference (M15), kept.

    With ``even`` F is s I, and the gradient given is that of s. Nothing moves once the target time is reached or the
    run has failed.
    """
    real, vec, mat, dim = space.real, space.vec, space.mat, space.dim
    rows, invert, padded = space.row_gradient(1 if even else dim**2), inverse(space), pad(space)
    Particles, Reference, State = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        structure(space, "State"),
    )
    Clock, moves = clock_structure(space), takes_step(space)

    @wp.kernel(module="unique", enable_backward=False)
    def shift(
        first: int,
        particles: Particles,
        reference: Reference,
        clock: Clock,
        psi: wp.array(dtype=vec),
        free: wp.array(dtype=wp.int32),
        beside: wp.array(dtype=wp.int32),
        grad_v: wp.array(dtype=mat),
        grad_F: wp.array(dtype=rows),
        rate: real,
        bound: real,
        state: State,
        out: wp.array(dtype=vec),
        impulse: wp.array(dtype=vec),
        couple: wp.array(dtype=wp.vec3d),
    ):
        a = first + wp.tid()
        delta = psi[a] * (real(0.5) * rate)
        length = wp.length(delta)
        most = bound * particles.spacing[a] * reference.h[a] / particles.h[a]
        if length > most:
            delta = delta * (most / length)
        if not moves(clock, clock.run[a]) or free[a] == 0 or beside[a] != 0:
            delta = vec()
        out[a] = delta
        mass = particles.mass[a]
        moved = state.F[a] @ (invert(reference.F[a]) @ delta)
        change = grad_F[a] @ delta
        F = state.F[a]
        for i in range(wp.static(dim)):
            for j in range(wp.static(dim)):
                if wp.static(not even):
                    F[i, j] = F[i, j] + change[i * wp.static(dim) + j]
                elif i == j:
                    F[i, j] = F[i, j] + change[0]
        impulse[a] = (grad_v[a] @ delta) * mass
        couple[a] = wp.cross(padded(moved), padded(state.v[a])) * wp.float64(mass)
        state.F[a] = F
        state.x[a] = state.x[a] + moved

    return shift


@functools.cache
def _make_push(space: Space) -> wp.Kernel:
    """Kernel: v += impulse / m."""
    vec, Particles = space.vec, structure(space, "Particles")

    @wp.kernel(module="unique", enable_backward=False)
    def push(first: int, particles: Particles, impulse: wp.array(dtype=vec), v: wp.array(dtype=vec)):
        a = first + wp.tid()
        v[a] = v[a] + impulse[a] / particles.mass[a]

    return push


@functools.cache
def _make_remap(space: Space, size: int, least: tuple[float, ...]) -> wp.Kernel:
    """Kernel: h += ∇_k h · δ, not below ``least``."""
    real, vec, row, gradients = space.real, space.vec, space.row(size), space.row_gradient(size)
    bound = row(*least)

    @wp.kernel(module="unique", enable_backward=False)
    def remap(
        first: int,
        begin: int,
        moved: wp.array(dtype=vec),
        gradient: wp.array(dtype=gradients),
        history: wp.array(dtype=row),
    ):
        a = first + wp.tid()
        # What did not move keeps its bits
        if wp.dot(moved[a], moved[a]) > real(0.0):
            history[a - begin] = wp.max(history[a - begin] + gradient[a] @ moved[a], bound)

    return remap


class Remap:
    """M15 for the history of one body, whose rows are copied among those of all particles for their gradient."""

    def __init__(self, space: Space, part: Part, n: int, device: wp.DeviceLike):
        self.part, self.space, self._launch = part, space, Launcher(device)
        size = len(part.law.start)
        self._rows = wp.zeros(n, dtype=space.row(size), device=device)
        self._gradient = wp.zeros(n, dtype=space.row_gradient(size), device=device)
        least = [v.least for v in part.law.history for _ in v.values]
        self._kernel = _make_remap(space, size, tuple(NO_BOUND if bound is None else bound for bound in least))

    def __call__(self, configuration: Configuration, moved: wp.array) -> None:
        """Remap by what each particle ``moved`` in the reference [m], (n,) of vec."""
        first, size = self.part.first, self.part.size
        wp.copy(self._rows, self.part.history, dest_offset=first)
        configuration.gradient(self._rows, self._gradient)
        self._launch(self._kernel, size, [first, moved, self._gradient, self.part.history], first)


def held_at_start(conditions: Sequence[Bound], span: range) -> np.ndarray:
    """Which particles of ``span``, counted from its start, have imposed velocities at the start of a run, (k,)."""
    imposed = [condition.indices for condition in conditions if type(condition).impose is not Bound.impose]
    numbers = np.concatenate([np.zeros(0, dtype=np.int32), *imposed])
    return numbers[(numbers >= span.start) & (numbers < span.stop)] - span.start


class Shifter:
    """M15 at work on one set of particles."""

    def __init__(
        self,
        option: Shifting,
        space: Space,
        particles: ParticleArrays,
        flux: Flux,
        held: np.ndarray,
        device: wp.DeviceLike,
    ):
        self.option, self.space, self.particles, self.device = option, space, particles, device
        n, self._launch = len(particles.mass), Launcher(device)
        self._moved = wp.zeros(n, dtype=space.vec, device=device)
        self._even = flux.forgets
        self._stretch = wp.zeros(n if self._even else 0, dtype=space.row(1), device=device)
        gradient = space.row_gradient(1 if self._even else space.dim**2)
        self._grad_F = wp.zeros(n, dtype=gradient, device=device)
        self._remaps = [Remap(space, part, n, device) for part in flux.parts if part.law.history]
        free = np.ones(n, dtype=np.int32)
        free[held] = 0
        self.free = wp.array(free, dtype=wp.int32, device=device)
        self.exposure = Exposure(space, particles, self.free, len(flux.bodies) > 1, device)
        self.impulse = wp.zeros(n, dtype=space.vec, device=device)
        self.projection = Projection(space, particles, flux.bodies, device)

    def evolving(self) -> dict[str, wp.array]:
        """Which particles may be shifted: for good, and before the next refresh."""
        return {"Shifter.free": self.free, "Shifter.beside": self.exposure.beside}

    def look(self, configuration: Configuration, defect: wp.array, U: StateArrays) -> None:
        """Who stays until the next refresh, by the ``defect`` e_a − s_a [m^(d−1)] of this one."""
        self.exposure.find(configuration, U.surface, defect)

    def apply(
        self,
        configuration: Configuration,
        psi: wp.array,
        U: StateArrays,
        grad_v: wp.array,
        clock: ClockArrays,
    ) -> None:
        """Shift the particles of ``U``, whose ∇_k v is given; ψ [m] are the potentials of its reference (M13)."""
        option, n, reference = self.option, len(psi), configuration.fields
        rows = self._stretch
        if self._even:
            self._launch(_make_stretch(self.space), n, [U.F, rows])
        else:
            rows = U.F.view(self.space.row(self.space.dim**2))
        configuration.gradient(rows, self._grad_F)
        arguments = [
            self.particles,
            reference,
            clock,
            psi,
            self.free,
            self.exposure.beside,
            grad_v,
            self._grad_F,
            option.rate,
            option.bound,
            U,
        ]
        arguments += [self._moved, self.impulse, self.projection.couples]
        self._launch(_make_shift(self.space, self._even), n, arguments)
        for remap in self._remaps:
            remap(configuration, self._moved)
        self.projection(U.x, self.impulse)
        self._launch(_make_push(self.space), n, [self.particles, self.impulse, U.v])
