"""Internal force (M5) and dissipation (M9) in one SIMD pass over the neighbours, on the CPU, and ∇p for M24."""

import functools

import warp as wp

from ..execution import Launcher
from ..fields import neighbour_structure, structure
from ..simd import BY_EIGHT, OWN_ROW, prelude
from ..space import Space
from ..structs import FluxArrays, ForceArrays
from .reference import Configuration

#: C++ of what an upwind flux (M9) asks of eight pairs: |ξ|² of X, |n|² of N, the pairs as they are now (1 where there
#: is no direction), and N · J with the velocity jumps J.
SQUARES = """
        V rr = X[0] * X[0], nn = N[0] * N[0], along = N[0] * J[0];
        #pragma unroll
        for (int j = 1; j < dim; ++j) {
            rr += X[j] * X[j];
            nn += N[j] * N[j];
            along += N[j] * J[j];
        }
        nn = nn > 0 ? nn : (V)1;
"""


def _vectors(space: Space) -> int:
    """Rows of four: x_k with the impedance, v with the shear impedance, x with p, columns of −½∇v, of Π with x̂."""
    return 3 + 2 * space.dim


@functools.cache
def pressure_of(space: Space) -> wp.Function:
    """``wp.func`` p of the stress Q in the reference."""
    real, mat, dim = space.real, space.mat, float(space.dim)

    @wp.func
    def pressure_of(Q: mat) -> real:
        return -wp.trace(Q) / real(dim)

    return pressure_of


@functools.cache
def make_pressure(space: Space) -> wp.Kernel:
    """Kernel: p of the stress in the reference."""
    row, Flux, of_stress = space.row(1), structure(space, "Flux"), pressure_of(space)

    @wp.kernel(module="unique", enable_backward=False)
    def pressure(first: int, flux: Flux, out: wp.array(dtype=row)):
        a = first + wp.tid()
        out[a] = row(of_stress(flux.Q[a]))

    return pressure


@functools.cache
def _make_pack(space: Space) -> wp.Kernel:
    """Kernel: what the pass reads of a neighbour, side by side; Π = Q Lᵀ (M5) is made here."""
    real, vec, mat, dim = space.real, space.vec, space.mat, space.dim
    Reference, Flux, pressure = structure(space, "Reference"), structure(space, "Flux"), pressure_of(space)
    first_grad, first_Pi = 12, 12 + 4 * dim

    @wp.kernel(module="unique", enable_backward=False)
    def pack(
        first: int,
        reference: Reference,
        flux: Flux,
        x: wp.array(dtype=vec),
        v: wp.array(dtype=vec),
        grad_v: wp.array(dtype=mat),
        rows: wp.array2d(dtype=real),
    ):
        a = first + wp.tid()
        x_a, now_a, v_a, grad_a, balanced_a = reference.x[a], x[a], v[a], grad_v[a], reference.balanced[a]
        Pi_a = flux.Q[a] @ wp.transpose(reference.L[a])
        rows[a, 3] = flux.impedance[a]
        rows[a, 7] = flux.shear_impedance[a]
        rows[a, 11] = pressure(flux.Q[a])
        for i in range(wp.static(dim)):
            rows[a, i] = x_a[i]
            rows[a, 4 + i] = v_a[i]
            rows[a, 8 + i] = now_a[i]
            rows[a, first_grad + 4 * i + 3] = real(0.0)  # is added to the shear impedance
            rows[a, first_Pi + 4 * i + 3] = balanced_a[i]
            for j in range(wp.static(dim)):
                rows[a, first_grad + 4 * j + i] = grad_a[i, j] * real(-0.5)
                rows[a, first_Pi + 4 * j + i] = Pi_a[i, j]

    return pack


@functools.cache
def _make_forces(space: Space, pressure: bool) -> wp.Kernel:
    """Kernel: M5 and M9 from packed rows; with ``pressure`` ∇_k p (M4) too, where no positions are balanced."""
    real, vec, rows_of_p = space.real, space.vec, space.row_gradient(1)
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    snippet = f"""
    {prelude(space)}
    constexpr int vectors = {_vectors(space)};
    const Q* const all = (const Q*)rows.data;
    {OWN_ROW}
    // impedances are added where the rest is subtracted
    const V x_a = mine(0, -1), v_a = mine(1, -1), now_a = mine(2, 1);
    V grad_a[dim], Pi_a[dim], internal = 0, dissipation[dim], slope[dim];
    #pragma unroll
    for (int j = 0; j < dim; ++j) {{
        grad_a[j] = mine(3 + j, 1);
        Pi_a[j] = mine(3 + dim + j, -1);
        dissipation[j] = slope[j] = 0;
    }}
    auto eight = [&](const int* b, V w) __attribute__((always_inline)) {{
        V xi[4], now[4], jump[4], X[4], N[4], J[4];
        #pragma unroll
        for (int i = 0; i < 4; ++i) {{
            const Q* const B = all + (size_t)b[i] * vectors;
            const Q* const C = all + (size_t)b[i + 4] * vectors;
            xi[i] = nearest(both(B[0], C[0]) - x_a);
            now[i] = nearest(both(B[2], C[2]) - now_a);
            jump[i] = both(B[1], C[1]) - v_a;
            #pragma unroll
            for (int j = 0; j < dim; ++j) jump[i] += (grad_a[j] + both(B[3 + j], C[3 + j])) * spread(xi[i], j);
        }}
        turn(xi, X);
        turn(now, N);
        turn(jump, J);
        {SQUARES}
        const V wr = w * __builtin_elementwise_sqrt(rr), Z = X[3], Z_shear = J[3];
        const V normal = along * (Z - Z_shear) * (wr / nn), shear = Z_shear * wr;
        #pragma unroll
        for (int j = 0; j < dim; ++j) dissipation[j] += N[j] * normal + J[j] * shear;
        if ({int(pressure)}) {{
            const V jump_of_p = N[3] * w;
            #pragma unroll
            for (int j = 0; j < dim; ++j) slope[j] += X[j] * jump_of_p;
        }}
        // apart, so that few vectors are alive at a time and few are spilled
        #pragma unroll
        for (int i = 0; i < 4; ++i) {{
            const Q* const B = all + (size_t)b[i] * vectors;
            const Q* const C = all + (size_t)b[i + 4] * vectors;
            V force = 0;
            #pragma unroll
            for (int j = 0; j < dim; ++j) {{
                const V P = Pi_a[j] + both(B[3 + dim + j], C[3 + dim + j]);
                force += P * nearest_along(spread(P, 3), j);
            }}
            internal += force * spread(w, i);
        }}
    }};
    {BY_EIGHT}
    internals.data[a] = store(fold(internal) * V_a);
    #pragma unroll
    for (int j = 0; j < dim; ++j) {{
        dissipations.data[a].c[j] = total(dissipation[j]) * (V_a * epsilon * T(0.25));
        if ({int(pressure)}) slopes.data[a].data[0][j] = total(slope[j]);
    }}
    """

    @wp.func_native(snippet)
    def sum_forces(
        a: int,
        begin: int,
        end: int,
        index: wp.array(dtype=int),
        w: wp.array(dtype=real),
        box: vec,
        rows: wp.array2d(dtype=real),
        epsilon: real,
        V_a: real,
        internals: wp.array(dtype=vec),
        dissipations: wp.array(dtype=vec),
        slopes: wp.array(dtype=rows_of_p),
    ): ...

    @wp.kernel(module="unique", enable_backward=False)
    def pair_forces(
        first: int,
        reference: Reference,
        near: Neighbours,
        rows: wp.array2d(dtype=real),
        epsilon: real,
        internal: wp.array(dtype=vec),
        dissipation: wp.array(dtype=vec),
        grad_p: wp.array(dtype=rows_of_p),
    ):
        a = first + wp.tid()
        begin, end, V_a = near.start[a], near.start[a + 1], reference.V[a]
        w, box = near.w, near.box
        sum_forces(a, begin, end, near.index, w, box, rows, epsilon, V_a, internal, dissipation, grad_p)
        if wp.static(pressure):
            grad_p[a] = grad_p[a] @ reference.L[a]

    return pair_forces


class PairForces:
    """The pass at work."""

    def __init__(self, space: Space, device: wp.DeviceLike):
        self.space, self._launch = space, Launcher(device)
        self._no_p = wp.zeros(0, dtype=space.row_gradient(1), device=device)

    def compute(
        self,
        configuration: Configuration,
        flux: FluxArrays,
        x: wp.array,
        v: wp.array,
        grad_v: wp.array,
        epsilon: float,
        forces: ForceArrays,
        grad_p: wp.array | None,
    ) -> None:
        """``forces.internal`` (M5) and ``forces.dissipation`` (M9 without a sensor) [N], and ``grad_p`` if given."""
        n, rows = len(v), configuration.packed(_vectors(self.space))
        self._launch(_make_pack(self.space), n, [configuration.fields, flux, x, v, grad_v, rows])
        arguments = [configuration.fields, configuration.near, rows, epsilon]
        arguments += [forces.internal, forces.dissipation, self._no_p if grad_p is None else grad_p]
        self._launch(_make_forces(self.space, grad_p is not None), n, arguments)
