"""What acts between pairs that keep their labels: the tie (M16) and dissipation (M9), forces and stresses in a pass."""

import functools
from collections.abc import Sequence

import warp as wp

from ..execution import Launcher
from ..fields import neighbour_structure, repeated, structure
from ..linalg import inverse
from ..simd import BY_EIGHT_LARGER, OWN_ROW, packed_rows, prelude
from ..space import Space, difference, vector_type
from ..structs import StateArrays
from .dissipation import Upwind, blend, upwind
from .flux import Flux
from .pair_forces import SQUARES
from .stabiliser import Sums
from .tie import Tie
from .turning import TURNING, make_spin, make_turned


def _vectors(space: Space, damped: bool) -> int:
    """Rows of four: X with impedance, u with √secant, columns of −½(F − I); for M9 v with shear impedance, −½∇v (F⁻¹),
    −½ spin."""
    return 4 + 2 * space.dim if damped else 2 + space.dim


@functools.cache
def _make_pack(space: Space, damped: bool, stressed: bool) -> wp.Kernel:
    """Kernel: what the SIMD pass reads of a neighbour, side by side; ∇v F⁻¹ where M9 has a stress, else ∇v."""
    real, vec, mat, dim, invert = space.real, space.vec, space.mat, space.dim, inverse(space)
    Reference, Flux, spin_of = structure(space, "Reference"), structure(space, "Flux"), make_spin(space)
    first_H, first_v, first_grad, first_spin = 8, 8 + 4 * dim, 12 + 4 * dim, 12 + 8 * dim

    @wp.kernel(module="unique", enable_backward=False)
    def pack(
        first: int,
        reference: Reference,
        flux: Flux,
        x: wp.array(dtype=vec),
        F: wp.array(dtype=mat),
        v: wp.array(dtype=vec),
        grad_v: wp.array(dtype=mat),
        rows: wp.array2d(dtype=real),
    ):
        a = first + wp.tid()
        X_a = reference.x[a]
        u_a, H_a = x[a] - X_a, F[a] - wp.identity(n=wp.static(dim), dtype=real)
        rows[a, 3] = flux.impedance[a]
        rows[a, 7] = flux.secant[a]
        for i in range(wp.static(dim)):
            rows[a, i] = X_a[i]
            rows[a, 4 + i] = u_a[i]
            rows[a, first_H + 4 * i + 3] = real(0.0)
            for j in range(wp.static(dim)):
                rows[a, first_H + 4 * j + i] = H_a[i, j] * real(-0.5)
        if wp.static(damped):
            v_a, grad_a = v[a], mat(grad_v[a])
            spatial = grad_a @ invert(F[a])
            if wp.static(stressed):
                grad_a = spatial
            omega = spin_of(spatial)
            for i in range(3):
                rows[a, first_spin + i] = omega[i] * real(-0.5)
            rows[a, first_spin + 3] = real(0.0)
            rows[a, first_v + 3] = flux.shear_impedance[a]
            for i in range(wp.static(dim)):
                rows[a, first_v + i] = v_a[i]
                rows[a, first_grad + 4 * i + 3] = real(0.0)
                for j in range(wp.static(dim)):
                    rows[a, first_grad + 4 * j + i] = grad_a[i, j] * real(-0.5)

    return pack


@functools.cache
def _make_simd(space: Space, damped: bool, stressed: bool, dual: bool, yielding: bool) -> wp.Kernel:
    """Kernel of the pass from packed rows: as the portable one, but for M9 with a sensor."""
    real, vec, mat = space.real, space.vec, space.mat
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    Flux, Forces, invert = structure(space, "Flux"), structure(space, "Forces"), inverse(space)
    Particles = structure(space, "Particles")
    between = "now" if stressed else "xi"  # what ∇v is of
    # what positions are off turns with the pair: no drag on rotation
    turning = "" if stressed or space.dim == 1 else TURNING[space.dim]
    snippet = f"""
    {prelude(space)}
    constexpr int vectors = {_vectors(space, damped)}, of_v = 2 + dim;
    constexpr bool damped = {int(damped)}, stressed = {int(stressed)}, yielding = {int(yielding)};
    const Q* const all = (const Q*)rows.data;
    {OWN_ROW}
    // impedances are added where the rest is subtracted, secants are as they are
    const V X_a = mine(0, -1), u_a = mine(1, 0);
    V v_a = 0, spin_a = 0;
    if (damped) v_a = mine(of_v, -1), spin_a = mine(of_v + 1 + dim, 1);
    V H_a[dim], grad_a[dim], tie[dim], drag[dim], tied[dim * dim], dragged[dim * dim], held = 0;
    #pragma unroll
    for (int j = 0; j < dim; ++j) {{
        H_a[j] = mine(2 + j, 1);
        if (damped) grad_a[j] = mine(of_v + 1 + j, 1);
        tie[j] = drag[j] = 0;
    }}
    #pragma unroll
    for (int j = 0; j < dim * dim; ++j) tied[j] = dragged[j] = 0;
    auto eight = [&](const int* b, V w) __attribute__((always_inline)) {{
        V xi[4], apart[4], jump[4], now[4], spin[4], X[4], R[4], J[4], N[4], S[4];
        #pragma unroll
        for (int i = 0; i < 4; ++i) {{
            const Q* const B = all + (size_t)b[i] * vectors;
            const Q* const C = all + (size_t)b[i + 4] * vectors;
            xi[i] = nearest(both(B[0], C[0]) - X_a);
            apart[i] = both(B[1], C[1]) - u_a;
            now[i] = xi[i] + apart[i];
            #pragma unroll
            for (int j = 0; j < dim; ++j) apart[i] += (H_a[j] + both(B[2 + j], C[2 + j])) * spread(xi[i], j);
            if (!damped) continue;
            jump[i] = both(B[of_v], C[of_v]) - v_a;
            spin[i] = both(B[of_v + 1 + dim], C[of_v + 1 + dim]) + spin_a;
            #pragma unroll
            for (int j = 0; j < dim; ++j)
                jump[i] += (grad_a[j] + both(B[of_v + 1 + j], C[of_v + 1 + j])) * spread({between}[i], j);
        }}
        turn(xi, X);
        turn(apart, R);
        const V stiffness = w * R[3] * modulus;
        #pragma unroll
        for (int i = 0; i < dim; ++i) {{
            const V pull = R[i] * stiffness;
            tie[i] += pull;
            if (yielding) held += pull * R[i];
            #pragma unroll
            for (int j = 0; j < dim; ++j) tied[i * dim + j] += pull * X[j];
        }}
        if (!damped) return;
        turn(now, N);
        turn(jump, J);
        turn(spin, S);
        {turning}
        {SQUARES}
        const V area = w * __builtin_elementwise_sqrt(rr) * (T(0.25) * epsilon);
        const V Z = X[3], Z_shear = J[3], normal = along * (Z - Z_shear) * (area / nn), shear = Z_shear * area;
        #pragma unroll
        for (int i = 0; i < dim; ++i) {{
            const V push = N[i] * normal + J[i] * shear;
            drag[i] += push;
            if (stressed) for (int j = 0; j < dim; ++j) dragged[i * dim + j] += push * N[j];
        }}
    }};
    {BY_EIGHT_LARGER}
    if (yielding) helds.data[a] = total(held) * (V_a * T(0.5));
    #pragma unroll
    for (int i = 0; i < dim; ++i) {{
        ties.data[a].c[i] = total(tie[i]) * (V_a * secant);
        if (damped) drags.data[a].c[i] = total(drag[i]) * V_a;
        #pragma unroll
        for (int j = 0; j < dim; ++j) tie_stress.data[a].data[i][j] = total(tied[i * dim + j]) * (T(-0.5) * secant);
        if (stressed)
            for (int j = 0; j < dim; ++j) drag_stress.data[a].data[i][j] = total(dragged[i * dim + j]) * T(-0.5);
    }}
    """

    @wp.func_native(snippet)
    def sum_pairs(
        a: int,
        begin: int,
        end: int,
        index: wp.array(dtype=int),
        w: wp.array(dtype=real),
        own: wp.array(dtype=real),
        box: vec,
        rows: wp.array2d(dtype=real),
        modulus: real,
        secant: real,
        epsilon: real,
        V_a: real,
        helds: wp.array(dtype=real),
        ties: wp.array(dtype=vec),
        drags: wp.array(dtype=vec),
        tie_stress: wp.array(dtype=mat),
        drag_stress: wp.array(dtype=mat),
    ): ...

    @wp.kernel(module="unique", enable_backward=False)
    def pair_potentials_simd(
        first: int,
        reference: Reference,
        near: Neighbours,
        rows: wp.array2d(dtype=real),
        F: wp.array(dtype=mat),
        particles: Particles,
        moduli: wp.array(dtype=real),
        epsilon: real,
        flux: Flux,
        forces: Forces,
    ):
        a = first + wp.tid()
        begin, end, V_a = near.start[a], near.start[a + 1], reference.V[a]
        index, w, own, box = near.index, near.w, near.own, near.box
        tie, drag, held = forces.tie, forces.dissipation, flux.tied
        sum_pairs(
            a,
            begin,
            end,
            index,
            w,
            own,
            box,
            rows,
            moduli[particles.body[a] - particles.body[0]],
            flux.secant[a],
            epsilon,
            V_a,
            held,
            tie,
            drag,
            flux.tie,
            flux.drag,
        )
        flux.Q[a] = flux.Q[a] + flux.tie[a]
        if wp.static(stressed):
            flux.drag[a] = flux.drag[a] @ wp.transpose(invert(F[a]))
            flux.Q[a] = flux.Q[a] + flux.drag[a]
        if wp.static(dual):
            flux.Pi[a] = flux.Q[a] @ wp.transpose(reference.L[a])

    return pair_potentials_simd


def _of_rotation(space: Space, stressed: bool) -> type:
    """Of D = ∇v F⁻¹, the gradient of v in the present configuration, the portable pass reads all, or its spin."""
    return space.mat if stressed else vector_type(3, space.real)


@functools.cache
def _make_spatial(space: Space, stressed: bool) -> wp.Kernel:
    """Kernel: D, or its spin."""
    mat, invert, spin_of, kept = space.mat, inverse(space), make_spin(space), _of_rotation(space, stressed)

    @wp.kernel(module="unique", enable_backward=False)
    def spatial(first: int, F: wp.array(dtype=mat), grad_v: wp.array(dtype=mat), out: wp.array(dtype=kept)):
        a = first + wp.tid()
        D = grad_v[a] @ invert(F[a])
        if wp.static(stressed):
            out[a] = D
        else:
            out[a] = spin_of(D)

    return spatial


@functools.cache
def _make_portable(space: Space, damped: bool, stressed: bool, sensed: bool, dual: bool, yielding: bool) -> wp.Kernel:
    """Kernel of the pass; M9 where ``damped``, reconstructed only where v is smooth if ``sensed``.

    With a stress (``stressed``) the jump is reconstructed by D = ∇v F⁻¹ between the pair as it is now; without by ∇v in
    the reference, and by the spin of D for what positions are off. Either way a rotation is not dragged. ``rotation``
    holds D or its spin.

    Π is kept with ``dual``.
    """
    real, vec, mat = space.real, space.vec, space.mat
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)
    Flux, Forces, Particles = structure(space, "Flux"), structure(space, "Forces"), structure(space, "Particles")
    separation, pair_force, mix, invert = difference(space), upwind(space), blend(space), inverse(space)
    turned, kept = make_turned(space), _of_rotation(space, stressed)

    @wp.kernel(module="unique", enable_backward=False)
    def pair_potentials(
        first: int,
        reference: Reference,
        near: Neighbours,
        x: wp.array(dtype=vec),
        F: wp.array(dtype=mat),
        v: wp.array(dtype=vec),
        grad_v: wp.array(dtype=mat),
        rotation: wp.array(dtype=kept),
        sensor: wp.array(dtype=vec),
        particles: Particles,
        moduli: wp.array(dtype=real),
        epsilon: real,
        flux: Flux,
        forces: Forces,
    ):
        a = first + wp.tid()
        tie, drag, tied, dragged = vec(), vec(), mat(), mat()
        held, modulus = real(0.0), moduli[particles.body[a] - particles.body[0]]
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            xi = separation(reference.x[b], reference.x[a], near.box)
            # by displacements: in a periodic box the nearest image of a strained pair may be another
            now = xi + ((x[b] - reference.x[b]) - (x[a] - reference.x[a]))
            w = near.w[k] + wp.abs(near.w[k] - near.own[k])
            off = now - (F[a] + F[b]) @ (xi * real(0.5))
            pull = off * (modulus * w * flux.secant[b])
            tie += pull
            held += wp.dot(pull, off)
            tied += wp.outer(pull, xi)
            if wp.static(damped):
                plain = v[b] - v[a]
                jump = plain
                if wp.static(stressed):
                    jump -= (rotation[a] + rotation[b]) @ (now * real(0.5))
                else:
                    jump -= (grad_v[a] + grad_v[b]) @ (xi * real(0.5))
                    jump -= turned((rotation[a] + rotation[b]) * real(0.5), off, wp.length(xi))
                jump = jump * epsilon
                if wp.static(sensed):
                    jump = mix(jump, plain * epsilon, real(1.0), sensor[a], sensor[b])
                Z = flux.impedance[a] + flux.impedance[b]
                Z_shear = flux.shear_impedance[a] + flux.shear_impedance[b]
                push = pair_force(xi, now, w, Z, Z_shear, jump)
                drag += push
                if wp.static(stressed):
                    dragged += wp.outer(push, now)
        if wp.static(yielding):
            flux.tied[a] = real(0.5) * held * reference.V[a]
        secant = flux.secant[a]
        forces.tie[a] = tie * (reference.V[a] * secant)
        flux.tie[a] = tied * (real(-0.5) * secant)
        flux.Q[a] = flux.Q[a] + flux.tie[a]
        if wp.static(damped):
            forces.dissipation[a] = drag * reference.V[a]
            if wp.static(stressed):
                flux.drag[a] = dragged * real(-0.5) @ wp.transpose(invert(F[a]))
                flux.Q[a] = flux.Q[a] + flux.drag[a]
        if wp.static(dual):
            flux.Pi[a] = flux.Q[a] @ wp.transpose(reference.L[a])

    return pair_potentials


class PairPotentials:
    """The pass at work on a medium whose arrangement does not move: a stress beside every force.

    Forces and stresses are derivatives of a potential of positions and F (M16), and where M9 has a stress of one of
    velocities and ∇v F⁻¹ with the pairs as they are now. So energy and both momenta find all of them, and neither
    potential knows of a rotation.

    Args:
        tie: None ties nothing.
        dissipation: M9; None where a correction changes M5 (M10 to M12), with which M9 comes then.
        simd: whether the pass runs by SIMD kernels, whose M9 knows of no sensor.
        groups: number of each body, equal for those that are bonded: they have the modulus of the softest, so that
            pairs across the joint find the same at both ends.

    Attributes:
        rows: what the SIMD pass reads of a neighbour; nothing that is needed after it.
    """

    def __init__(
        self,
        tie: Tie | None,
        dissipation: Upwind | None,
        simd: bool,
        space: Space,
        flux: Flux,
        groups: Sequence[int],
        device: wp.DeviceLike,
    ):
        self.space, self._launch = space, Launcher(device)
        damped = dissipation is not None
        self._damped, self._simd = damped, simd
        self._stressed = dissipation is not None and dissipation.stress
        n = len(flux.fields.Q)
        moduli = [tie.modulus(M, mu, space.dim) if tie is not None else 0.0 for M, mu in flux.moduli()]
        softest: dict[int, float] = {}
        for M, group in zip(moduli, groups, strict=True):
            softest[group] = min(M, softest.get(group, M))
        self._moduli = wp.array([softest[group] for group in groups], dtype=space.real, device=device)
        self.rows = packed_rows(space, n if simd else 0, _vectors(space, damped), device)
        rotating = n if damped and not simd else 0
        self._rotation = wp.zeros(rotating, dtype=_of_rotation(space, self._stressed), device=device)
        self._particles = flux.particles
        flux.fields.tie = wp.zeros(n, dtype=space.mat, device=device)
        self._one = wp.ones(1, dtype=space.real, device=device)
        flux.fields.secant = repeated(self._one, n)
        self._yielding = tie is not None and any(part.law.secant is not None for part in flux.parts)
        if self._yielding:
            flux.fields.secant = wp.ones(n, dtype=space.real, device=device)
            flux.fields.tied, flux.fields.slipped = (wp.zeros(n, dtype=space.real, device=device) for _ in range(2))
        if self._stressed:
            flux.fields.drag = wp.zeros(n, dtype=space.mat, device=device)

    def compute(self, sums: Sums, state: StateArrays, v: wp.array) -> None:
        """Forces [N] at x and F of ``state`` and velocities ``v``, and their stresses, which are added to Q."""
        reference, near, flux = sums.configuration.fields, sums.configuration.near, sums.flux
        grad_v, epsilon, forces = sums.grad_v, sums.epsilon, sums.forces
        damped, stressed, dual = self._damped, self._stressed, len(flux.Pi) > 0
        if self._simd:
            arguments = [reference, flux, state.x, state.F, v, grad_v, self.rows]
            self._launch(_make_pack(self.space, damped, stressed), len(v), arguments)
            kernel = _make_simd(self.space, damped, stressed, dual, self._yielding)
            arguments = [reference, near, self.rows, state.F, self._particles, self._moduli, epsilon, flux, forces]
            self._launch(kernel, len(v), arguments)
            return
        if damped:
            self._launch(_make_spatial(self.space, stressed), len(v), [state.F, grad_v, self._rotation])
        kernel = _make_portable(self.space, damped, stressed, sums.sensor is not None, dual, self._yielding)
        moving = [state.x, state.F, v, grad_v, self._rotation, v if sums.sensor is None else sums.sensor]
        self._launch(kernel, len(v), [reference, near, *moving, self._particles, self._moduli, epsilon, flux, forces])
