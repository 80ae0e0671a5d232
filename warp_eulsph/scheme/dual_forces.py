"""The internal force (M5) alone, where the arrangement is as it was at the start and needs no correction."""

import functools

import warp as wp

from ..execution import Launcher
from ..fields import neighbour_structure, structure
from ..simd import BY_TWO_DUAL, packed_rows, prelude
from ..space import Space, difference
from ..structs import StateArrays
from .reference import Configuration
from .sharpening import Sharpener, make_pack, unpack_columns
from .stabiliser import Stabiliser, Sums


@functools.cache
def _make_portable(space: Space, tilted: bool) -> wp.Kernel:
    """Kernel: M5 from packed rows; with tilted weights their Σ own ξ is known (M17), without it is summed here."""
    real, vec, separation, unpack = space.real, space.vec, difference(space), unpack_columns(space)
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def dual_forces_portable(
        first: int, reference: Reference, near: Neighbours, rows: wp.array2d(dtype=real), internal: wp.array(dtype=vec)
    ):
        a = first + wp.tid()
        Pi_a, x_a = unpack(rows, a)
        total = vec()
        if wp.static(tilted):
            total = Pi_a @ reference.moment[a]
        for k in range(near.start[a], near.stop[a], near.stride):
            Pi, x_b = unpack(rows, near.index[k])
            if wp.static(not tilted):
                Pi = Pi_a + Pi
            total += Pi @ (separation(x_b, x_a, near.box) * (near.w[k] + (near.w[k] - near.own[k])))
        internal[a] = total * reference.V[a]

    return dual_forces_portable


@functools.cache
def _make_simd(space: Space, tilted: bool) -> wp.Kernel:
    """The same by SIMD."""
    real, vec = space.real, space.vec
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    snippet = f"""
    {prelude(space)}
    const Q* const all = (const Q*)rows.data;
    T x_a[dim];
    V Pi_a[dim], sums[4] = {{0, 0, 0, 0}};
    #pragma unroll
    for (int j = 0; j < dim; ++j) {{
        const Q row = all[(size_t)a * dim + j];
        x_a[j] = row[3];
        Pi_a[j] = both(row, row);
    }}
    auto two = [&](int b, int c, V w, int part) __attribute__((always_inline)) {{
        V force = 0;
        #pragma unroll
        for (int j = 0; j < dim; ++j) {{
            const V P = both(all[(size_t)b * dim + j], all[(size_t)c * dim + j]);
            force += {"P" if tilted else "(P + Pi_a[j])"} * nearest_along(spread(P, 3) - x_a[j], j);
        }}
        sums[part] += force * w;
    }};
    {BY_TWO_DUAL}
    V internal = (sums[0] + sums[1]) + (sums[2] + sums[3]);
    Q force = fold(internal);
    if ({int(tilted)}) for (int j = 0; j < dim; ++j) force += all[(size_t)a * dim + j] * moment.data[a].c[j];
    internals.data[a] = store(force * V_a);
    """

    @wp.func_native(snippet)
    def sum_forces(
        a: int,
        begin: int,
        end: int,
        index: wp.array(dtype=int),
        w: wp.array(dtype=real),
        own: wp.array(dtype=real),
        box: vec,
        rows: wp.array2d(dtype=real),
        moment: wp.array(dtype=vec),
        V_a: real,
        internals: wp.array(dtype=vec),
    ): ...

    @wp.kernel(module="unique", enable_backward=False)
    def dual_forces(
        first: int, reference: Reference, near: Neighbours, rows: wp.array2d(dtype=real), internal: wp.array(dtype=vec)
    ):
        a = first + wp.tid()
        begin, end = near.start[a], near.start[a + 1]
        V_a, moment = reference.V[a], reference.moment
        sum_forces(a, begin, end, near.index, near.w, near.own, near.box, rows, moment, V_a, internal)

    return dual_forces


class DualForces(Stabiliser):
    """M5 at work, sharpened or not (M23); what dissipates and ties there is in the stress already (M9, M16).

    ``within``: rows whose memory it may use (``packed_rows``).
    """

    corrects = False

    def __init__(
        self, space: Space, n: int, sharpener: Sharpener | None, device: wp.DeviceLike, within: wp.array | None = None
    ):
        self.space, self._sharpener, self._launch = space, sharpener, Launcher(device)
        self._rows = packed_rows(space, n if sharpener is None else 0, space.dim, device, within)

    def refresh(self, configuration: Configuration, state: StateArrays) -> None:
        """Nothing to prepare."""

    def takes_dual(self, configuration: Configuration, sensed: bool) -> bool:
        """Packed rows have Π."""
        return False

    def compute(self, sums: Sums, x: wp.array, v: wp.array) -> None:
        """Internal force (M5)."""
        configuration, flux, internal, rows = sums.configuration, sums.flux, sums.forces.internal, self._rows
        if self._sharpener is not None:
            self._sharpener.stress(flux.Q)
            rows = self._sharpener.stress_rows
        else:
            self._launch(make_pack(self.space), len(internal), [configuration.fields, flux.Q, rows])
        make = _make_simd if configuration.simd else _make_portable
        kernel = make(self.space, configuration.tilt is not None)
        self._launch(kernel, len(internal), [configuration.fields, configuration.near, rows, internal])
