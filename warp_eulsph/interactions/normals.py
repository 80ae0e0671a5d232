"""Normals of surfaces, and the forces by which they answer an energy that depends on them."""

import functools

import warp as wp

from ..fields import neighbour_structure, structure
from ..linalg import cofactor, inverse, symmetric_eigen
from ..space import Space, difference
from .faces import REACH, SPREAD, alike_vectors, least_two, plane_moments, surface_weight

# Jacobi's sweeps: one rotation is exact in 2-D; in 3-D planes, one eigenvalue far from the others, take four.
SWEEPS = {1: 0, 2: 1, 3: 4}


@functools.cache
def make_want(space: Space) -> wp.Kernel:
    """Kernel: which normals are asked for: those of particles that have others near them, in rows."""

    @wp.kernel(module="unique", enable_backward=False)
    def want(
        first: int,
        members: wp.array(dtype=wp.int32),
        offset: int,
        start: wp.array(dtype=wp.int32),
        wanted: wp.array(dtype=wp.int32),
    ):
        k = first + wp.tid()
        wanted[members[k] - offset] = int(start[k + 1] > start[k])

    return want


@functools.cache
def make_beside(space: Space) -> wp.Kernel:
    """Kernel: which outermost particles have one beside them whose normal is asked for, or are one."""
    Neighbours = neighbour_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def find_beside(
        first: int,
        members: wp.array(dtype=wp.int32),
        offset: int,
        near: Neighbours,
        outermost: wp.array(dtype=wp.int32),
        wanted: wp.array(dtype=wp.int32),
        beside: wp.array(dtype=wp.int32),
    ):
        k = first + wp.tid()
        c = members[k] - offset
        found = wanted[c]
        for i in range(near.start[c], near.stop[c], near.stride):
            found = wp.max(found, wanted[near.index[i]])
        beside[k] = found * outermost[c]

    return find_beside


@functools.cache
def plane_normal(space: Space) -> wp.Function:
    """``wp.func`` (a, particles, reference, near, x, outward, outermost, out) -> S's eigenvalues and vectors, and more.

    S n = λ n of least λ, S = ⟨ξ'⊗ξ'⟩ − ⟨ξ⟩⊗⟨ξ⟩, ξ' from their mean ⟨ξ⟩, of the outermost particles around at ``x``.
    Around a corner the mean lies within: without its square moments about it are much alike, and n would swing by a
    right angle where they cross. On flat faces it lies across n and changes nothing. Returns n to the side of ``out``,
    zero where there is no plane; eigenvectors and eigenvalues, λ, Σ w, and 2⟨ξ⟩.
    """
    vec, real, dim = space.vec, space.real, space.dim
    moments_of, eigen, order_of = plane_moments(space), symmetric_eigen(space, SWEEPS[dim]), least_two(space)
    Particles, Reference, Neighbours = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        neighbour_structure(space),
    )

    @wp.func
    def plane_normal(
        a: int,
        particles: Particles,
        reference: Reference,
        near: Neighbours,
        x: wp.array(dtype=vec),
        outward: wp.array(dtype=vec),
        outermost: wp.array(dtype=wp.int32),
        out: vec,
    ):
        mass, mean, square = moments_of(a, particles, reference, near, x, outward, outermost)
        axes, spread = eigen(square - wp.outer(mean, mean))
        place, least, next = order_of(spread)
        n = vec()
        if next > real(SPREAD) and wp.length(out) > real(0.0):
            for i in range(wp.static(dim)):
                for j in range(wp.static(dim)):
                    if j == place:
                        n[i] = axes[i, j]
            if wp.dot(n, out) < real(0.0):
                n = -n
        return n, axes, spread, least, mass, real(2.0) * mean

    return plane_normal


@functools.cache
def make_planes(space: Space) -> wp.Kernel:
    """Kernel: normal, centre 2⟨ξ⟩ and weight of each plane in the reference, where it stays."""
    vec, real, normal_of = space.vec, space.real, plane_normal(space)
    Particles, Reference, Neighbours = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        neighbour_structure(space),
    )

    @wp.kernel(module="unique", enable_backward=False)
    def find_planes(
        first: int,
        particles: Particles,
        reference: Reference,
        near: Neighbours,
        outward: wp.array(dtype=vec),
        outermost: wp.array(dtype=wp.int32),
        normals: wp.array(dtype=vec),
        centres: wp.array(dtype=vec),
        masses: wp.array(dtype=real),
    ):
        a = first + wp.tid()
        if outermost[a] == 1:
            n, _axes, _spread, _least, mass, centre = normal_of(
                a, particles, reference, near, reference.x, outward, outermost, outward[a]
            )
            normals[a] = n
            centres[a] = centre
            masses[a] = mass

    return find_planes


@functools.cache
def stretched_plane(space: Space) -> wp.Function:
    """``wp.func``: A = Σ w ξ ⊗ (Ξ − 2⟨Ξ⟩)/Σ w of the outermost particles around: how a plane of the reference lies now.

    ξ now and Ξ in the reference, in spacings. In the reference it is S.
    """
    vec, mat, real, separation = space.vec, space.mat, space.real, difference(space)
    weight_of, alike = surface_weight(space)[0], alike_vectors(space)
    Particles, Reference, Neighbours = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        neighbour_structure(space),
    )

    @wp.func
    def stretched_plane(
        a: int,
        particles: Particles,
        reference: Reference,
        near: Neighbours,
        x: wp.array(dtype=vec),
        outward: wp.array(dtype=vec),
        outermost: wp.array(dtype=wp.int32),
        centre: vec,
        mass: real,
    ):
        A = mat()
        for i in range(near.start[a], near.stop[a], near.stride):
            b = near.index[i]
            if outermost[b] == 1 and alike(outward[a], outward[b]):
                apart = separation(reference.x[b], reference.x[a], near.box)
                w = weight_of(wp.length(apart), real(REACH) * particles.spacing[a]) / mass
                xi = separation(x[b], x[a], near.box) / particles.spacing[a]
                A += wp.outer(xi, w * (apart / particles.spacing[a] - centre))
        return A

    return stretched_plane


@functools.cache
def make_normals(space: Space, fixed: bool) -> wp.Kernel:
    """Kernel: normals of the planes through the outermost particles around, and ``answer``, how these turn them.

    Where the arrangement is ``fixed`` the plane of the reference is carried along, n ∝ cof(A) N (``stretched_plane``),
    and the answer is A: what is rumpled has no plane of its own, and an eigenvector would swing. Where it is read anew
    n is that of the particles as they lie, and the answer Σ_i e_i ⊗ e_i/(λ_i − λ_n) over the other eigenvectors of S,
    over weight and spacing. Those ``alone`` have none.
    """
    vec, mat, real, dim, cof, invert = space.vec, space.mat, space.real, space.dim, cofactor(space), inverse(space)
    normal_of, plane_of = plane_normal(space), stretched_plane(space)
    Particles, Reference, State, Neighbours = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        structure(space, "State"),
        neighbour_structure(space),
    )

    @wp.kernel(module="unique", enable_backward=False)
    def find_normals(
        first: int,
        members: wp.array(dtype=wp.int32),
        offset: int,
        particles: Particles,
        reference: Reference,
        near: Neighbours,
        state: State,
        outward: wp.array(dtype=vec),
        outermost: wp.array(dtype=wp.int32),
        alone: wp.array(dtype=wp.int32),
        wanted: wp.array(dtype=wp.int32),
        normals: wp.array(dtype=vec),
        centres: wp.array(dtype=vec),
        masses: wp.array(dtype=real),
        normal: wp.array(dtype=vec),
        answer: wp.array(dtype=mat),
    ):
        k = first + wp.tid()
        a = members[k] - offset
        if wanted[a] == 0:
            return
        turns = mat()
        n = vec()
        if alone[a] == 0:
            out = outward[a]
            if wp.static(fixed):
                out = cof(state.F[a]) @ out
            else:
                out = cof(state.F[a] @ invert(reference.F[a])) @ out
            n = wp.normalize(out)
            if wp.static(dim > 1 and fixed):
                A = plane_of(a, particles, reference, near, state.x, outward, outermost, centres[a], masses[a])
                along = cof(A) @ normals[a]
                if wp.length(along) > real(SPREAD):
                    n = wp.normalize(along)
                    turns = A
            elif wp.static(dim > 1):
                found, axes, spread, least, mass, centre = normal_of(
                    a, particles, reference, near, state.x, outward, outermost, out
                )
                if wp.length_sq(found) > real(0.0):
                    n = found
                    for i in range(wp.static(dim)):
                        if spread[i] > least:
                            e = vec()
                            for j in range(wp.static(dim)):
                                e[j] = axes[j, i]
                            turns += wp.outer(e, e) / ((spread[i] - least) * mass * particles.spacing[a])
                centres[a] = centre
                masses[a] = mass
        if wp.static(not fixed):
            normals[a] = n
        normal[k] = n
        answer[k] = turns

    return find_normals


@functools.cache
def make_lever(space: Space, fixed: bool) -> wp.Kernel:
    """Kernel: what a moment on each normal asks of the particles of its plane, ∂E/∂x_b = w Q ξ_b, ξ as in ``turn``.

    Where the plane is carried along, with h = (1 − n⊗n) ∂E/∂n over |cof(A) N|, Q = ∂(h·cof(A) N)/∂A: (h·N) 1 − N⊗h in
    2-D, −[h] A [N] with the matrices of the cross products in 3-D. Else n is an eigenvector of S,
    δn = Σ_i e_i (e_i·δS n)/(λ_n − λ_i).
    """
    vec, mat, real, dim, cof = space.vec, space.mat, space.real, space.dim, cofactor(space)
    Particles = structure(space, "Particles")

    @wp.kernel(module="unique", enable_backward=False)
    def find_lever(
        first: int,
        members: wp.array(dtype=wp.int32),
        offset: int,
        particles: Particles,
        wanted: wp.array(dtype=wp.int32),
        normals: wp.array(dtype=vec),
        masses: wp.array(dtype=real),
        answer: wp.array(dtype=mat),
        slope: wp.array(dtype=vec),
        levers: wp.array(dtype=mat),
    ):
        k = first + wp.tid()
        a = members[k] - offset
        Q = mat()
        A = answer[k]
        if wanted[a] == 1 and wp.ddot(A, A) > real(0.0):
            if wp.static(fixed):
                along = cof(A) @ normals[a]
                size = wp.length(along)
                n = along / size
                h = (slope[k] - n * wp.dot(n, slope[k])) / (size * masses[a] * particles.spacing[a])
                if wp.static(dim == 2):
                    Q = wp.identity(n=2, dtype=real) * wp.dot(h, normals[a]) - wp.outer(normals[a], h)
                if wp.static(dim == 3):
                    Q = -wp.skew(h) @ A @ wp.skew(normals[a])
            else:
                lever = A @ slope[k]
                Q = -wp.outer(lever, normals[a]) - wp.outer(normals[a], lever)
        levers[a] = Q

    return find_lever


@functools.cache
def make_turn(space: Space, fixed: bool) -> wp.Kernel:
    """Kernel: −∂E/∂n · ∂n/∂x: forces on the particles of a plane whose normal an energy depends on.

    ξ is from the particle whose plane it is, which takes what the others got, less 2⟨ξ⟩ in ``centres``; in the
    reference where this is ``fixed``. ``masses`` are Σ w.
    """
    vec, mat, real, separation = space.vec, space.mat, space.real, difference(space)
    weight_of, alike = surface_weight(space)[0], alike_vectors(space)
    Particles, Reference, State, Neighbours = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        structure(space, "State"),
        neighbour_structure(space),
    )

    @wp.kernel(module="unique", enable_backward=False)
    def turn(
        first: int,
        members: wp.array(dtype=wp.int32),
        offset: int,
        particles: Particles,
        reference: Reference,
        near: Neighbours,
        state: State,
        outward: wp.array(dtype=vec),
        wanted: wp.array(dtype=wp.int32),
        beside: wp.array(dtype=wp.int32),
        centres: wp.array(dtype=vec),
        masses: wp.array(dtype=real),
        levers: wp.array(dtype=mat),
        out: wp.array(dtype=vec),
    ):
        k = first + wp.tid()
        if beside[k] == 1:
            c = members[k] - offset
            force = vec()
            if wanted[c] == 1:  # less what its move does to all others of its plane
                w = weight_of(real(0.0), real(REACH) * particles.spacing[c])
                force -= levers[c] @ (centres[c] * (real(0.5) * masses[c] - w))
            for i in range(near.start[c], near.stop[c], near.stride):
                a = near.index[i]
                if wanted[a] == 1 and alike(outward[a], outward[c]):
                    apart = separation(reference.x[c], reference.x[a], near.box)
                    w = weight_of(wp.length(apart), real(REACH) * particles.spacing[a])
                    xi = apart
                    if wp.static(not fixed):
                        xi = separation(state.x[c], state.x[a], near.box)
                    force -= levers[a] @ (w * (xi / particles.spacing[a] - centres[a]))
            out[members[k]] = out[members[k]] + force

    return turn
