"""Heat of the dissipation (M9), particle by particle, into laws that take it: what shocks need."""

import functools

import warp as wp

from ..atomics import lower_at
from ..execution import Launcher
from ..fields import clock_structure, neighbour_structure, structure
from ..materials import Law
from ..materials.base import history_row
from ..space import Space
from ..structs import ClockArrays, ParticleArrays
from .dissipation import upwind_between
from .flux import Flux
from .shifting import NO_BOUND
from .stabiliser import Sums


@functools.cache
def _make_heat(space: Space, sensed: bool) -> wp.Kernel:
    """Kernel: ½ Δt Σ_b D_ab·(v̄_b − v̄_a), with D_ab of M9 and v̄ the mean velocity of the step (M21).

    By it a force changes the kinetic energy by exactly Δt D_ab·v̄, so that what pairs lose is what they are heated by.
    """
    real, vec, mat = space.real, space.vec, space.mat
    Reference, Flux, Clock = structure(space, "Reference"), structure(space, "Flux"), clock_structure(space)
    Neighbours, pair_force = neighbour_structure(space), upwind_between(space, sensed)

    @wp.kernel(module="unique", enable_backward=False)
    def heat(
        first: int,
        reference: Reference,
        near: Neighbours,
        flux: Flux,
        x: wp.array(dtype=vec),
        v: wp.array(dtype=vec),
        grad_v: wp.array(dtype=mat),
        epsilon: real,
        sensor: wp.array(dtype=vec),
        v_old: wp.array(dtype=vec),
        v_new: wp.array(dtype=vec),
        clock: Clock,
        out: wp.array(dtype=real),
    ):
        a = first + wp.tid()
        mean_a = v_old[a] + v_new[a]  # twice
        lost = real(0.0)
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            force = pair_force(a, k, reference, near, flux, x, v, grad_v, epsilon, sensor)
            lost += wp.dot(force, v_old[b] + v_new[b] - mean_a)
        out[a] = lost * real(0.25) * real(clock.dt[clock.run[a]])

    return heat


@functools.cache
def _make_take(space: Space, law: Law) -> wp.Kernel:
    """Kernel: the history that heat leaves; the ledger has it as dissipated by the law, negative.

    A particle whose history is not finite, or below what its variables can be, is bad.
    """
    real, mat, row, length = space.real, space.mat, history_row(space, law), len(law.start)
    least = row(*[NO_BOUND if v.least is None else v.least for v in law.history for _ in v.values])
    Particles, Flux, Clock = structure(space, "Particles"), structure(space, "Flux"), clock_structure(space)
    Constants, warmed = law.Constants, law.heat

    @wp.kernel(module="unique", enable_backward=False)
    def take(
        first: int,
        begin: int,
        F: wp.array(dtype=mat),
        history: wp.array(dtype=row),
        particles: Particles,
        heat: wp.array(dtype=real),
        c: Constants,
        flux: Flux,
        clock: Clock,
    ):
        a = first + wp.tid()
        if clock.dt[clock.run[a]] > wp.float64(0.0):
            h = warmed(F[a], history[a - begin], heat[a] / particles.V0[a], c)
            history[a - begin] = h
            flux.dissipated[a] -= heat[a]
            nothing = real(0.0)  # NaN as soon as a component is not finite
            below = int(0)
            for i in range(wp.static(length)):
                nothing += h[i] * real(0.0)
                if h[i] < least[i]:
                    below = int(1)
            if nothing != real(0.0) or below > 0:
                lower_at(clock.bad, clock.run[a], clock.first + a)

    return take


class Heating:
    """Heat of one medium's dissipation at work.

    Args:
        heat: of the last step [J], (n,).
        v_old: velocities at the start of the step [m/s], (n,) of vec.
    """

    def __init__(
        self,
        space: Space,
        flux: Flux,
        particles: ParticleArrays,
        heat: wp.array,
        v_old: wp.array,
        device: wp.DeviceLike,
    ):
        self.space, self.flux, self.particles, self.heat, self._v_old = space, flux, particles, heat, v_old
        self._launch, n = Launcher(device), len(heat)
        self._x, self._v = (wp.zeros(n, dtype=space.vec, device=device) for _ in range(2))
        self._grad_v = wp.zeros(n, dtype=space.mat, device=device)

    def note(self, x: wp.array, v: wp.array, grad_v: wp.array) -> None:
        """Keep what M9 was computed from."""
        for kept, array in ((self._x, x), (self._v, v), (self._grad_v, grad_v)):
            wp.copy(kept, array)

    def find(self, sums: Sums, v: wp.array, clock: ClockArrays) -> None:
        """``heat`` of a step that ended with the velocities ``v`` [m/s], (n,) of vec."""
        configuration, sensor = sums.configuration, sums.sensor
        arguments = [configuration.fields, configuration.near, sums.flux, self._x, self._v, self._grad_v]
        arguments += [sums.epsilon, self._v if sensor is None else sensor, self._v_old, v, clock, self.heat]
        self._launch(_make_heat(self.space, sensor is not None), len(v), arguments)

    def take(self, F: wp.array, clock: ClockArrays) -> None:
        """``heat`` into the histories."""
        for part in self.flux.parts:
            if part.law.heat is not None:
                arguments = [part.first, F, part.history, self.particles, self.heat, part.constants]
                kernel = _make_take(self.space, part.law)
                self._launch(kernel, part.size, [*arguments, self.flux.fields, clock], part.first)
