"""The other half of the acoustic flux: volume that flows from where pressure is high to where it is low (M24)."""

import functools
from collections.abc import Callable

import warp as wp

from ..execution import Launcher
from ..fields import clock_structure, neighbour_structure, structure
from ..linalg import stretch_of_volume
from ..materials import Law
from ..materials.base import history_row, long_form
from ..operators.correction import VECTORS
from ..simd import BY_EIGHT, OWN_ROW, prelude
from ..space import Space, difference
from ..structs import ClockArrays, ParticleArrays
from .flux import Flux
from .pair_forces import make_pressure
from .stabiliser import Sums


@functools.cache
def _make_exchange(space: Space) -> wp.Kernel:
    """Kernel: ΔV_a/V_a = −ε Δt/V_a Σ_b A_ab [p_b − p_a − ½(∇p_a + ∇p_b)·ξ]/(Z_a + Z_b), A_ab = V_a V_b |W'| (M24).

    The velocity of the interface between two ends that have different pressures, as M9 has the pressure of one between
    different velocities; antisymmetric in volume, zero for linear pressures.
    """
    real, row, rows = space.real, space.row(1), space.row_gradient(1)
    Reference, Flux, Clock = structure(space, "Reference"), structure(space, "Flux"), clock_structure(space)
    Neighbours, separation = neighbour_structure(space), difference(space)

    @wp.kernel(module="unique", enable_backward=False)
    def exchange(
        first: int,
        reference: Reference,
        near: Neighbours,
        flux: Flux,
        p: wp.array(dtype=row),
        grad_p: wp.array(dtype=rows),
        epsilon: real,
        clock: Clock,
        out: wp.array(dtype=real),
    ):
        a = first + wp.tid()
        flow = real(0.0)
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            xi = separation(reference.x[b], reference.x[a], near.box)
            both = flux.impedance[a] + flux.impedance[b]
            if both > real(0.0):
                mean = (grad_p[a] + grad_p[b]) @ xi
                flow -= near.w[k] * wp.length(xi) * (p[b][0] - p[a][0] - real(0.5) * mean[0]) / both
        out[a] = flow * epsilon * real(clock.dt[clock.run[a]])

    return exchange


@functools.cache
def _make_pack(space: Space) -> wp.Kernel:
    """Kernel: what the SIMD pass reads of a neighbour: x_k with the impedance, ½∇p with p."""
    real, row, gradient, dim = space.real, space.row(1), space.row_gradient(1), space.dim
    Reference, Flux = structure(space, "Reference"), structure(space, "Flux")

    @wp.kernel(module="unique", enable_backward=False)
    def pack(
        first: int,
        reference: Reference,
        flux: Flux,
        p: wp.array(dtype=row),
        grad_p: wp.array(dtype=gradient),
        rows: wp.array2d(dtype=real),
    ):
        a = first + wp.tid()
        x_a, grad_a = reference.x[a], grad_p[a]
        for i in range(wp.static(dim)):
            rows[a, i] = x_a[i]
            rows[a, 4 + i] = grad_a[0, i] * real(0.5)
        rows[a, 3] = flux.impedance[a]
        rows[a, 7] = p[a][0]

    return pack


@functools.cache
def _make_exchange_simd(space: Space) -> wp.Kernel:
    """SIMD kernel of ``_make_exchange``, from packed rows."""
    real, vec = space.real, space.vec
    Clock, Neighbours = clock_structure(space), neighbour_structure(space)
    snippet = f"""
    {prelude(space)}
    constexpr int vectors = {VECTORS};
    const Q* const all = (const Q*)rows.data;
    {OWN_ROW}
    // impedances and gradients are added where the rest is subtracted
    const V x_a = mine(0, -1), p_a = mine(1, -1);
    V flow = 0;
    auto eight = [&](const int* b, V w) __attribute__((always_inline)) {{
        V xi[4], p[4], X[4], P[4];
        #pragma unroll
        for (int i = 0; i < 4; ++i) {{
            const Q* const B = all + (size_t)b[i] * vectors;
            const Q* const C = all + (size_t)b[i + 4] * vectors;
            xi[i] = nearest(both(B[0], C[0]) - x_a);
            p[i] = both(B[1], C[1]) + p_a;
        }}
        turn(xi, X);
        turn(p, P);
        V rr = X[0] * X[0], jump = P[3] - P[0] * X[0];
        #pragma unroll
        for (int j = 1; j < dim; ++j) {{
            rr += X[j] * X[j];
            jump -= P[j] * X[j];
        }}
        const V Z = X[3];
        flow -= Z > 0 ? w * __builtin_elementwise_sqrt(rr) * jump / Z : (V)0;
    }};
    {BY_EIGHT}
    return total(flow);
    """

    @wp.func_native(snippet)
    def sum_flow(
        a: int,
        begin: int,
        end: int,
        index: wp.array(dtype=int),
        w: wp.array(dtype=real),
        box: vec,
        rows: wp.array2d(dtype=real),
    ) -> real: ...

    @wp.kernel(module="unique", enable_backward=False)
    def exchange_simd(
        first: int,
        near: Neighbours,
        rows: wp.array2d(dtype=real),
        epsilon: real,
        clock: Clock,
        out: wp.array(dtype=real),
    ):
        a = first + wp.tid()
        flow = sum_flow(a, near.start[a], near.start[a + 1], near.index, near.w, near.box, rows)
        out[a] = flow * epsilon * real(clock.dt[clock.run[a]])

    return exchange_simd


@functools.cache
def _make_take(space: Space, law: Law) -> wp.Kernel:
    """Kernel: J ← (1 + ΔV/V) J; what that took of the energy is dissipated, or heat where the law takes it."""
    real, mat, row, stretch_of = space.real, space.mat, history_row(space, law), stretch_of_volume(space)
    Particles, Flux, Constants = structure(space, "Particles"), structure(space, "Flux"), law.Constants
    energy_of, remembers, heats, warmed = (
        long_form(space, law).energy,
        bool(law.history),
        law.heat is not None,
        law.heat,
    )

    @wp.kernel(module="unique", enable_backward=False)
    def take(
        first: int,
        begin: int,
        F: wp.array(dtype=mat),
        history: wp.array(dtype=row),
        particles: Particles,
        change: wp.array(dtype=real),
        c: Constants,
        flux: Flux,
    ):
        a = first + wp.tid()
        h = row()
        lost = real(0.0)
        if wp.static(remembers):
            h = history[a - begin]
            lost = flux.dissipated[a]
        F_a = F[a] * stretch_of(real(1.0) + change[a])
        gone = energy_of(F[a], h, c) - energy_of(F_a, h, c)
        if wp.static(heats):
            history[a - begin] = warmed(F_a, h, gone, c)
        else:
            lost += particles.V0[a] * gone
        flux.dissipated[a] = lost
        F[a] = F_a

    return take


class VolumeFlux:
    """M24 at work on one medium of fluids.

    Attributes:
        p: pressure [Pa] of the stress in the reference, (n,) of one real. grad_p: ∇_k p (M4), (n,) of one row of dim
            reals. Those who sum forces may have left both.
    """

    def __init__(self, space: Space, flux: Flux, particles: ParticleArrays, change: wp.array, device: wp.DeviceLike):
        self.space, self.flux, self.particles, self.change = space, flux, particles, change
        self._launch, n = Launcher(device), len(change)
        self.p = wp.zeros(n, dtype=space.row(1), device=device)
        self.grad_p = wp.zeros(n, dtype=space.row_gradient(1), device=device)

    def find(self, sums: Sums, exact: Callable[[wp.array], wp.array], clock: ClockArrays) -> None:
        """ΔV/V of the step, by the pressures that it was made with."""
        configuration, n = sums.configuration, len(self.change)
        if sums.grad_p is None:
            self._launch(make_pressure(self.space), n, [sums.flux, self.p])
            configuration.gradient(self.p, self.grad_p)
        gradient = exact(self.grad_p)
        fields, near = configuration.fields, configuration.near
        if configuration.simd:
            rows = configuration.packed(VECTORS)
            self._launch(_make_pack(self.space), n, [fields, sums.flux, self.p, gradient, rows])
            arguments = [near, rows, sums.epsilon, clock, self.change]
            self._launch(_make_exchange_simd(self.space), n, arguments)
            return
        arguments = [fields, near, sums.flux, self.p, gradient, sums.epsilon, clock, self.change]
        self._launch(_make_exchange(self.space), n, arguments)

    def take(self, F: wp.array) -> None:
        """Into J."""
        for part in self.flux.parts:
            arguments = [part.first, F, part.history, self.particles, self.change, part.constants, self.flux.fields]
            self._launch(_make_take(self.space, part.law), part.size, arguments, part.first)
