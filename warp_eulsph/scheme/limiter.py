"""Flux-corrected transport: locally controlled mass diffusion added to the Lax-Wendroff increment (paper §5)."""

import functools
from dataclasses import dataclass

import warp as wp

from ..execution import Launcher
from ..fields import clock_structure, structure
from ..operators.values import Shepard, Values
from ..space import Space
from ..structs import ClockArrays, ParticleArrays, StateArrays
from .reference import Configuration
from .sensor import PaperSensor, Sensor

# A particle whose neighbours hold less than this share of its lumped mass has nobody to exchange with.
LEAST_SHARE = 1.0e-4


@dataclass(frozen=True)
class FluxCorrectedTransport:
    """U^{n+1} = U_LW + d × mass diffusion of Uⁿ, for v and F (paper §5, docs/method.md §5).

    The low-order increment is the high-order one plus the diffusion, so that d = 0 is Lax-Wendroff and d = 1 the low
    order scheme. Component i of v takes d_i, component F_ij takes d_i, the direction of the velocity that drives it.
    The diffusion is an amount per step: a smaller Δt diffuses more per second.

    Args:
        sensor: where d comes from.
        conservative: exchange between pairs with ½(s_a d_a + s_b d_b), which keeps Σ m v and Σ m F to round-off; False
            is the formula as printed, which does not.
        values: corrected values of N; Shepard() keeps all weights positive.
    """

    sensor: Sensor = PaperSensor()
    conservative: bool = True
    values: Values = Shepard()

    def build(
        self, space: Space, particles: ParticleArrays, configuration: Configuration, device: wp.DeviceLike
    ) -> "MassDiffusion":
        """Allocate for the particles of ``configuration``."""
        return MassDiffusion(self, space, particles, configuration, device)


@functools.cache
def _make_strength(space: Space) -> wp.Kernel:
    """Kernel: sd_a = d_a m_a / (M^L − M^C)_aa."""
    real, vec = space.real, space.vec
    Particles = structure(space, "Particles")

    @wp.kernel(module="unique", enable_backward=False)
    def strength(
        first: int,
        particles: Particles,
        lumped: wp.array(dtype=real),
        consistent: wp.array(dtype=real),
        d: wp.array(dtype=vec),
        sd: wp.array(dtype=vec),
    ):
        a = first + wp.tid()
        others = lumped[a] - consistent[a]
        sd_a = vec()
        if others > real(LEAST_SHARE) * lumped[a]:
            sd_a = d[a] * (particles.mass[a] / others)
        sd[a] = sd_a

    return strength


@functools.cache
def _make_times_mass(space: Space, components: int) -> wp.Kernel:
    row = space.row(components)
    Particles = structure(space, "Particles")

    @wp.kernel(module="unique", enable_backward=False)
    def times_mass(first: int, particles: Particles, f: wp.array(dtype=row)):
        a = first + wp.tid()
        f[a] = f[a] * particles.mass[a]

    return times_mass


@functools.cache
def by_direction(space: Space, components: int) -> wp.Function:
    """``wp.func`` row f with each component times that of its direction: v_i with d_i, F_ij with d_i."""
    vec, row, dim = space.vec, space.row(components), space.dim

    @wp.func
    def by_direction(d: vec, f: row) -> row:
        scaled = row()
        for i in range(wp.static(components)):
            scaled[i] = d[wp.static(dim) * i // wp.static(components)] * f[i]
        return scaled

    return by_direction


@functools.cache
def _make_weigh(space: Space, components: int) -> wp.Kernel:
    vec, row = space.vec, space.row(components)
    scale = by_direction(space, components)

    @wp.kernel(module="unique", enable_backward=False)
    def weigh(first: int, sd: wp.array(dtype=vec), f: wp.array(dtype=row), out: wp.array(dtype=row)):
        a = first + wp.tid()
        out[a] = scale(sd[a], f[a])

    return weigh


@functools.cache
def _make_increment(space: Space, components: int, conservative: bool) -> wp.Kernel:
    """Kernel: the diffusion of f; ``mixed`` = M^C f, ``mixed_weighed`` = M^C (sd f), ``mixed_sd`` = M^C sd.

    As printed: ΔU_a = sd_a [Σ_b M^C_ab U_b − M^L_aa U_a]/m_a.
    Conservative: m_a ΔU_a = Σ_b M^C_ab ½(sd_a + sd_b)(U_b − U_a), with Σ_b M^C_ab = M^L_aa.
    """
    real, vec, row = space.real, space.vec, space.row(components)
    Particles = structure(space, "Particles")
    scale = by_direction(space, components)

    @wp.kernel(module="unique", enable_backward=False)
    def increment(
        first: int,
        particles: Particles,
        lumped: wp.array(dtype=real),
        sd: wp.array(dtype=vec),
        mixed_sd: wp.array(dtype=vec),
        f: wp.array(dtype=row),
        mixed: wp.array(dtype=row),
        mixed_weighed: wp.array(dtype=row),
        out: wp.array(dtype=row),
    ):
        a = first + wp.tid()
        f_a = f[a]
        change = scale(sd[a], mixed[a] - f_a * lumped[a])
        if wp.static(conservative):
            change = (change + mixed_weighed[a] - scale(mixed_sd[a], f_a)) * real(0.5)
        out[a] = change / particles.mass[a]

    return increment


@functools.cache
def _make_add(space: Space) -> wp.Kernel:
    """Kernel: add the increments, none in a step of Δt = 0, which must change nothing."""
    vec, mat = space.vec, space.mat
    State, Clock = structure(space, "State"), clock_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def add(first: int, clock: Clock, dv: wp.array(dtype=vec), dF: wp.array(dtype=mat), state: State):
        a = first + wp.tid()
        if clock.dt[clock.run[a]] == wp.float64(0.0):
            dv[a] = vec()
            dF[a] = mat()
        state.v[a] = state.v[a] + dv[a]
        state.F[a] = state.F[a] + dF[a]

    return add


class MassDiffusion:
    """The limiter at work; M^C = Nᵀ diag(m) N is applied as two gathers, never stored.

    Attributes:
        dv, dF: increments of v [m/s] and F [-] of the present step, (n,) of vec and of mat.
    """

    def __init__(
        self,
        option: FluxCorrectedTransport,
        space: Space,
        particles: ParticleArrays,
        configuration: Configuration,
        device: wp.DeviceLike,
    ):
        self.option, self.space, self.particles, self.device = option, space, particles, device
        self.configuration, self._launch = configuration, Launcher(device)
        n = len(particles.mass)
        self.lumped, self.consistent = (wp.zeros(n, dtype=space.real, device=device) for _ in range(2))
        self.dv = wp.zeros(n, dtype=space.vec, device=device)
        self.dF = wp.zeros(n, dtype=space.mat, device=device)
        self._sd, self._mixed_sd = (wp.zeros(n, dtype=space.vec, device=device) for _ in range(2))
        self._scratch = {
            components: [wp.zeros(n, dtype=space.row(components), device=device) for _ in range(3)]
            for components in {space.dim, space.dim**2}
        }
        self._views: dict[int, tuple[wp.array, wp.array]] = {}

    def refresh(self) -> None:
        """The mass matrices' diagonals on a new reference."""
        self.interpolation = self.configuration.interpolation(self.option.values)
        self.interpolation.mass_diagonals(self.lumped, self.consistent)

    def prepare(self, U: StateArrays, d: wp.array) -> None:
        """Increments d × diffusion of the state ``U`` = Uⁿ, (n,) of vec ``d`` from the sensor."""
        strength = [self.particles, self.lumped, self.consistent, d, self._sd]
        self._launch(_make_strength(self.space), len(d), strength)
        if self.option.conservative:
            self._mix(self._sd, self._scratch[self.space.dim][0], self._mixed_sd)
        for f, increment in ((U.v, self.dv), (U.F, self.dF)):
            self._diffuse(self._rows(f), self._rows(increment))

    def apply(self, U: StateArrays, clock: ClockArrays) -> None:
        """Add the increments to ``U``."""
        self._launch(_make_add(self.space), len(self.dv), [clock, self.dv, self.dF, U])

    def _diffuse(self, f: wp.array, out: wp.array) -> None:
        components = wp.types.type_size(f.dtype)
        first, mixed, mixed_weighed = self._scratch[components]
        self._mix(f, first, mixed)
        if self.option.conservative:
            self._launch(_make_weigh(self.space, components), len(f), [self._sd, f, out])
            self._mix(out, first, mixed_weighed)
        kernel = _make_increment(self.space, components, self.option.conservative)
        arguments = [self.particles, self.lumped, self._sd, self._mixed_sd, f, mixed, mixed_weighed, out]
        self._launch(kernel, len(f), arguments)

    def _mix(self, f: wp.array, between: wp.array, out: wp.array) -> None:
        """``out`` ← M^C f = Nᵀ diag(m) N f."""
        self.interpolation.apply(f, between)
        kernel = _make_times_mass(self.space, wp.types.type_size(f.dtype))
        self._launch(kernel, len(f), [self.particles, between])
        self.interpolation.transpose(between, out)

    def _rows(self, f: wp.array) -> wp.array:
        """The same memory with each element as one row of reals; the same object each time, as launches want it."""
        if id(f) not in self._views:
            self._views[id(f)] = f, f.view(self.space.row(wp.types.type_size(f.dtype)))
        return self._views[id(f)][1]
