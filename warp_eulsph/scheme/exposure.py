"""Who is at a free surface of an arrangement, and who beside one, by the sums e_a alone."""

import functools
from typing import TYPE_CHECKING

import warp as wp

from ..execution import Launcher
from ..fields import neighbour_structure, structure
from ..space import Space
from ..structs import NeighbourRows, ParticleArrays

if TYPE_CHECKING:
    from .reference import Configuration

# A particle is at a free surface where |e_a| exceeds this share of its own face. At flat faces e_a is 1.2 (Wendland C2,
# dilation 1.8) to 1.4 (cubic spline, 1.3) of it on lattices, at least 0.98 with 20 % jitter; inside it is at most 0.5
# with 20 % jitter (``tests/test_exposure.py``), and reaches 0.7 in a flow that mixes.
EXPOSED = 0.8
# And where M3 sees less than half of the matter around it: what flew off alone, or is a sheet of one layer, has next to
# no e_a, for it has no neighbours, or as many on both sides.
SPARSE = 0.5


@functools.cache
def share_of_face(space: Space) -> wp.Function:
    """``wp.func`` |e|ᵈ/Vᵈ⁻¹, the d-th power of |e| over the face of a particle of volume V: no root to take."""
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
def _make_expose(space: Space) -> wp.Kernel:
    """Kernel: which particles are at a free surface, e_a = s_a + d_a or few beside; none of those not ``free``."""
    real, vec, mat, share, least = space.real, space.vec, space.mat, share_of_face(space), EXPOSED**space.dim
    Reference, few = structure(space, "Reference"), SPARSE * space.dim

    @wp.kernel(module="unique", enable_backward=False)
    def expose(
        first: int,
        reference: Reference,
        K: wp.array(dtype=mat),
        surface: wp.array(dtype=vec),
        defect: wp.array(dtype=vec),
        free: wp.array(dtype=wp.int32),
        exposed: wp.array(dtype=wp.int32),
    ):
        a = first + wp.tid()
        exposed[a] = 0
        open = share(surface[a] + defect[a], reference.V[a]) > real(least) or wp.trace(K[a]) < real(few)
        if free[a] != 0 and open:
            exposed[a] = 1

    return expose


@functools.cache
def _make_beside(space: Space, apart: bool) -> wp.Kernel:
    """Kernel: which particles are exposed or have neighbours that are, or, with ``apart``, ones of another body."""
    Particles, Neighbours = structure(space, "Particles"), neighbour_structure(space)
    other = "found |= body.data[b] != body.data[a];" if apart else ""

    # C++, for loops of Warp look at one neighbour after another
    @wp.func_native(f"""
    int found = exposed.data[a];
    for (int k = begin; k < end; k += stride) {{
        const int b = index.data[k];
        found |= exposed.data[b];
        {other}
    }}
    return found;
    """)
    def any_beside(
        a: int,
        begin: int,
        end: int,
        stride: int,
        index: wp.array(dtype=int),
        exposed: wp.array(dtype=int),
        body: wp.array(dtype=int),
    ) -> int: ...

    @wp.kernel(module="unique", enable_backward=False)
    def find_beside(
        first: int,
        particles: Particles,
        near: Neighbours,
        exposed: wp.array(dtype=wp.int32),
        beside: wp.array(dtype=wp.int32),
    ):
        a = first + wp.tid()
        beside[a] = any_beside(a, near.start[a], near.stop[a], near.stride, near.index, exposed, particles.body)

    return find_beside


@functools.cache
def _make_clear(space: Space) -> wp.Kernel:
    """Kernel: s_a ← 0 where a particle is not near a free surface."""
    vec = space.vec

    @wp.kernel(module="unique", enable_backward=False)
    def clear(first: int, near: wp.array(dtype=wp.int32), surface: wp.array(dtype=vec)):
        a = first + wp.tid()
        if near[a] == 0:
            surface[a] = vec()

    return clear


class Exposure:
    """Who is beside a free surface in one arrangement.

    Args:
        free: (n,) int32, zero for particles whose exposure does not count.
        apart: particles next to another body that theirs is bonded to are beside a surface too.

    Attributes:
        beside: (n,) int32, one for particles at a free surface and their neighbours.
    """

    def __init__(self, space: Space, particles: ParticleArrays, free: wp.array, apart: bool, device: wp.DeviceLike):
        self.apart = apart
        self.space, self.particles, self.free, self._launch = space, particles, free, Launcher(device)
        self._exposed, self.beside = (wp.zeros(len(free), dtype=wp.int32, device=device) for _ in range(2))

    def find(self, configuration: "Configuration", surface: wp.array, defect: wp.array) -> None:
        """Look at e_a = s_a + d_a [m^(d−1)], from ``surface`` and ``defect``, (n,) of vec, and at M3."""
        n, near = len(self.free), configuration.near
        arguments = [configuration.fields, configuration.K, surface, defect, self.free, self._exposed]
        self._launch(_make_expose(self.space), n, arguments)
        self._launch(_make_beside(self.space, self.apart), n, [self.particles, near, self._exposed, self.beside])

    def clear(self, near: NeighbourRows, surface: wp.array) -> None:
        """``surface`` ← 0 where neither a particle nor a neighbour is beside a free surface: there e_a is noise.

        e_a has L of its neighbours in it, which are other than inside as far as their support reaches the surface.
        """
        n = len(self.free)
        self._launch(_make_beside(self.space, False), n, [self.particles, near, self.beside, self._exposed])
        self._launch(_make_clear(self.space), n, [self._exposed, surface])
