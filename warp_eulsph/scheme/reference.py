"""The reference configuration k: positions, volumes, corrections and neighbour lists in which weights live."""

import functools
from collections.abc import Callable, Sequence

import numpy as np
import warp as wp

from ..atomics import raise_to
from ..execution import Launcher, launch, simd
from ..fields import allocate, arrays, neighbour_structure, structure
from ..linalg import det, inverse, largest_shortening, stretch_bounds, stretch_of_volume, symmetric_bounds
from ..operators.correction import VECTORS, make_correct, make_pack, make_pair_sums, make_pair_sums_simd
from ..operators.divergence import make_divergence, make_tilted_divergence
from ..operators.gradient import make_finish, make_gradient
from ..operators.interpolation import Interpolation
from ..operators.neighbours import NeighbourLists
from ..operators.values import Values
from ..simd import packed_rows
from ..space import Space, difference
from ..structs import NeighbourRows, ParticleArrays, ReferenceArrays, StateArrays
from ..weights import Weight
from .refresh import BY_HOST
from .tilt import Tilt, make_tilt, make_tilted_sums

# The smoothing length follows the volume between these, so that one particle cannot make the lists endless.
LEAST_GROWTH, LARGEST_GROWTH = 0.5, 2.0


@functools.cache
def _make_adopt(space: Space, fixed: bool) -> wp.Kernel:
    State, Particles, Reference = (
        structure(space, "State"),
        structure(space, "Particles"),
        structure(space, "Reference"),
    )
    real, determinant, stretch_of = space.real, det(space), stretch_of_volume(space)

    @wp.kernel(module="unique", enable_backward=False)
    def adopt(first: int, state: State, particles: Particles, reference: Reference):
        a = first + wp.tid()
        reference.x[a] = state.x[a]
        if wp.static(not fixed):
            reference.F[a] = state.F[a]
        reference.balanced[a] = state.x[a]
        J = determinant(state.F[a])
        reference.V[a] = J * particles.V0[a]
        reference.h[a] = particles.h[a] * wp.clamp(stretch_of(J), real(LEAST_GROWTH), real(LARGEST_GROWTH))

    return adopt


# Largest eigenvalue of L_a that the Courant number allows for: 3.7 in corners of 2-D lattices, 4.7 in 3-D ones. The
# highest frequency of M5 on M4 grows with its root, so that a particle with a poorer neighbourhood asks for a smaller
# step: without this the punch at 40² fails.
LOPSIDED = 4.0

# How much higher the highest frequency is with sharpened gradients (M23): 1.17 to 1.21 in squares and cubes, jittered
# or not (``tests/test_sharpening.py``).
STEEPER = 1.2


@functools.cache
def reference_spacing(space: Space) -> wp.Function:
    """``wp.func`` spacing of particle a in the reference [m], which follows its smoothing length."""
    real, Particles, Reference = space.real, structure(space, "Particles"), structure(space, "Reference")

    @wp.func
    def reference_spacing(a: int, particles: Particles, reference: Reference) -> real:
        return particles.spacing[a] * reference.h[a] / particles.h[a]

    return reference_spacing


@functools.cache
def resolution(space: Space) -> wp.Function:
    """``wp.func`` of particle a what the Courant number counts by [1/m]: 1/spacing, more where L is large."""
    real, bounds, spacing_of = space.real, symmetric_bounds(space), reference_spacing(space)
    Particles, Reference = structure(space, "Particles"), structure(space, "Reference")

    @wp.func
    def resolution(a: int, particles: Particles, reference: Reference) -> real:
        L = reference.L[a]
        lopsided = bounds((L + wp.transpose(L)) * real(0.5))[1] / real(LOPSIDED)
        return wp.sqrt(wp.max(lopsided, real(1.0))) / spacing_of(a, particles, reference)

    return resolution


@functools.cache
def _make_resolve(space: Space) -> wp.Kernel:
    """Kernel: ``resolution`` of a fixed reference, ``steeper`` times."""
    real, Particles, Reference = space.real, structure(space, "Particles"), structure(space, "Reference")
    resolution_of = resolution(space)

    @wp.kernel(module="unique", enable_backward=False)
    def resolve(first: int, particles: Particles, reference: Reference, steeper: real):
        a = first + wp.tid()
        reference.resolution[a] = resolution_of(a, particles, reference) * steeper

    return resolve


@functools.cache
def _make_distortion(space: Space) -> wp.Kernel:
    real, mat = space.real, space.mat
    Reference = structure(space, "Reference")
    invert, bounds, shortening_of = inverse(space), stretch_bounds(space), largest_shortening(space)
    raise_largest = raise_to(real)

    @wp.kernel(module="unique", enable_backward=False)
    def distortion(first: int, F: wp.array(dtype=mat), reference: Reference, largest: wp.array(dtype=real)):
        a = first + wp.tid()
        G = F[a] @ invert(reference.F[a])
        raise_largest(largest, wp.sqrt(wp.max(bounds(G)[1], shortening_of(G))))

    return distortion


@functools.cache
def _make_nearest(space: Space) -> wp.Kernel:
    real = space.real
    Reference, Neighbours, separation = structure(space, "Reference"), neighbour_structure(space), difference(space)

    @wp.kernel(module="unique", enable_backward=False)
    def find_nearest(first: int, reference: Reference, near: Neighbours, nearest: wp.array(dtype=real)):
        a = first + wp.tid()
        least = real(wp.inf)
        for k in range(near.start[a], near.stop[a], near.stride):
            least = wp.min(least, wp.length(separation(reference.x[near.index[k]], reference.x[a], near.box)))
        nearest[a] = least

    return find_nearest


@functools.cache
def _make_defect(space: Space) -> wp.Kernel:
    """Kernel: e_a − s_a from −e_a."""
    vec = space.vec

    @wp.kernel(module="unique", enable_backward=False)
    def defect(first: int, surface: wp.array(dtype=vec), out: wp.array(dtype=vec)):
        a = first + wp.tid()
        out[a] = -out[a] - surface[a]

    return defect


class Configuration:
    """The configuration in which weights live: positions, volumes, corrections, neighbour lists.

    Args:
        box: lengths of the periodic box [m], zero where open.
        fixed: it is that of the start for good, F_k = I.
        corrected: something changes L or the pair vectors after M3 (M10 to M13). Where nothing does and the reference
            is fixed (``plain``), arrays of the same values are one.
        tilt: of the weights (M17), where the reference is plain.
        sharpened: whether gradients and forces on it are (M23), where it is plain, so that steps are shorter.

    Attributes:
        fields: struct ``Reference`` of ``fields.py``.
        lists: neighbour lists, with the pair weights g_ab.
        poor: (n,) directions in which a particle's gradient fell back to zero; 0 is healthy.
        simd: whether sums over neighbours run by SIMD kernels.
    """

    def __init__(
        self,
        space: Space,
        weight: Weight,
        particles: ParticleArrays,
        box: Sequence[float],
        device: wp.DeviceLike,
        *,
        fixed: bool = False,
        corrected: bool = True,
        tilt: Tilt | None = None,
        sharpened: bool = False,
    ):
        n = len(particles.mass)
        self.space, self.weight, self.particles, self.device = space, weight, particles, device
        self.fixed, self.plain = fixed, fixed and not corrected
        self.tilt, self.sharpened = tilt if self.plain else None, sharpened and self.plain
        self._steeper = STEEPER if self.sharpened else 1.0
        self.simd, self._launch = simd(device), Launcher(device)
        empty = {"F" if fixed else "resolution"} | (set() if self.tilt else {"moment"})
        self.fields: ReferenceArrays = allocate(space, "Reference", n, device, empty=empty)
        if self.plain:
            self.fields.balanced = self.fields.x
        tilted = self.tilt is not None
        self.lists = NeighbourLists(space, weight, self.fields.h, particles.group, box, device, tilted)
        self.K = self.fields.L if self.plain else wp.zeros(n, dtype=space.mat, device=device)
        self.poor = wp.zeros(n, dtype=wp.int32, device=device)
        self._packed: dict[int, wp.array] = {}
        self._largest = wp.zeros(1, dtype=space.real, device=device)
        self._interpolations: dict[Values, Interpolation] = {}

    @property
    def near(self) -> NeighbourRows:
        """Struct of the neighbour rows."""
        return self.lists.rows

    def pairs_by_simd(self, sensed: bool) -> bool:
        """Whether passes over pairs run by SIMD kernels, which know of no sensor; else by the portable ones."""
        return self.simd and not sensed

    def refresh(self, state: StateArrays) -> None:
        """Make ``state`` the reference: x_k, F_k, V_k, h_k, neighbours, pair weights, corrections (M3)."""
        BY_HOST(lambda: self.move(state), [self.lists], self.renew)

    def move(self, state: StateArrays, mend: Callable[[], None] = lambda: None) -> None:
        """First part of a refresh, launches only: x_k, F_k, V_k, h_k, and how many neighbours each particle has.

        ``mend`` is called in between, to change what is not to be refreshed.
        """
        self._launch(_make_adopt(self.space, self.fixed), len(self.K), [state, self.particles, self.fields])
        mend()
        self.lists.count_neighbours(self.fields.x)

    def renew(self, v: wp.array | None = None, sums: wp.array | None = None) -> None:
        """Last part of a refresh, launches only: the neighbours, pair weights and corrections (M3).

        And the ``sums`` of ∇_k v, (n,) of mat, instead of those of masses (M7), if given; ``finish_gradient`` does the
        rest.
        """
        self.lists.fill(self.fields.x)
        self._weigh(v, sums)
        self._correct()
        self._settle()

    def evolving(self) -> dict[str, wp.array]:
        """The reference's arrays by name: what a checkpoint must hold; ``rebuild`` derives the rest from them."""
        held = arrays(self.fields, "Reference")
        for derived in ("resolution", "moment", "row"):
            held.pop(f"Reference.{derived}")
        if self.fixed:
            held.pop("Reference.F")
        if self.plain:
            held.pop("Reference.balanced")
        return held

    def rebuild(self) -> None:
        """Neighbours, pair weights, K_a (M3) and interpolations of the positions, volumes and h in ``fields``."""
        self.lists.build(self.fields.x)
        self._weigh()
        if self.K is self.fields.L:
            self._correct()
        self._settle()

    def _settle(self) -> None:
        if self.fixed:
            self.lists.release()
            self._packed.clear()
            self._launch.forget()  # what was needed on the way, which would stay with its launches

    def _correct(self) -> None:
        n, space = len(self.K), self.space
        self._launch(make_correct(space), n, [self.K, self.fields, self.poor])
        if self.tilt is not None:
            tilt = wp.zeros(n, dtype=space.vec, device=self.device)
            # By L and w without tilt: the step, and which way out is
            self._launch(_make_resolve(space), n, [self.particles, self.fields, self._steeper])
            self._look_outward(tilt)  # zero still
            arguments = [self.particles, self.fields, self.near, self.poor, self.tilt.most, tilt]
            self._launch(make_tilt(space), n, arguments)
            self._launch(make_tilted_sums(space), n, [self.fields, self.near, tilt])

    def resolve(self) -> None:
        """Once L is what it stays: what the Courant number counts by, kept where the reference is fixed."""
        if self.fixed and self.tilt is None:
            self._launch(_make_resolve(self.space), len(self.K), [self.particles, self.fields, self._steeper])

    def _weigh(self, v: wp.array | None = None, sums: wp.array | None = None) -> None:
        n, fields, near, of_v = len(self.K), self.fields, self.near, sums is not None
        found = [v if of_v else fields.x, self.K, sums if of_v else self.K]
        if self.simd and self.weight.slope_cpp is not None:
            rows = self.packed(VECTORS)
            self._launch(make_pack(self.space, of_v), n, [self.particles, fields, found[0], rows])
            arguments = [fields, near, rows, *found[1:]]
            self._launch(make_pair_sums_simd(self.weight, self.space, of_v), n, arguments)
        else:
            kernel = make_pair_sums(self.weight, self.space, of_v)
            self._launch(kernel, n, [self.particles, fields, near, *found])
        for interpolation in self._interpolations.values():
            interpolation.refresh()

    def packed(self, vectors: int) -> wp.array:
        """Rows of ``vectors`` times four reals (``packed_rows``) for passes that take turns with their memory."""
        if vectors not in self._packed:
            most = max(self._packed, default=0)
            if vectors > most:  # the others will be in its memory
                self._packed.clear()
                self._launch.forget()
            within = self._packed.get(most)
            self._packed[vectors] = packed_rows(self.space, len(self.K), vectors, self.device, within)
        return self._packed[vectors]

    def interpolation(self, values: Values) -> Interpolation:
        """N with these corrected values; made at the first call, refreshed with the reference from then on."""
        if values not in self._interpolations:
            made = Interpolation(values, self.space, self.weight, self.particles, self.fields, self.near, self.device)
            made.refresh()
            self._interpolations[values] = made
        return self._interpolations[values]

    def gradient(self, f: wp.array, out: wp.array) -> None:
        """``out`` ← ∇_k f, the corrected gradient (M4) of rows ``f`` of c reals, (n,) of c × dim reals."""
        kernel = make_gradient(self.space, wp.types.type_size(f.dtype), self.simd)
        self._launch(kernel, len(f), [self.fields, self.near, f, out])

    def finish_gradient(self, out: wp.array) -> None:
        """∇_k of a field of ``vec`` in place of its sums (``renew``), by L as it is, (n,) of mat."""
        self._launch(make_finish(self.space), len(out), [self.fields, out])

    def divergence(self, Pi: wp.array, out: wp.array) -> None:
        """``out`` ← −T, the dual divergence (M5) of Π = Q Lᵀ, (n,) of vec.

        Raises:
            ValueError: a Π that was not kept.
        """
        if len(Pi) != len(out):
            raise ValueError(f"Pi must be of {len(out)} particles, got {len(Pi)}; Flux.keep_dual() has it computed")
        kernel = make_divergence(self.space, self.simd) if self.tilt is None else make_tilted_divergence(self.space)
        self._launch(kernel, len(out), [self.fields, self.near, Pi, out])

    def defect(self, surface: wp.array, out: wp.array, unit: wp.array | None = None) -> None:
        """``out`` ← e_a − s_a [m^(d−1)], (n,) of vec, for surface vectors s_a (M10).

        e_a = Σ_b V_b G_a(x_b), the dual divergence (M5) of a unit stress, of which ``unit`` is Π, L by default: what a
        uniform stress would exert on a. To be asked for before positions are balanced (M13), as long as L is symmetric.
        """
        self.divergence(self.fields.L if unit is None else unit, out)
        self._launch(_make_defect(self.space), len(out), [surface, out])
        if unit is not None:
            self._launch.forget()  # the unit stress, which would stay with its launch

    def _look_outward(self, nothing: wp.array) -> None:
        """``particles.outward`` from the weights as they are, less ``nothing``."""
        out = self.particles.outward
        self._launch(make_divergence(self.space, self.simd), len(out), [self.fields, self.near, self.fields.L, out])
        self._launch(_make_defect(self.space), len(out), [nothing, out])

    def nearest(self) -> np.ndarray:
        """Distance of each particle to its nearest neighbour [m], (n,), inf without one; reads the device."""
        nearest = wp.zeros(len(self.poor), dtype=self.space.real, device=self.device)
        launch(_make_nearest(self.space), len(nearest), [self.fields, self.near, nearest], self.device)
        return nearest.numpy()

    def distortion(self, F: wp.array) -> float:
        """Largest stretch or shortening of any particle since the last refresh; reads the device."""
        self._largest.zero_()
        self._launch(_make_distortion(self.space), len(F), [F, self.fields, self._largest])
        return float(self._largest.numpy()[0])
