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
def make_normals(space: Space, fixed: bool) -> wp.Kernel:
    """Kernel: normals of the planes through the outermost particles around.

    S n = λ n of least λ, S = ⟨ξ'⊗ξ'⟩ − ⟨ξ⟩⊗⟨ξ⟩, ξ' from their mean ⟨ξ⟩. Around a corner the mean lies within: without
    its square moments about it are much alike, and n would swing by a right angle where they cross. On flat faces it
    lies across n and changes nothing.

    And how a normal turns with these: ``answer``, Σ_i e_i ⊗ e_i/(λ_i − λ_n) over the other eigenvectors of their second
    moment, over their weight and spacing. Those ``alone`` have none.
    """
    vec, mat, real, dim, cof, invert = space.vec, space.mat, space.real, space.dim, cofactor(space), inverse(space)
    moments_of, eigen, order_of = plane_moments(space), symmetric_eigen(space, SWEEPS[dim]), least_two(space)
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
        out = outward[a]
        turns = mat()
        if wp.static(fixed):
            out = cof(state.F[a]) @ out
        else:
            out = cof(state.F[a] @ invert(reference.F[a])) @ out
        n = wp.normalize(out)
        if wp.static(dim > 1):
            mass, mean, square = moments_of(a, particles, reference, near, state.x, outward, outermost)
            axes, spread = eigen(square - wp.outer(mean, mean))
            least, next = order_of(spread)
            if spread[next] > real(SPREAD) and wp.length(out) > real(0.0):
                for i in range(wp.static(dim)):
                    n[i] = axes[i, least]
                if wp.dot(n, out) < real(0.0):
                    n = -n
                for i in range(wp.static(dim)):
                    if spread[i] > spread[least]:
                        e = vec()
                        for j in range(wp.static(dim)):
                            e[j] = axes[j, i]
                        turns += wp.outer(e, e) / ((spread[i] - spread[least]) * mass * particles.spacing[a])
            centres[a] = real(2.0) * mean
            masses[a] = mass
        if alone[a] == 1:
            n = vec()
            turns = mat()
        normals[a] = n
        normal[k] = n
        answer[k] = turns

    return find_normals


@functools.cache
def make_lever(space: Space) -> wp.Kernel:
    """Kernel: what a moment on each normal asks of the particles of its plane."""
    vec, mat = space.vec, space.mat

    @wp.kernel(module="unique", enable_backward=False)
    def find_lever(
        first: int,
        members: wp.array(dtype=wp.int32),
        offset: int,
        wanted: wp.array(dtype=wp.int32),
        answer: wp.array(dtype=mat),
        slope: wp.array(dtype=vec),
        levers: wp.array(dtype=vec),
    ):
        k = first + wp.tid()
        a = members[k] - offset
        lever = vec()
        if wanted[a] == 1:
            lever = answer[k] @ slope[k]
        levers[a] = lever

    return find_lever


@functools.cache
def make_turn(space: Space) -> wp.Kernel:
    """Kernel: −∂E/∂n · ∂n/∂x: forces on the particles of a plane whose normal an energy depends on.

    n is an eigenvector of S = Σ w ξ⊗ξ/W − 2⟨ξ⟩⊗⟨ξ⟩, so δn = Σ_i e_i (e_i·δS n)/(λ_n − λ_i); ``centres`` are 2⟨ξ⟩,
    ``masses`` W. All ξ are from the particle whose plane it is, so that it takes what the others got.
    """
    vec, real, separation = space.vec, space.real, difference(space)
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
        normals: wp.array(dtype=vec),
        centres: wp.array(dtype=vec),
        masses: wp.array(dtype=real),
        levers: wp.array(dtype=vec),
        out: wp.array(dtype=vec),
    ):
        k = first + wp.tid()
        if beside[k] == 1:
            c = members[k] - offset
            force = vec()
            if wanted[c] == 1:  # less what its move does to all others of its plane
                w = weight_of(real(0.0), real(REACH) * particles.spacing[c])
                xi = centres[c] * (real(0.5) * masses[c] - w)
                force = levers[c] * wp.dot(normals[c], xi) + normals[c] * wp.dot(levers[c], xi)
            for i in range(near.start[c], near.stop[c], near.stride):
                a = near.index[i]
                if wanted[a] == 1 and alike(outward[a], outward[c]):
                    apart = separation(reference.x[c], reference.x[a], near.box)
                    w = weight_of(wp.length(apart), real(REACH) * particles.spacing[a])
                    xi = separation(state.x[c], state.x[a], near.box) / particles.spacing[a] - centres[a]
                    force += w * (levers[a] * wp.dot(normals[a], xi) + normals[a] * wp.dot(levers[a], xi))
            out[members[k]] = out[members[k]] + force

    return turn
