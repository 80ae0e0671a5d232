"""Particles sorted in memory, at the start and as they move, so that neighbours stay near each other there."""

import functools
import logging
from collections.abc import Iterator

import numpy as np
import warp as wp

from .boundaries import Bound
from .fields import structure
from .interactions import BoundInteraction
from .order import Order, spatial_order
from .reduce import SumOfParticles
from .scheme.medium import Medium
from .scheme.reference import reference_spacing
from .scheme.stepper import Stepper
from .space import Space, difference

log = logging.getLogger(__name__)

# Steps between two looks at the order, where the reference moves: a look that sorts costs half a step.
STEPS_BETWEEN_SORTS = 200
# Particles next to each other in memory have parted when they are so many spacings from each other.
APART = 3.0
# Particles are sorted when a larger share of them than this have parted, and so many times the share that they have in
# order, where the ends of rows part too: stirred liquids gain from there on (``python -m warp_eulsph.bench.mixing``).
MOST_PARTED, MUCH_MORE = 0.1, 2.0
# At the start any lattice is in order, be its rows as short as this share says.
SHORT_ROWS = 0.25


@functools.cache
def _make_count_parted(space: Space) -> wp.Kernel:
    """Kernel of ``SumOfParticles``: how many particles are far from the one before them, if it is of the same body."""
    real, vec, separation = space.real, space.vec, difference(space)
    Particles, Reference, spacing_of = (
        structure(space, "Particles"),
        structure(space, "Reference"),
        reference_spacing(space),
    )

    @wp.kernel(module="unique", enable_backward=False)
    def count_parted(
        first: int,
        bounds: wp.array(dtype=wp.int32),
        places: wp.array(dtype=wp.int32),
        particles: Particles,
        reference: Reference,
        box: vec,
        out: wp.array(dtype=wp.int32),
    ):
        block = first + wp.tid()
        count = int(0)
        for i in range(bounds[block], bounds[block + 1]):
            a = places[i]
            b = places[i + 1]
            spacing = spacing_of(a, particles, reference)
            far = wp.length(separation(reference.x[b], reference.x[a], box)) > real(APART) * spacing
            if far and particles.body[a] == particles.body[b]:
                count += 1
        out[block] = count

    return count_parted


class _CountParted:
    """Counts the parted particles of one medium."""

    def __init__(self, medium: Medium):
        self.medium, device = medium, medium.device
        self._places, self._count = (wp.zeros(k, dtype=wp.int32, device=device) for k in (medium.n, 1))
        self._sum = SumOfParticles(wp.int32, [medium.n - 1], device)

    def __call__(self, places: np.ndarray | None) -> int:
        """How many there are, or were they at these places of the world, (n,); reads the device."""
        medium, span = self.medium, self.medium.span
        chosen = np.arange(medium.n) if places is None else places[span.start : span.stop] - span.start
        self._places.assign(chosen.astype(np.int32))
        configuration = medium.configuration
        arguments = [self._places, medium.particles, configuration.fields, configuration.lists.box]
        self._sum(_make_count_parted(medium.space), arguments, self._count)
        return int(self._count.numpy()[0])


class Sorting:
    """Looks at the order of a simulation's particles now and then, and sorts them when that makes it much better.

    Particles are sorted between two steps, each body within its range, and only the order of sums changes: what evolves
    is permuted in place, the rest is derived anew as after ``Simulation.restore``. Looks depend on the number of the
    step and what they find on the state, so that a resumed run sorts where the whole one did.

    Args:
        stepper: on its first reference.
        order: of its particles.
        on: False leaves all where they are.
    """

    def __init__(self, stepper: Stepper, order: Order, on: bool):
        self.stepper, self.order = stepper, order
        self.space, self.device = stepper.space, stepper.device
        self._parts: list[Bound | BoundInteraction] = [*stepper.conditions, *stepper.interactions]
        self.on = on and all(part.sortable for part in self._parts)
        if on and not self.on:
            log.info("particles are not sorted in memory: a condition or interaction does not say that it is sortable")
        self._counts = [_CountParted(medium) for medium in stepper.media]
        self._in_order = SHORT_ROWS
        if self.on:
            self.look()
            self._in_order = self.parted()

    def steps_left(self, step: int) -> int | None:
        """Steps from step number ``step`` to the next look; None if there is none."""
        if not self.on or all(medium.policy.fixed for medium in self.stepper.media):
            return None
        return STEPS_BETWEEN_SORTS - step % STEPS_BETWEEN_SORTS

    def look_after(self, step: int) -> None:
        """Look at the order if it is time to after ``step`` steps."""
        if self.steps_left(step) == STEPS_BETWEEN_SORTS:  # step is a multiple of it
            self.look()

    def look(self) -> None:
        """Sort the particles if it makes their order much better."""
        parted = self.parted()
        if parted <= max(MOST_PARTED, MUCH_MORE * self._in_order):
            return
        places = self.sorted_places()
        if parted <= MUCH_MORE * self.parted(places):
            return
        log.debug("particles sorted in memory after step %d: %.0f %% had parted", self.stepper.steps, 100.0 * parted)
        self.permute(places)

    def parted(self, places: np.ndarray | None = None) -> float:
        """Share of the particles that are far from the one before them, in memory or were they at these places, (n,),
        instead; reads the device."""
        return sum(count(places) for count in self._counts) / self.stepper.n

    def permute(self, places: np.ndarray) -> None:
        """Move the particles at these places, (n,), to the places 0, 1, …, each body within its range.

        Arrays change in place: recorded launches and graphs hold pointers.
        """
        for array, body in self._arrays():
            chosen = wp.array(places[body.start : body.stop] - body.start, dtype=wp.int32, device=self.device)
            wp.copy(array, array[chosen].contiguous())
        self.order.rearrange(self.order.ids.numpy()[places])
        self.stepper.rebuild()

    def sorted_places(self) -> np.ndarray:
        """Places in the order that particles should have, each body within its range, (n,)."""
        return np.concatenate([medium.span.start + self._sorted_places(medium) for medium in self.stepper.media])

    def _sorted_places(self, medium: Medium) -> np.ndarray:
        """The same of one medium, counted from its first particle."""
        reference, particles = medium.configuration.fields, medium.particles
        x = reference.x.numpy().astype(float)
        box = np.array(medium.configuration.lists.box, dtype=float)
        x -= box * np.floor(np.divide(x, box, out=np.zeros_like(x), where=box > 0.0))
        spacing = particles.spacing.numpy() * reference.h.numpy() / particles.h.numpy()
        sorted_bodies = [
            body.start + spatial_order(x[body.start : body.stop], float(np.median(spacing[body.start : body.stop])))
            for body in medium.flux.bodies
        ]
        return np.concatenate(sorted_bodies)

    def _arrays(self) -> Iterator[tuple[wp.array, range]]:
        """What evolves and has an element for each particle, and the particles that each array is of."""
        stepper = self.stepper
        own = {id(array) for part in self._parts for array in part.evolving().values()}
        spans: dict[int, range] = {}
        for medium in stepper.media:
            spans |= {id(array): medium.span for array in medium.evolving().values()}
        spans |= {id(part.history): span for span, part in stepper.remembering}
        for array in stepper.evolving().values():
            span = spans.get(id(array), range(stepper.n))
            if len(array) == len(span) and id(array) not in own:  # theirs go by number
                yield array, span
