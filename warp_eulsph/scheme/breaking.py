"""What follows where a law says that particles have failed: they are noted, and cut off where arrangements stay."""

import functools

import warp as wp

from ..atomics import lower_to
from ..execution import Launcher
from ..fields import neighbour_structure, structure
from ..linalg import det
from ..materials import Law
from ..materials.base import history_row
from ..operators.correction import corrected_inverse
from ..space import Space, difference
from .flux import Flux
from .health import WELL
from .reference import Configuration, resolution


@functools.cache
def _make_note(space: Space, law: Law, fixed: bool) -> wp.Kernel:
    """Kernel: ``first`` takes the least place that has failed; ``cut`` what has opened since, ``fresh`` the least."""
    mat, row, Constants, failed, determinant = space.mat, history_row(space, law), law.Constants, law.failed, det(space)
    real = space.real

    @wp.kernel(module="unique", enable_backward=False)
    def note(
        first: int,
        begin: int,
        F: wp.array(dtype=mat),
        history: wp.array(dtype=row),
        c: Constants,
        earliest: wp.array(dtype=wp.int32),
        cut: wp.array(dtype=wp.int32),
        fresh: wp.array(dtype=wp.int32),
    ):
        a = first + wp.tid()
        if failed(history[a - begin], c):
            lower_to(earliest, a)
            if wp.static(fixed) and cut[a] == 0 and determinant(F[a]) > real(1.0):
                cut[a] = 1
                lower_to(fresh, a)

    return note


@functools.cache
def _make_cut(space: Space, tilted: bool) -> wp.Kernel:
    """Kernel: no weights between pairs one of which is cut, and what M3, M17 and M13 sum of the rest; no more work than
    a look at ``fresh`` where nothing was cut in the step.

    F stays: M4 of what is left moves it on. M5 stays its adjoint, so that momenta and energy are as exact as before.
    """
    real, vec, mat = space.real, space.vec, space.mat
    Particles, Reference = structure(space, "Particles"), structure(space, "Reference")
    Neighbours, separation = neighbour_structure(space), difference(space)
    invert, resolution_of = corrected_inverse(space), resolution(space)

    @wp.kernel(module="unique", enable_backward=False)
    def cut_pairs(
        first: int,
        particles: Particles,
        reference: Reference,
        near: Neighbours,
        cut: wp.array(dtype=wp.int32),
        fresh: wp.array(dtype=wp.int32),
        frayed: wp.array(dtype=wp.int32),
    ):
        if fresh[0] == wp.static(WELL):
            return
        a = first + wp.tid()
        K = mat()
        moment = vec()
        diagonal = real(0.0)
        lost = int(0)
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            if near.w[k] != real(0.0) and (cut[a] != 0 or cut[b] != 0):
                near.own[k] = real(0.0)
                near.w[k] = real(0.0)
                lost += 1
            xi = separation(reference.x[b], reference.x[a], near.box)
            diagonal += near.w[k]
            moment += xi * near.own[k]
            K += wp.outer(xi, xi) * near.own[k]
        if lost > 0:
            frayed[a] = 1
            L, _ = invert(K)
            reference.L[a] = L
            reference.diagonal[a] = diagonal
            if wp.static(tilted):
                reference.moment[a] = moment
            # a new face may ask for a shorter step
            reference.resolution[a] = wp.max(reference.resolution[a], resolution_of(a, particles, reference))

    return cut_pairs


@functools.cache
def _make_tell() -> wp.Kernel:
    """Kernel of one thread: ``grew`` where something was cut."""

    @wp.kernel(module="unique", enable_backward=False)
    def tell(fresh: wp.array(dtype=wp.int32), grew: wp.array(dtype=wp.int32)):
        if fresh[0] != wp.static(WELL):
            grew[0] = 1

    return tell


class Breaking:
    """At work on a medium one of whose laws has ``failed``.

    Attributes:
        first: place of the first particle that has failed, of one element.
        cut, frayed: which are let go, and which lost a neighbour by that, (n,) int32; empty where arrangements move.
    """

    def __init__(self, space: Space, flux: Flux, configuration: Configuration, device: wp.DeviceLike):
        self.space, self.flux, self.configuration, self._launch = space, flux, configuration, Launcher(device)
        if configuration.fixed and not configuration.plain:
            raise ValueError(
                "matter that breaks in the arrangement of its start cannot have surface vectors, for a crack makes new "
                "surfaces; leave out Body(surface=...)"
            )
        n = len(configuration.poor)
        self.cut = wp.zeros(n if configuration.fixed else 0, dtype=wp.int32, device=device)
        self.frayed = wp.zeros_like(self.cut)
        self.first, self._fresh = (wp.full(1, WELL, dtype=wp.int32, device=device) for _ in range(2))

    def evolving(self) -> dict[str, wp.array]:
        """What a checkpoint must hold."""
        held = {"Breaking.first": self.first, "Breaking.fresh": self._fresh}
        return held | ({"Breaking.cut": self.cut} if len(self.cut) else {})

    def update(self, F: wp.array) -> None:
        """After a full step: note what has failed, cut off what has opened; launches only."""
        self._fresh.fill_(WELL)
        for part in self.flux.parts:
            if part.law.failed is not None:
                arguments = [part.first, F, part.history, part.constants, self.first, self.cut, self._fresh]
                kernel = _make_note(self.space, part.law, self.configuration.fixed)
                self._launch(kernel, part.size, arguments, part.first)
        self._cut()

    def tell(self, grew: wp.array) -> None:
        """Set ``grew``, (1,) int32, to 1 if particles were cut off in the last update; launches only."""
        self._launch.once(_make_tell(), 1, [self._fresh, grew])

    def rebuild(self) -> None:
        """Cut off again what was, after weights were made anew."""
        grew = wp.clone(self._fresh)
        self._fresh.zero_()
        self.frayed.zero_()
        self._cut()
        wp.copy(self._fresh, grew)  # of the last step still

    def _cut(self) -> None:
        if len(self.cut):
            fields, near = self.configuration.fields, self.configuration.near
            arguments = [self.flux.particles, fields, near, self.cut, self._fresh, self.frayed]
            self._launch(_make_cut(self.space, self.configuration.tilt is not None), len(self.cut), arguments)
