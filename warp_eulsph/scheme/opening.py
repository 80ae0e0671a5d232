"""Free surfaces of an arrangement that moves: who is at one, and the area vectors that its particles stand for."""

import functools

import warp as wp

from ..atomics import lower_to
from ..fields import structure
from ..space import Space

# A particle is at a free surface where |e_a| exceeds this share of its own face. At flat faces e_a is 1.2 (Wendland C2,
# dilation 1.8) to 1.4 (cubic spline, 1.3) of it on lattices, at least 1.0 with 20 % jitter; inside it is 0.5 with 20 %
# jitter and reaches 0.7 in a flow that mixes (``tests/test_opening.py``).
EXPOSED = 0.8

# A defect e_a − s_a of more than a particle's own face is no irregularity: the body has opened there, or closed.
OPENED = 1.0


@functools.cache
def share_of_face(space: Space) -> wp.Function:
    """``wp.func`` |e|ᵈ/Vᵈ⁻¹, the d-th power of |e| over the face of a volume V: no root to take."""
    real, vec, dim = space.real, space.vec, space.dim

    @wp.func
    def share_of_face(e: vec, V: real) -> real:
        length = wp.length(e)
        share = length
        for _ in range(wp.static(dim - 1)):
            share *= length / V
        return share

    return share_of_face


@functools.cache
def is_exposed(space: Space) -> wp.Function:
    """``wp.func`` whether a particle with the sums e [m^(d−1)] and the volume V [m^d] is at a free surface."""
    real, vec, share, least = space.real, space.vec, share_of_face(space), EXPOSED**space.dim

    @wp.func
    def is_exposed(e: vec, V: real) -> bool:
        return share(e, V) > real(least)

    return is_exposed


@functools.cache
def area_vector(space: Space) -> wp.Function:
    """``wp.func`` s [m^(d−1)] of a particle with the sums e and the volume V: its own face where it is exposed, else 0.

    e itself alternates from layer to layer, and inside it is noise, which a stress of the order of the modulus turns
    into forces that tear the body.
    """
    real, vec, exposed, power = space.real, space.vec, is_exposed(space), float(space.dim - 1) / float(space.dim)

    @wp.func
    def area_vector(e: vec, V: real) -> vec:
        if exposed(e, V):
            return e * (wp.pow(V, real(power)) / wp.length(e))
        return vec()

    return area_vector


@functools.cache
def make_face(space: Space) -> wp.Kernel:
    """Kernel: s_a from e_a, in place."""
    vec, Reference, area_of = space.vec, structure(space, "Reference"), area_vector(space)

    @wp.kernel(module="unique", enable_backward=False)
    def face(first: int, reference: Reference, surface: wp.array(dtype=vec)):
        a = first + wp.tid()
        surface[a] = area_of(surface[a], reference.V[a])

    return face


@functools.cache
def make_renew(space: Space) -> wp.Kernel:
    """Kernel: s_a anew from e_a where the body has opened or closed (M13).

    ``torn`` takes the place of the first particle with a new face.
    """
    real, vec, Reference, share, most = (
        space.real,
        space.vec,
        structure(space, "Reference"),
        share_of_face(space),
        OPENED**space.dim,
    )
    area_of = area_vector(space)

    @wp.kernel(module="unique", enable_backward=False)
    def renew(
        first: int,
        reference: Reference,
        defect: wp.array(dtype=vec),
        surface: wp.array(dtype=vec),
        torn: wp.array(dtype=wp.int32),
    ):
        a = first + wp.tid()
        if share(defect[a], reference.V[a]) > real(most):
            e = surface[a] + defect[a]
            s = area_of(e, reference.V[a])
            if wp.length(s) > wp.length(surface[a]):
                lower_to(torn, a)
            surface[a] = s
            defect[a] = e - s

    return renew
