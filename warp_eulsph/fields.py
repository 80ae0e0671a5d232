"""The table of array fields, and the ``wp.struct`` types made from it.

Every array that kernels share stands in one table below with its kind, unit and meaning; ``structure`` makes the Warp
struct of a group and ``allocate`` its arrays, so that the table cannot drift from the code; ``structs.py`` has the
names for host code. Shapes: ``real`` (n,), ``vec`` (n,) of (dim,), ``mat`` (n,) of (dim, dim); ``int`` (n,).
"""

import functools
from collections.abc import Collection
from typing import Any, NamedTuple

import warp as wp

from .space import Space


class Field(NamedTuple):
    """One array field: kind (real, vec, mat, int), SI unit and meaning."""

    kind: str
    unit: str
    meaning: str


PARTICLES = {
    "mass": Field("real", "kg", "mass, fixed (per metre of depth in 2-D, per square metre in 1-D)"),
    "V0": Field("real", "m^d", "initial volume"),
    "h": Field("real", "m", "initial smoothing length, dilation times spacing"),
    "spacing": Field("real", "m", "initial particle spacing"),
    "share": Field("real", "-", "1; 0 for ghosts, which energies and momenta leave out"),
    "outward": Field("vec", "m^(d-1)", "area vector e_a at the start, of weights without tilt (M17): which way out is"),
    "body": Field("int", "-", "number of the body"),
    "group": Field("int", "-", "number of what is bonded together; only particles of one are neighbours"),
}
STATE = {
    "x": Field("vec", "m", "position"),
    "v": Field("vec", "m/s", "velocity"),
    "F": Field("mat", "-", "deformation gradient from the initial configuration, as the material carries it"),
    "surface": Field(
        "vec", "m^(d-1)", "outward area vector s_a, zero inside the body, moved by Nanson's rule (M10) where it is read"
    ),
}
REFERENCE = {
    "x": Field("vec", "m", "position in the reference"),
    "balanced": Field("vec", "m", "position that M4 and M5 take pair vectors from; x unless balanced (M13)"),
    "h": Field("real", "m", "smoothing length in the reference, which follows J_k^(1/d)"),
    "V": Field("real", "m^d", "volume in the reference, det(F_k) V0"),
    "resolution": Field(
        "real", "1/m", "of a fixed reference, 1/spacing, more where L is large: for the Courant number"
    ),
    "L": Field("mat", "-", "gradient correction (M3), not symmetric where positions are balanced (M13)"),
    "F": Field("mat", "-", "deformation gradient of the reference, F_k; empty where it is fixed, F_k = I"),
    "moment": Field("vec", "1/m", "sum of tilted w_ab (x_b - x_a) over the neighbours (M17); empty without tilt"),
    "row": Field("real", "kg/m^(d+2)", "sum of m_b g_ab over the neighbours (M7)"),
    "diagonal": Field("real", "1/m^2", "sum of V_b g_ab over the neighbours, of the graph Laplacian (M13)"),
}
FLUX = {
    "Q": Field("mat", "Pa", "stress in the reference, P F_k^T / J_k (M1)"),
    "Pi": Field("mat", "Pa", "stress times correction, Q L^T (M5); empty where the forces make it themselves"),
    "tie": Field("mat", "Pa", "share of Q that ties F to the positions (M16); empty where nothing is tied"),
    "secant": Field("real", "-", "root of the secant stiffness in shear over the elastic one, of what is tied (M16)"),
    "tied": Field("real", "J", "what the tie would hold more per root of the secant; empty where nothing tied yields"),
    "slipped": Field("real", "J", "what the tie lost by yielding in the last step; empty where nothing tied yields"),
    "dissipated": Field("real", "J", "energy that the law dissipated in the last step; empty where none does"),
    "drag": Field(
        "mat", "Pa", "share of Q that is the dissipation's (M9); empty where its forces are all there is of it"
    ),
    "speed": Field("real", "m/s", "pressure-wave speed measured in the reference"),
    "impedance": Field("real", "kg/(m^2 s)", "density times pressure-wave speed, both measured in the reference (M9)"),
    "shear_impedance": Field(
        "real", "kg/(m^2 s)", "density times shear-wave speed, both measured in the reference (M9)"
    ),
}
FORCES = {
    "internal": Field("vec", "N", "internal force -T of the dual divergence (M5)"),
    "correction": Field("vec", "N", "force of the closed pair areas (M10, M11, M12)"),
    "dissipation": Field("vec", "N", "upwind dissipation (M9)"),
    "tie": Field("vec", "N", "force that ties positions to F (M16)"),
    "external": Field("vec", "N", "body forces, tractions, pressures, damping"),
    "damping": Field("vec", "N", "share of the external forces that damps motion, zero where nothing does"),
    "free_v": Field("vec", "m/s", "velocity at the end of the step before the conditions were imposed"),
    "reaction": Field("vec", "N", "force that the imposed velocities took, mean over the step"),
}
GROUPS = {"Particles": PARTICLES, "State": STATE, "Reference": REFERENCE, "Flux": FLUX, "Forces": FORCES}


def element(space: Space, kind: str) -> type:
    """Warp type of one element of a field of this kind."""
    return {"real": space.real, "vec": space.vec, "mat": space.mat, "int": wp.int32}[kind]


@functools.cache
def structure(space: Space, group: str) -> Any:
    """The ``wp.struct`` of a group of fields."""
    annotations = {name: wp.array(dtype=element(space, field.kind)) for name, field in GROUPS[group].items()}
    return wp.struct(type(group, (), {"__annotations__": annotations, "__module__": __name__}))


def allocate(space: Space, group: str, n: int, device: wp.DeviceLike, empty: Collection[str] = ()) -> Any:
    """An instance of a group's struct with zeroed arrays of ``n`` particles, of none where the name is in ``empty``."""
    fields = structure(space, group)()
    for name, field in GROUPS[group].items():
        setattr(fields, name, wp.zeros(0 if name in empty else n, dtype=element(space, field.kind), device=device))
    return fields


def repeated(one: wp.array, n: int) -> wp.array:
    """An array of ``n`` elements, to be read only, that all are the one of ``one``, whose memory they take."""
    return wp.array(ptr=one.ptr, shape=(n,), strides=(0,), dtype=one.dtype, device=one.device)


def integers_of(array: wp.array) -> wp.array:
    """The memory of an array as one of int32: scratch, while nobody needs what is in it."""
    size = len(array) * wp.types.type_size_in_bytes(array.dtype) // 4
    return wp.array(ptr=array.ptr, shape=size, dtype=wp.int32, device=array.device)


def arrays(fields: Any, group: str) -> dict[str, wp.array]:
    """The arrays of an instance of a group's struct by name: ``State.x`` and so on."""
    return {f"{group}.{name}": getattr(fields, name) for name in GROUPS[group]}


def part(space: Space, fields: Any, group: str, span: range) -> Any:
    """A group's struct for the particles in ``span`` alone, whose arrays are views; itself where these are all."""
    views = structure(space, group)()
    for name in GROUPS[group]:
        setattr(views, name, part_of(getattr(fields, name), span))
    return fields if all(getattr(views, name) is getattr(fields, name) for name in GROUPS[group]) else views


def part_of(array: wp.array, span: range) -> wp.array:
    """The view of an array on the particles in ``span``; itself where these are all, or where it is empty."""
    return array if len(array) in (0, len(span)) else array[span.start : span.stop]


@functools.cache
def neighbour_structure(space: Space) -> Any:
    """Rows of neighbours: row a is ``index[start[a]:stop[a]:stride]``, sorted, without a itself.

    SIMD kernels have them one behind another (``stride`` 1, ``stop[a] = start[a+1]``), GPUs in slices of 32.

    ``w`` is V_b g_ab [1/m²] with g_ab = −W'(r)/r, so that V_b ∇W_ab = w_ab (x_b − x_a). M3 and M4 take ``own``, M5 the
    same of the other end, which is 2 w − own; both are w, and ``own`` the same array, unless the weights are tilted
    (M17). ``box`` [m] holds the lengths of the periodic box, zero where it is open.
    """

    @wp.struct
    class Neighbours:
        start: wp.array(dtype=wp.int32)
        stop: wp.array(dtype=wp.int32)
        stride: int
        index: wp.array(dtype=wp.int32)
        w: wp.array(dtype=space.real)
        own: wp.array(dtype=space.real)
        box: space.vec

    return Neighbours


@functools.cache
def clock_structure(space: Space) -> Any:
    """Time on the device, so that a recorded step stays valid: arrays of one element for each run that has a clock.

    The run of particle a is ``run[a]``, 0 where all share one clock; a medium's arrays begin ``first`` particles on.

    ``t`` [s] time, ``dt`` [s] step, ``free_dt`` [s] last step that no output time shortened, ``longest_dt`` [s] the
    longest of these, ``target`` [s] time that all must hit, ``look`` [s] time from which on the host looks, ``rate``
    [1/s] largest wave speed over spacing, or rate of strain that asks for as short a step, ``frequency`` [1/s] what a
    condition asks for (``Bound.limit``) and ``added`` [1/s²] the sum of all their (½ frequency)², ``bad`` place of the
    first unphysical particle, below 0 where the host knows of it; of a batch of recorded steps ``running``, 0 when the
    rest is not to be taken, and ``taken``, steps so far, both of one element. Of runs that are independent ``steps``
    taken and ``lag``, steps of others in which they waited, until it is a multiple of ``every``, which is 0 where all
    share one clock.
    """

    @wp.struct
    class Clock:
        t: wp.array(dtype=wp.float64)
        dt: wp.array(dtype=wp.float64)
        free_dt: wp.array(dtype=wp.float64)
        longest_dt: wp.array(dtype=wp.float64)
        target: wp.array(dtype=wp.float64)
        look: wp.array(dtype=wp.float64)
        rate: wp.array(dtype=space.real)
        frequency: wp.array(dtype=space.real)
        added: wp.array(dtype=wp.float64)
        bad: wp.array(dtype=wp.int32)
        running: wp.array(dtype=wp.int32)
        taken: wp.array(dtype=wp.int32)
        steps: wp.array(dtype=wp.int32)
        lag: wp.array(dtype=wp.int32)
        run: wp.array(dtype=wp.int32)
        first: int
        every: int

    return Clock
