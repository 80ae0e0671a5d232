"""Coulomb friction: how far what touches has slipped elastically, and what slides."""

import functools

import warp as wp

from ..fields import clock_structure
from ..space import Space
from .faces import surface_weight
from .law import meeting, pressure, rows_structure, skin_structure, stiffness


@functools.cache
def make_slip(space: Space) -> wp.Kernel:
    """Kernel: the elastic slip of each particle after a step [m], from means over what presses on it.

    It grows by the step's motion of the others against it, Σ A_b φ p (v_b − v_a) Δt over Σ A_b φ p, along the surface;
    where the stress of the half cells in shear exceeds friction times the mean pressure it slides, and the slip keeps
    what friction holds. It is nothing where nothing presses. Two particles find half the difference of theirs.
    """
    real, vec, SkinArrays, Rows = space.real, space.vec, skin_structure(space), rows_structure()
    Clock, meeting_of, stiffness_of, pressure_of = (
        clock_structure(space),
        meeting(space),
        stiffness(space),
        pressure(space),
    )
    weight_of = surface_weight(space)[0]

    @wp.kernel(module="unique", enable_backward=False)
    def advance_slip(
        first: int,
        skin: SkinArrays,
        rows: Rows,
        x: wp.array(dtype=vec),
        v: wp.array(dtype=vec),
        clock: Clock,
        friction: real,
        slip: wp.array(dtype=vec),
    ):
        k = first + wp.tid()
        a = skin.places[k]
        pressed = real(0.0)
        shear = real(0.0)
        motion = vec()
        along = vec()
        for i in range(rows.start[k], rows.start[k + 1]):
            m = rows.index[i]
            b = skin.places[m]
            n, how = meeting_of(skin, k, m, x[b] - x[a])
            if how[4] > real(0.0) and how[0] < how[1]:
                stiff = stiffness_of(skin, k, m)
                weight = how[4] * weight_of(how[2], how[3])
                p = weight * stiff[0] * how[1] * wp.max(pressure_of(how[0], how[1])[0], real(0.0))
                pressed += p
                shear += weight * stiff[1]
                motion += p * (v[b] - v[a])
                along += p * n
        u = vec()
        if pressed > real(0.0) and shear > real(0.0):
            n = wp.normalize(along)
            u = slip[k] + motion * (real(clock.dt[0]) / pressed)
            u = u - n * wp.dot(n, u)
            most = friction * pressed / shear
            if wp.length(u) > most:
                u = wp.normalize(u) * most
        slip[k] = u

    return advance_slip
