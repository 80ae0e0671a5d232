"""Solids in the sums of a liquid: their particles are matter beside it, as they are (M28)."""

import functools
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..atomics import raise_to
from ..boundaries import Assembly
from ..execution import Launcher
from ..fields import clock_structure, structure
from ..operators.grid_search import QUERY_MARGIN, make_longest
from ..reduce import Sum
from ..space import Space
from ..weights import Weight
from ..weights.base import pair_weight
from .wetting import MOST, grow_across, make_add_up

if TYPE_CHECKING:
    from ..scheme.medium import Medium
    from ..scheme.world import World


@functools.cache
def _grid_vector(space: Space) -> Any:
    return wp.types.vector(length=3, dtype=space.real)


@functools.cache
def _shore_structure(space: Space) -> Any:
    """A liquid and the solids in its sums, as both were in the present reference.

    Of the solids' particles ``at`` [m], ``V`` [m^d], ``places`` in memory, (m,), and ``solids``, their grid; of the
    liquid's ``own`` [m], their places ``members``, (n,), from ``offset`` on, ``liquid``, their grid, and ``longest``,
    the largest smoothing length [m].
    """
    vec3 = _grid_vector(space)

    @wp.struct
    class Shore:
        solids: wp.uint64
        at: wp.array(dtype=vec3)
        V: wp.array(dtype=space.real)
        places: wp.array(dtype=wp.int32)
        liquid: wp.uint64
        own: wp.array(dtype=vec3)
        members: wp.array(dtype=wp.int32)
        offset: int
        longest: wp.array(dtype=space.real)

    return Shore


@functools.cache
def _make_note(space: Space) -> wp.Kernel:
    """Kernel: where particles are, as 3-vectors for the grid."""
    vec, dim, real, vec3 = space.vec, space.dim, space.real, _grid_vector(space)

    @wp.kernel(module="unique", enable_backward=False)
    def note(first: int, places: wp.array(dtype=wp.int32), x: wp.array(dtype=vec), padded: wp.array(dtype=vec3)):
        i = first + wp.tid()
        q = vec3()
        for j in range(wp.static(dim)):
            q[j] = real(x[places[i]][j])
        padded[i] = q

    return note


@functools.cache
def _pair(weight: Weight, space: Space) -> wp.Function:
    """``wp.func`` (x_a, x_b, h_a, κ V_b) -> 2 κ V_b g_ab ξ [1/m], G of one particle of a solid, mostly zero."""
    vec, real, dim, vec3, g_of = space.vec, space.real, space.dim, _grid_vector(space), pair_weight(weight, space)
    reach = float(weight.support) * QUERY_MARGIN

    @wp.func
    def pair(x_a: vec3, x_b: vec3, h: real, kappa_V: real) -> vec:
        xi = vec()
        for j in range(wp.static(dim)):
            xi[j] = x_b[j] - x_a[j]
        G = vec()
        if wp.length_sq(xi) < real(reach) * real(reach) * h * h:  # grids ask whole cells
            G = xi * (real(2.0) * kappa_V * g_of(wp.length(xi), h))
        return G

    return pair


@functools.cache
def _make_meet(weight: Weight, space: Space) -> wp.Kernel:
    """Kernel: which particles of the liquid have solids in their sums, Σ_b |G_ab|, and L: whole across (M28)."""
    vec, real, dim, Shore, pair = space.vec, space.real, space.dim, _shore_structure(space), _pair(weight, space)
    Reference, reach = structure(space, "Reference"), float(weight.support) * QUERY_MARGIN
    grow = grow_across(space)

    @wp.kernel(module="unique", enable_backward=False)
    def meet(
        first: int,
        shore: Shore,
        reference: Reference,
        kappa: wp.array(dtype=real),
        wet: wp.array(dtype=wp.int32),
        met: wp.array(dtype=real),
    ):
        k = first + wp.tid()
        a = shore.members[k] - shore.offset
        total = vec()
        size = real(0.0)
        scatter = real(0.0)
        for i in wp.hash_grid_query(shore.solids, shore.own[k], real(reach) * reference.h[a]):
            G = pair(shore.own[k], shore.at[i], reference.h[a], kappa[a] * shore.V[i])
            total += G
            size += wp.length(G)
        met[k] = size
        wet[k] = int(wp.length_sq(total) > real(0.0))
        if wet[k] == 1:
            n = wp.normalize(total)
            for i in wp.hash_grid_query(shore.solids, shore.own[k], real(reach) * reference.h[a]):
                G = pair(shore.own[k], shore.at[i], reference.h[a], kappa[a] * shore.V[i])
                xi = vec()
                for j in range(wp.static(dim)):
                    xi[j] = shore.at[i][j] - shore.own[k][j]
                scatter += real(0.5) * (wp.dot(G, xi) - wp.dot(G, n) * wp.dot(n, xi))
            across = real(0.0)
            if wp.static(dim > 1):
                across = wp.min(scatter / real(wp.static(max(dim - 1, 1))), real(MOST))
            grown = wp.sqrt(real(1.0) / (real(1.0) - across))
            reference.L[a] = grow(reference.L[a], n, grown)

    return meet


@functools.cache
def _make_gradient(weight: Weight, space: Space) -> wp.Kernel:
    """Kernel: ∇v_a += Σ_b (v_b − v_a) ⊗ G_ab."""
    vec, mat, real, Shore, pair = space.vec, space.mat, space.real, _shore_structure(space), _pair(weight, space)
    Reference, reach = structure(space, "Reference"), float(weight.support) * QUERY_MARGIN

    @wp.kernel(module="unique", enable_backward=False)
    def add_gradient(
        first: int,
        shore: Shore,
        reference: Reference,
        kappa: wp.array(dtype=real),
        wet: wp.array(dtype=wp.int32),
        v: wp.array(dtype=vec),
        out: wp.array(dtype=mat),
    ):
        k = first + wp.tid()
        a = shore.members[k] - shore.offset
        if wet[k] == 1:
            total = mat()
            for i in wp.hash_grid_query(shore.solids, shore.own[k], real(reach) * reference.h[a]):
                G = pair(shore.own[k], shore.at[i], reference.h[a], kappa[a] * shore.V[i])
                if wp.length_sq(G) > real(0.0):
                    total += wp.outer(v[shore.places[i]] - v[shore.members[k]], G)
            out[a] = out[a] + total

    return add_gradient


@functools.cache
def _make_force(weight: Weight, space: Space) -> wp.Kernel:
    """Kernel: on the liquid, V_a Q_a Σ_b G_ab; and what that gradient does to its store, f_ab·(v̄_b − v̄_a) Δt."""
    vec, real, Shore, pair = space.vec, space.real, _shore_structure(space), _pair(weight, space)
    Reference, Flux, reach = structure(space, "Reference"), structure(space, "Flux"), weight.support * QUERY_MARGIN

    @wp.kernel(module="unique", enable_backward=False)
    def force_on_liquid(
        first: int,
        shore: Shore,
        reference: Reference,
        flux: Flux,
        kappa: wp.array(dtype=real),
        wet: wp.array(dtype=wp.int32),
        v: wp.array(dtype=vec),
        dt: wp.array(dtype=wp.float64),
        power: wp.array(dtype=wp.float64),
        out: wp.array(dtype=vec),
    ):
        k = first + wp.tid()
        a = shore.members[k] - shore.offset
        power[k] = wp.float64(0.0)
        if wet[k] == 1:
            force = vec()
            rate = real(0.0)
            for i in wp.hash_grid_query(shore.solids, shore.own[k], real(reach) * reference.h[a]):
                G = pair(shore.own[k], shore.at[i], reference.h[a], kappa[a] * shore.V[i])
                if wp.length_sq(G) > real(0.0):
                    f = (flux.Q[a] @ G) * reference.V[a]
                    force += f
                    rate += wp.dot(f, v[shore.places[i]] - v[shore.members[k]])
            out[shore.members[k]] = out[shore.members[k]] + force
            power[k] = dt[0] * wp.float64(rate)

    return force_on_liquid


@functools.cache
def _make_reaction(weight: Weight, space: Space) -> wp.Kernel:
    """Kernel: the opposite on the solids."""
    vec, real, Shore, pair = space.vec, space.real, _shore_structure(space), _pair(weight, space)
    support = float(weight.support) * QUERY_MARGIN
    Reference, Flux = structure(space, "Reference"), structure(space, "Flux")

    @wp.kernel(module="unique", enable_backward=False)
    def force_on_solid(
        first: int,
        shore: Shore,
        reference: Reference,
        flux: Flux,
        kappa: wp.array(dtype=real),
        out: wp.array(dtype=vec),
    ):
        i = first + wp.tid()
        force = vec()
        for k in wp.hash_grid_query(shore.liquid, shore.at[i], real(support) * shore.longest[0]):
            a = shore.members[k] - shore.offset
            G = pair(shore.own[k], shore.at[i], reference.h[a], kappa[a] * shore.V[i])
            if wp.length_sq(G) > real(0.0):
                force -= (flux.Q[a] @ G) * reference.V[a]
        out[shore.places[i]] = out[shore.places[i]] + force

    return force_on_solid


@functools.cache
def _make_ask(weight: Weight, space: Space) -> wp.Kernel:
    """Kernel: the largest Σ_a k_a |G_ab| Σ_c |G_ac| / m_b [1/s²] of the solids, k_a = V_a ρ_a c_a² of the liquid (M28).

    It bounds the squares of frequencies at which solids move alone against what the liquid stores.
    """
    real, Shore, pair = space.real, _shore_structure(space), _pair(weight, space)
    support = float(weight.support) * QUERY_MARGIN
    Reference, Flux, raise_largest = structure(space, "Reference"), structure(space, "Flux"), raise_to(space.real)

    @wp.kernel(module="unique", enable_backward=False)
    def ask(
        first: int,
        shore: Shore,
        reference: Reference,
        flux: Flux,
        kappa: wp.array(dtype=real),
        met: wp.array(dtype=real),
        mass: wp.array(dtype=real),
        largest: wp.array(dtype=real),
    ):
        i = first + wp.tid()
        square = real(0.0)
        for k in wp.hash_grid_query(shore.liquid, shore.at[i], real(support) * shore.longest[0]):
            a = shore.members[k] - shore.offset
            size = wp.length(pair(shore.own[k], shore.at[i], reference.h[a], kappa[a] * shore.V[i]))
            if size > real(0.0):
                impedance = flux.impedance[a] * reference.V[a]
                square += impedance * impedance / mass[shore.members[k]] * size * met[k]
        if square > real(0.0):
            raise_largest(largest, square / mass[shore.places[i]])

    return ask


@functools.cache
def _make_add(space: Space) -> wp.Kernel:
    """Kernel of one thread: the square of a frequency beside that which was asked for."""
    real, Clock = space.real, clock_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def add_square(largest: wp.array(dtype=real), clock: Clock):
        clock.frequency[0] = wp.sqrt(clock.frequency[0] * clock.frequency[0] + largest[0])
        largest[0] = real(0.0)

    return add_square


class WettingOfSolids:
    """The solids in the sums of one liquid (a ``Wall`` of its medium).

    Args:
        world: at its start.
        assembly: what it was bound with.
        medium: of the liquid, with ``Uncorrected`` sums.
        numbers: of the particles of the solids, (m,) int32.
    """

    def __init__(self, world: "World", assembly: Assembly, medium: "Medium", numbers: np.ndarray):
        self.world, self.medium, self.space = world, medium, world.space
        device, space, n, m = world.device, world.space, medium.n, len(numbers)
        self._launch, self._weight = Launcher(device), medium.configuration.weight
        sides = [64 if axis < space.dim else 1 for axis in range(3)]
        self._solids, self._liquid = (wp.HashGrid(*sides, device=device, dtype=space.real) for _ in range(2))
        self._shore = shore = _shore_structure(space)()
        shore.solids, shore.liquid, shore.offset = self._solids.id, self._liquid.id, medium.span.start
        shore.places = assembly.order.places_of(numbers)
        shore.members = assembly.order.places_of(np.arange(medium.span.start, medium.span.stop, dtype=np.int32))
        V0 = assembly.order.by_number(world.particles.V0.numpy())[numbers]
        shore.V = wp.array(V0, dtype=space.real, device=device)
        shore.at, shore.own = (wp.zeros(k, dtype=_grid_vector(space), device=device) for k in (m, n))
        self._wet = wp.zeros(n, dtype=wp.int32, device=device)
        self._met, self._largest, shore.longest = (wp.zeros(k, dtype=space.real, device=device) for k in (n, 1, 1))
        self._reach = float(self._weight.support) * float(medium.particles.h.numpy().max()) * QUERY_MARGIN
        self._power, self._add = wp.zeros(n, dtype=wp.float64, device=device), Sum(wp.float64, n, device)
        self._nothing = wp.zeros(world.n, dtype=space.vec, device=device)
        self._step = wp.zeros(1, dtype=wp.float64, device=device)

    def _note(self) -> None:
        x, shore = self.world.U.x, self._shore
        self._launch(_make_note(self.space), len(shore.at), [shore.places, x, shore.at])
        self._launch(_make_note(self.space), len(shore.own), [shore.members, x, shore.own])
        self.rebuild()

    def rebuild(self) -> None:
        """The grids of where all were, and the largest smoothing length of the liquid."""
        shore, h = self._shore, self.medium.configuration.fields.h
        self._solids.build(shore.at, self._reach)
        self._liquid.build(shore.own, self._reach)
        shore.longest.zero_()
        self._launch(make_longest(self.space), len(h), [h, shore.longest])

    def renew(self) -> None:
        """Where all are in the present reference, which of the liquid is wet, and L of it."""
        self._note()
        arguments = [*self._of(), self.medium.stabiliser.kappa, self._wet, self._met]
        self._launch(_make_meet(self._weight, self.space), len(self._wet), arguments)

    def _of(self) -> list[Any]:
        return [self._shore, self.medium.configuration.fields]

    def add_gradient(self, v: wp.array, out: wp.array) -> None:
        """Add what solids add to ∇_k v (M28)."""
        world, medium = self.world, self.medium
        whole = world.half.v if v.ptr == medium.of(world.half).v.ptr else world.U.v
        arguments = [*self._of(), medium.stabiliser.kappa, self._wet, whole, out]
        self._launch(_make_gradient(self._weight, self.space), len(self._wet), arguments)

    def _of_solids(self) -> list[Any]:
        return [*self._of(), self.medium.flux.fields, self.medium.stabiliser.kappa]

    def press(self, out: wp.array) -> None:
        """Add forces [N] on all particles to ``out``, (n,) of vec."""
        self._press_liquid(out)
        self._launch(_make_reaction(self._weight, self.space), len(self._shore.at), [*self._of_solids(), out])

    def rate(self) -> None:
        """Ask for steps in which solids that are lighter than the liquid are stable."""
        arguments = [*self._of_solids(), self._met, self.world.particles.mass, self._largest]
        self._launch(_make_ask(self._weight, self.space), len(self._shore.at), arguments)
        self._launch.once(_make_add(self.space), 1, [self._largest, self.world.clock.fields])

    def _press_liquid(self, out: wp.array) -> None:
        medium, world = self.medium, self.world
        arguments = [*self._of(), medium.flux.fields, medium.stabiliser.kappa, self._wet, world.half.v]
        arguments += [world.clock.fields.dt, self._power, out]
        self._launch(_make_force(self._weight, self.space), len(self._wet), arguments)

    def account(self, total: wp.array) -> None:
        """Add to ``total`` [J] what solids did in the step to the energy that the liquid stores."""
        self._press_liquid(self._nothing)
        self._add(self._power, self._step)
        self._launch.once(make_add_up(), 1, [self._step, total])

    def evolving(self) -> dict[str, wp.array]:
        """Where all were in the present reference, which of the liquid is wet, and how much of solids it has met."""
        return {"at": self._shore.at, "own": self._shore.own, "wet": self._wet, "met": self._met}


def find_wettings(world: "World", assembly: Assembly, felt: np.ndarray) -> list[WettingOfSolids]:
    """One for each liquid that has solids in its sums, at work.

    Args:
        felt: whether bodies feel each other, (bodies, bodies) of 0 and 1; a liquid and its solids no longer do.
    """
    found, ranges = [], list(assembly.bodies.values())
    flows = np.zeros(len(ranges), dtype=bool)
    mediums = [medium for medium in world.media if medium.stabiliser.takes_walls]
    inside = [[own.start in medium.span for own in ranges] for medium in mediums]
    for mask in inside:
        flows |= np.array(mask)
    for medium, mask in zip(mediums, inside, strict=True):
        solids = [j for j in range(len(ranges)) if not flows[j] and felt[np.array(mask)][:, j].any()]
        if solids:
            for j in solids:
                felt[np.array(mask), j] = felt[j, np.array(mask)] = 0
            numbers = np.concatenate([np.arange(ranges[j].start, ranges[j].stop) for j in solids]).astype(np.int32)
            found.append(WettingOfSolids(world, assembly, medium, numbers))
            medium.walls.take(found[-1])
    return found
