"""The law of contact: what two outermost particles of different bodies exert on each other."""

import functools
from typing import Any

import warp as wp

from ..atomics import raise_to
from ..fields import clock_structure, structure
from ..space import Space
from .faces import REACH, surface_weight

# Scatter of a surface around its plane, over its extent, below which it is flat: 3 % of a spacing.
FLAT = 1.0e-3
# Part of the sum of half widths below which the pressure goes on along its tangent: it stays finite where bodies were
# shot into each other.
PRESSED = 0.25
# Share of a gap that may close in a step, over the Courant number: that of ``STRAIN`` in ``scheme/flux_kernels.py``,
# for half cells are matter too.
CLOSING = 0.25


@functools.cache
def skin_structure(space: Space) -> Any:
    """``wp.struct`` of a skin's arrays, as ``Skin`` has them, and ``given`` [m], of ``make_give``."""

    @wp.struct
    class SkinArrays:
        places: wp.array(dtype=wp.int32)
        there: wp.array(dtype=wp.int32)
        area: wp.array(dtype=space.real)
        half: wp.array(dtype=space.real)
        modulus: wp.array(dtype=space.real)
        shear_modulus: wp.array(dtype=space.real)
        normal: wp.array(dtype=space.vec)
        bend: wp.array(dtype=space.real)
        given: wp.array(dtype=space.real)

    return SkinArrays


@functools.cache
def rows_structure() -> Any:
    """``wp.struct`` of the rows of ``Nearby``."""

    @wp.struct
    class Rows:
        start: wp.array(dtype=wp.int32)
        index: wp.array(dtype=wp.int32)

    return Rows


@functools.cache
def facing(space: Space) -> wp.Function:
    """``wp.func`` row: how much two normals face each other, and its slope with n·n'.

    1 up to 60° from opposite, 0 from 75.5° on, a cubic step between: where a ramp had its kinks surfaces that crease,
    whose normals swing there, made a tenth of the energy of two rings.
    """
    real, vec, pair = space.real, space.vec, space.row(2)

    @wp.func
    def facing(n: vec, other: vec) -> pair:
        share = real(-4.0) * wp.dot(n, other) - real(1.0)
        if wp.length_sq(n) == real(0.0) or wp.length_sq(other) == real(0.0):
            share = real(1.0)  # fragments face all
        if share >= real(1.0):
            return pair(real(1.0), real(0.0))
        if share <= real(0.0):
            return pair(real(0.0), real(0.0))
        left = real(1.0) - share
        return pair(share * share * (real(1.0) + real(2.0) * left), real(-24.0) * share * left)

    return facing


@functools.cache
def pressure(space: Space) -> wp.Function:
    """``wp.func`` (r, r0) -> row (p, ∫_r^{r0} p dr) over K: p = ln(r0/r), from r0/4 down along its tangent.

    What was shot through, r < 0, is behind at −r0 and feels nothing there: the energy fades until then by a cubic step,
    or it would be made of nothing.
    """
    real, pair = space.real, space.row(2)

    @wp.func
    def pressure(r: real, r0: real) -> pair:
        if r >= r0:
            return pair(real(0.0), real(0.0))
        least = real(PRESSED) * r0
        s = wp.max(r, least)
        p = wp.log(r0 / s)
        stored = r0 - s - s * p
        further = s - r
        stored += further * (p + real(0.5) * further / least)
        p += further / least
        passed = -r / r0
        if passed > real(0.0):
            left = wp.max(real(1.0) - passed, real(0.0))
            p = left * (left * (real(1.0) + real(2.0) * passed) * p - real(6.0) * passed * stored / r0)
            stored *= left * left * (real(1.0) + real(2.0) * passed)
        return pair(p, stored)

    return pressure


@functools.cache
def meeting(space: Space) -> wp.Function:
    """``wp.func`` (skin, lower, upper, d) -> normal n, row (r, r0, |r_t|, h, share · A_a A_b, q, q', slope).

    q and q' are how much n follows the normals of both, ∂n/∂n_a = q (1 − n⊗n) and ∂n/∂n_b = −q' (1 − n⊗n); the slope is
    that of share · A_a A_b with n_a·n_b.

    The normal of the flatter surface counts for more: that of a face, where a corner meets it. (A tilt of a thousandth
    there is a false gap of a thousandth of a spacing, and a pressure of K/1000.)
    """
    real, vec, SkinArrays, row = space.real, space.vec, skin_structure(space), space.row(8)
    facing_of = facing(space)

    @wp.func
    def meeting(skin: SkinArrays, lower: int, upper: int, d: vec):
        q = skin.bend[upper] * skin.bend[upper] + real(wp.static(FLAT**2))
        q_other = skin.bend[lower] * skin.bend[lower] + real(wp.static(FLAT**2))
        along = q * skin.normal[lower] - q_other * skin.normal[upper]
        if wp.length_sq(along) == real(0.0):
            along = d
            q = real(0.0)
            q_other = real(0.0)
        size = wp.length(along)
        n = along / size
        apart = wp.dot(n, d)
        r = apart + skin.given[lower] + skin.given[upper]
        r0 = skin.half[lower] + skin.half[upper]
        h = real(wp.static(2.0 * REACH)) * wp.max(skin.half[lower], skin.half[upper])
        areas = facing_of(skin.normal[lower], skin.normal[upper]) * (skin.area[lower] * skin.area[upper])
        if r <= -r0:  # behind each other: the far sides of what is thin
            areas = areas * real(0.0)
        return n, row(r, r0, wp.length(d - n * apart), h, areas[0], q / size, q_other / size, areas[1])

    return meeting


@functools.cache
def in_reach(space: Space) -> wp.Function:
    """``wp.func`` whether d is within the range of the weight across and ``along`` sums of half widths along it."""
    real, vec, SkinArrays = space.real, space.vec, skin_structure(space)

    @wp.func
    def in_reach(skin: SkinArrays, k: int, m: int, d: vec, along: real) -> bool:
        across = real(wp.static(4.0 * REACH)) * wp.max(skin.half[k], skin.half[m])
        if wp.static(space.dim == 1):
            across = real(0.0)
        r0 = along * (skin.half[k] + skin.half[m])
        return wp.length_sq(d) < across * across + r0 * r0

    return in_reach


@functools.cache
def stiffness(space: Space) -> wp.Function:
    """``wp.func`` (skin, lower, upper) -> row 1/(w_a/M_a + w_b/M_b) of pressure and of shear [Pa/m]; 0 for liquids."""
    real, SkinArrays, pair = space.real, skin_structure(space), space.row(2)

    @wp.func
    def stiffness(skin: SkinArrays, lower: int, upper: int) -> pair:
        normal = real(1.0) / (skin.half[lower] / skin.modulus[lower] + skin.half[upper] / skin.modulus[upper])
        shear = real(0.0)
        if skin.shear_modulus[lower] > real(0.0) and skin.shear_modulus[upper] > real(0.0):
            soft = skin.half[lower] / skin.shear_modulus[lower] + skin.half[upper] / skin.shear_modulus[upper]
            shear = real(1.0) / soft
        return pair(normal, shear)

    return stiffness


@functools.cache
def make_push(space: Space, rubs: bool) -> wp.Kernel:
    """Kernel: forces of contact of the rows, and half of the energy of each pair; with friction where it ``rubs``.

    A pair is seen from its lower number at both ends, so that both find the same bits. ``slope`` takes what the energy
    changes by with the normal of each, without friction. ``slip`` is as in ``friction.py``, and ahead by ``fraction``
    Δt.
    """
    real, vec, SkinArrays, Rows = space.real, space.vec, skin_structure(space), rows_structure()
    Clock, meeting_of, stiffness_of, pressure_of = (
        clock_structure(space),
        meeting(space),
        stiffness(space),
        pressure(space),
    )
    (weight_of, slope_of), reaches = surface_weight(space), in_reach(space)

    @wp.kernel(module="unique", enable_backward=False)
    def push(
        first: int,
        skin: SkinArrays,
        rows: Rows,
        x: wp.array(dtype=vec),
        v: wp.array(dtype=vec),
        clock: Clock,
        fraction: wp.float64,
        friction: real,
        slip: wp.array(dtype=vec),
        out: wp.array(dtype=vec),
        slope: wp.array(dtype=vec),
        energy: wp.array(dtype=wp.float64),
    ):
        k = first + wp.tid()
        force = vec()
        turned = vec()
        stored = real(0.0)
        for i in range(rows.start[k], rows.start[k + 1]):
            lower = wp.min(k, rows.index[i])
            upper = wp.max(k, rows.index[i])
            a, b = skin.places[lower], skin.places[upper]
            d = x[b] - x[a]
            if not reaches(skin, lower, upper, d, real(1.0)):
                continue
            n, how = meeting_of(skin, lower, upper, d)
            if how[4] > real(0.0) and how[0] < how[1]:
                stiff = stiffness_of(skin, lower, upper)
                K = stiff[0] * how[1]
                p = pressure_of(how[0], how[1])
                apart = wp.dot(n, d)
                beside = d - n * apart
                weight = weight_of(how[2], how[3])
                along = weight * K * p[0]
                aside = slope_of(how[2], how[3]) * K * p[1]
                pushed = n * along + beside * aside
                stored += how[4] * weight * K * p[1]
                lean = beside * (how[4] * (apart * aside - along))  # the slope of the energy with n
                if wp.static(rubs):
                    u = (slip[lower] - slip[upper]) * real(0.5) + (v[b] - v[a]) * real(fraction * clock.dt[0])
                    u = u - n * wp.dot(n, u)
                    most = friction * K * wp.max(p[0], real(0.0))
                    if stiff[1] * wp.length(u) > most:
                        u = wp.normalize(u) * (most / stiff[1])
                    pushed -= u * (weight * stiff[1])
                    stored += real(0.5) * how[4] * weight * stiff[1] * wp.length_sq(u)
                facing_slope = how[7] * weight * K * p[1]
                if k == lower:
                    force -= pushed * how[4]
                    turned += lean * how[5] + skin.normal[upper] * facing_slope
                else:
                    force += pushed * how[4]
                    turned += skin.normal[lower] * facing_slope - lean * how[6]
        if rows.start[k + 1] > rows.start[k]:
            out[skin.places[k]] = out[skin.places[k]] + force
        slope[k] = turned
        energy[k] = wp.float64(0.5) * wp.float64(stored)

    return push


@functools.cache
def make_give(space: Space) -> wp.Kernel:
    """Kernel: how much nearer others may be to each before it is pressed [m].

    What ``came`` to the surface within the range of others is given what they are too near, or energy would come from
    nowhere; two that came at once share it. It is taken back as far as they part.
    """
    real, vec, SkinArrays, Rows = space.real, space.vec, skin_structure(space), rows_structure()
    meeting_of, weight_of = meeting(space), surface_weight(space)[0]

    @wp.kernel(module="unique", enable_backward=False)
    def give(
        first: int,
        skin: SkinArrays,
        rows: Rows,
        x: wp.array(dtype=vec),
        came: wp.array(dtype=wp.int32),
        given: wp.array(dtype=real),
    ):
        k = first + wp.tid()
        if came[k] == 0 and skin.given[k] == real(0.0):
            return
        needed = real(0.0)
        for i in range(rows.start[k], rows.start[k + 1]):
            m = rows.index[i]
            _n, how = meeting_of(skin, k, m, x[skin.places[m]] - x[skin.places[k]])
            if how[4] * weight_of(how[2], how[3]) > real(0.0):
                near = how[1] - how[0] + skin.given[k] + skin.given[m]
                if came[k] == 1 and came[m] == 1:
                    near = real(0.5) * near
                needed = wp.max(needed, near)
        if came[k] == 0:
            needed = wp.min(needed, skin.given[k])
        given[k] = needed

    return give


@functools.cache
def make_rate(space: Space) -> wp.Kernel:
    """Kernel: the largest frequency of contact, of what may touch in the step, or rate at which gaps close [1/s].

    The half cells between two particles are a spring of the stiffness A_a A_b φ K/r.
    """
    real, vec, SkinArrays, Particles = space.real, space.vec, skin_structure(space), structure(space, "Particles")
    Rows, raise_rate = rows_structure(), raise_to(space.real)
    meeting_of, stiffness_of, weight_of = meeting(space), stiffness(space), surface_weight(space)[0]
    reaches = in_reach(space)

    @wp.kernel(module="unique", enable_backward=False)
    def rate(
        first: int,
        skin: SkinArrays,
        rows: Rows,
        x: wp.array(dtype=vec),
        v: wp.array(dtype=vec),
        particles: Particles,
        largest: wp.array(dtype=real),
    ):
        k = first + wp.tid()
        a = skin.places[k]
        square = real(0.0)
        closing = real(0.0)
        for i in range(rows.start[k], rows.start[k + 1]):
            b = skin.places[rows.index[i]]
            if not reaches(skin, k, rows.index[i], x[b] - x[a], real(2.0)):
                continue
            n, how = meeting_of(skin, k, rows.index[i], x[b] - x[a])
            weight = weight_of(how[2], how[3])
            if how[4] * weight > real(0.0) and how[0] < real(2.0) * how[1]:
                gap = wp.max(how[0], real(PRESSED) * how[1])
                spring = how[4] * weight * stiffness_of(skin, k, rows.index[i])[0] * how[1] / wp.min(gap, how[1])
                square += spring * (real(1.0) / particles.mass[a] + real(1.0) / particles.mass[b])
                closing = wp.max(closing, wp.dot(v[a] - v[b], n) / gap)
        frequency = wp.max(wp.sqrt(square), closing * real(wp.static(2.0 / CLOSING)))
        if frequency > real(0.0):
            raise_rate(largest, frequency)

    return rate


@functools.cache
def make_raise(space: Space) -> wp.Kernel:
    """Kernel of one thread: ask for a step by the frequency that was found."""
    real, Clock = space.real, clock_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def raise_frequency(found: wp.array(dtype=real), clock: Clock):
        clock.frequency[0] = wp.max(clock.frequency[0], found[0])

    return raise_frequency
