"""Rigid walls in the sums of a liquid: what their matter would be there, by the distance from them (M28)."""

import functools
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..execution import Launcher
from ..fields import structure
from ..reduce import Sum
from ..scheme.projection import pad
from ..space import Space
from ..weights import Weight
from .pressing import read_row, signed_gap, trace_structure
from .rigid_motion import Pose, Wrench
from .shapes import Numbers, Triangles

if TYPE_CHECKING:
    from ..scheme.medium import Medium
    from ..scheme.world import World
    from .rigid import BoundRigidBody

# Entries of a table of sums over planes, and Gauss's points by which each is found.
ENTRIES, POINTS = 257, 64
# Spacings to which a lattice is summed.
FAR = 8
# Largest share of M3 across that may lie behind a wall: particles that were shot into one keep sums.
MOST = 0.9


@functools.cache
def behind_planes(weight: Weight, dim: int, h: float) -> np.ndarray:
    """M3 along and across of what lies behind planes at distances z from the centre of W, z from 0 to the support.

    Σ V g ξ_z [1/m] times h, and Σ V g ξ_x²: integrals over the half space, h ∫ W over the plane and ∫ W behind it,
    times what makes them right for planes half a spacing, one and a half, … away, behind which a lattice goes on.

    Args:
        h: smoothing length over spacing.

    Returns:
        (2, ENTRIES).
    """
    support, sigma, (value, slope) = weight.support, weight.sigma[dim - 1], weight.profile(wp.float64)
    node, share = np.polynomial.legendre.leggauss(POINTS)
    z = np.linspace(0.0, support, ENTRIES)
    along = np.zeros(ENTRIES)
    for i in range(ENTRIES - 1):
        end = np.sqrt(support**2 - z[i] ** 2)
        s, part = 0.5 * end * (node + 1.0), 0.5 * end * share
        w = np.array([float(value(wp.float64(min(q, support)))) for q in np.hypot(z[i], s)])
        along[i] = sigma * (part * w * {1: 1.0 / end, 2: 2.0, 3: 2.0 * np.pi * s}[dim]).sum()
    if dim == 1:
        along[:-1] = [sigma * float(value(wp.float64(q))) for q in z[:-1]]
    across = np.concatenate([np.cumsum((along[1:] + along[:-1])[::-1])[::-1], [0.0]])
    across *= 0.5 / across[0]
    axes = [np.arange(1.0, FAR + 1.0)] + [np.arange(-FAR, FAR + 1.0)] * (dim - 1)
    xi = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, dim)
    q = np.linalg.norm(xi, axis=1) / h
    g = sigma / h ** (dim + 2) * np.array([float(slope(wp.float64(p))) if p < support else 0.0 for p in q])
    rows = np.arange(FAR)
    for table, moment in ((along, g * xi[:, 0] * h), (across, g * xi[:, -1] ** 2 if dim > 1 else 0.0 * g)):
        lattice = np.array([moment[xi[:, 0] > k + 0.5].sum() for k in rows])
        there = np.interp((rows + 0.5) / h, z, table, right=0.0)
        known = there > 0.0
        table *= np.interp(z * h, rows[known] + 0.5, lattice[known] / there[known])
    return np.stack([along, across])


@functools.cache
def grow_across(space: Space) -> wp.Function:
    """``wp.func``: L ``grown`` twice in all directions but n: whole across a wall with the normal n (M28)."""
    real, vec, mat, dim = space.real, space.vec, space.mat, space.dim

    @wp.func
    def grow_across(L: mat, n: vec, grown: real) -> mat:
        A = wp.identity(n=wp.static(dim), dtype=real) * grown + wp.outer(n, n) * (real(1.0) - grown)
        return A @ L @ A

    return grow_across


@functools.cache
def _make_meet(space: Space, distance: Any) -> wp.Kernel:
    """Kernel: M3 of what lies behind the plane of the wall, twice, as a vector towards it [1/m], of each point."""
    real, vec, dim = space.real, space.vec, space.dim
    gap, read, TracePoints = signed_gap(distance), read_row(space), trace_structure(space)
    Reference, grow = structure(space, "Reference"), grow_across(space)

    @wp.kernel(module="unique", enable_backward=False)
    def meet(
        first: int,
        points: TracePoints,
        wet: wp.array(dtype=wp.int32),
        x: wp.array(dtype=vec),
        offset: int,
        reference: Reference,
        pose: Pose,
        side: wp.float64,
        numbers: Numbers,
        triangles: Triangles,
        table: wp.array2d(dtype=wp.float64),
        support: wp.float64,
        kappa: wp.array(dtype=real),
        out: wp.array(dtype=vec),
    ):
        i = first + wp.tid()
        k = wet[i]
        a = points.places[points.start[k]] - offset
        found = gap(read(points, k, x), pose, side, numbers, triangles)
        h = wp.float64(reference.h[a])
        at = wp.abs(found[3]) / h / support * wp.float64(wp.static(ENTRIES - 1))
        towards = vec()
        if at < wp.float64(wp.static(ENTRIES - 1)):
            lower = wp.min(int(at), wp.static(ENTRIES - 2))
            share = at - wp.float64(lower)
            met = (table[0, lower] * (wp.float64(1.0) - share) + table[0, lower + 1] * share) / h
            across = table[1, lower] * (wp.float64(1.0) - share) + table[1, lower + 1] * share
            if found[3] < wp.float64(0.0):
                across = wp.float64(2.0) * table[1, 0] - across
            across = wp.min(across * wp.float64(kappa[a]), wp.float64(MOST))
            n = vec()
            for j in range(wp.static(dim)):
                n[j] = real(found[j])
            towards = n * (real(wp.float64(-2.0) * met) * kappa[a])
            grown = real(wp.sqrt(wp.float64(1.0) / (wp.float64(1.0) - across)))
            reference.L[a] = grow(reference.L[a], n, grown)
        out[i] = towards

    return meet


@functools.cache
def _make_gradient(space: Space) -> wp.Kernel:
    """Kernel: ∇v += n n·(v_w − v_a) ⊗ G, as if the wall's matter went on as the wall does, and slid along it."""
    vec, mat, dim, TracePoints, real = space.vec, space.mat, space.dim, trace_structure(space), space.real
    padded = pad(space)

    @wp.kernel(module="unique", enable_backward=False)
    def add_gradient(
        first: int,
        points: TracePoints,
        wet: wp.array(dtype=wp.int32),
        met: wp.array(dtype=vec),
        x: wp.array(dtype=vec),
        offset: int,
        v: wp.array(dtype=vec),
        pose: Pose,
        out: wp.array(dtype=mat),
    ):
        i = first + wp.tid()
        G = met[i]
        if wp.length_sq(G) > real(0.0):
            p = points.places[points.start[wet[i]]]
            y = padded(x[p])
            spatial = pose.v[0] + wp.cross(pose.spin[0], y - pose.x[0])
            a = p - offset
            jump = -v[a]
            for j in range(wp.static(dim)):
                jump[j] = jump[j] + real(spatial[j])
            n = wp.normalize(G)
            out[a] = out[a] + wp.outer(n * wp.dot(n, jump), G)

    return add_gradient


@functools.cache
def _make_force(space: Space) -> wp.Kernel:
    """Kernel: the adjoint of that: V n n·(Q G) on the liquid, the opposite on the rigid body at the same place."""
    real, vec, padded, TracePoints = space.real, space.vec, pad(space), trace_structure(space)
    Reference, Flux = structure(space, "Reference"), structure(space, "Flux")

    @wp.kernel(module="unique", enable_backward=False)
    def wet_force(
        first: int,
        points: TracePoints,
        wet: wp.array(dtype=wp.int32),
        met: wp.array(dtype=vec),
        x: wp.array(dtype=vec),
        offset: int,
        reference: Reference,
        flux: Flux,
        pose: Pose,
        own: wp.array(dtype=wp.vec3d),
        push: wp.array(dtype=wp.vec3d),
        wrench: wp.array(dtype=Wrench),
    ):
        i = first + wp.tid()
        G = met[i]
        k = wet[i]
        own[i] = wp.vec3d()
        if wp.length_sq(G) > real(0.0):
            p = points.places[points.start[k]]
            a = p - offset
            n = wp.normalize(G)
            size = reference.V[a] * wp.dot(n, flux.Q[a] @ G)
            force = padded(n * size)
            moment = wp.cross(padded(x[p]) - pose.x[0], force)
            own[i] = force
            push[k] = push[k] + force
            wrench[k] = wrench[k] - Wrench(force[0], force[1], force[2], moment[0], moment[1], moment[2])

    return wet_force


@functools.cache
def _make_power(space: Space) -> wp.Kernel:
    """Kernel: what the wall did to the stored energy of each point in the step, Δt f·(v_w − v̄) [J]."""
    vec, padded, TracePoints, real = space.vec, pad(space), trace_structure(space), space.real

    @wp.kernel(module="unique", enable_backward=False)
    def find_power(
        first: int,
        points: TracePoints,
        wet: wp.array(dtype=wp.int32),
        met: wp.array(dtype=vec),
        x: wp.array(dtype=vec),
        v: wp.array(dtype=vec),
        pose: Pose,
        own: wp.array(dtype=wp.vec3d),
        dt: wp.array(dtype=wp.float64),
        out: wp.array(dtype=wp.float64),
    ):
        i = first + wp.tid()
        out[i] = wp.float64(0.0)
        if wp.length_sq(met[i]) > real(0.0):
            p = points.places[points.start[wet[i]]]
            jump = pose.v[0] + wp.cross(pose.spin[0], padded(x[p]) - pose.x[0]) - padded(v[p])
            out[i] = dt[0] * wp.dot(own[i], jump)

    return find_power


@functools.cache
def make_add_up() -> wp.Kernel:
    """Kernel: one number onto another."""

    @wp.kernel(module="unique", enable_backward=False)
    def add_up(step: wp.array(dtype=wp.float64), total: wp.array(dtype=wp.float64)):
        total[0] = total[0] + step[0]

    return add_up


class Wetting:
    """A rigid body in the sums of one liquid (a ``Wall`` of its medium).

    Args:
        body: it, with its points.
        wet: numbers of the points that are particles of the liquid, (k,) int32.
        medium: of the liquid, with ``Uncorrected`` sums.

    Attributes:
        met: G of each point in the present reference (M28), (k,) of vec.
    """

    def __init__(self, body: "BoundRigidBody", wet: np.ndarray, medium: "Medium", world: "World"):
        self.space, self.body, self.medium, self.world = body.space, body, medium, world
        device, k, configuration = body.device, len(wet), medium.configuration
        self._launch = Launcher(device)
        self._moves = body.motion.pose  # with the velocities that the next gradient is to see
        self._wet = wp.array(wet, dtype=wp.int32, device=device)
        particles = configuration.particles
        ratio = float(np.median(particles.h.numpy().astype(float) / particles.spacing.numpy()))
        table = behind_planes(configuration.weight, self.space.dim, round(ratio, 6))
        self._table = wp.array(table, dtype=wp.float64, device=device)
        self._kappa = medium.stabiliser.kappa
        self.met = wp.zeros(k, dtype=self.space.vec, device=device)
        self._own = wp.zeros(k, dtype=wp.vec3d, device=device)  # forces [N] of the sums
        self._powers, self._add = wp.zeros(k, dtype=wp.float64, device=device), Sum(wp.float64, k, device)
        self._step = wp.zeros(1, dtype=wp.float64, device=device)

    def _of(self) -> list[Any]:
        return [self.body.points, self._wet, self.met, self.world.U.x]

    def renew(self) -> None:
        """What of the wall is near each particle of the present reference, and what it does to L; launches only."""
        configuration, body, offset = self.medium.configuration, self.body, self.medium.span.start
        arguments = [body.points, self._wet, self.world.U.x, offset, configuration.fields]
        arguments += [body.motion.pose, *body.shape, self._table, float(configuration.weight.support)]
        arguments += [self._kappa, self.met]
        self._launch(_make_meet(self.space, body.option.shape.distance), len(self._wet), arguments)

    def add_gradient(self, v: wp.array, out: wp.array) -> None:
        """Add what the wall's matter adds to ∇_k v (M28)."""
        arguments = [*self._of(), self.medium.span.start, v, self._moves, out]
        self._launch(_make_gradient(self.space), len(self._wet), arguments)

    def look_ahead(self, wrench: wp.array) -> None:
        """Gradients after the forces are of the end of the step, or of its middle where none is kept."""
        fraction = 1.0 if self.medium.steady else 0.5
        self._moves = self.body.motion.ahead(self.world.clock.fields, fraction, wrench)

    def press(self, push: wp.array, wrench: wp.array) -> None:
        """Add forces [N] on the points, and of these on the rigid body."""
        arguments = [*self._of(), self.medium.span.start, self.medium.configuration.fields, self.medium.flux.fields]
        arguments += [self.body.motion.pose, self._own, push, wrench]
        self._launch(_make_force(self.space), len(self._wet), arguments)

    def account(self, wrench: wp.array, total: wp.array) -> None:
        """Add to ``total`` [J] what the wall did in the step to the energy that the liquid stores."""
        clock, mean = self.world.clock.fields, self.world.half.v
        moves, self._moves = self.body.motion.ahead(clock, 0.5, wrench), self.body.motion.pose
        arguments = [*self._of(), mean, moves, self._own, clock.dt, self._powers]
        self._launch(_make_power(self.space), len(self._wet), arguments)
        self._add(self._powers, self._step)
        self._launch.once(make_add_up(), 1, [self._step, total])
