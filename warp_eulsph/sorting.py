"""Particles sorted in memory, at the start and as they move, so that neighbours stay near each other there."""

import functools
import logging
from collections.abc import Iterator
from typing import Any

import numpy as np
import warp as wp

from .fields import structure
from .order import Order, spatial_order
from .scheme.lax_wendroff import LaxWendroffStepper
from .space import Space, difference

log = logging.getLogger(__name__)

# Steps between two looks at the order of a body whose reference moves.
STEPS_BETWEEN_SORTS = 200
# Particles next to each other in memory have parted when they are so many spacings from each other.
APART = 3.0
# Largest share of parted ones that is left alone: lattices have one at the end of each row.
MOST_PARTED = 0.5


@functools.cache
def _make_count_parted(space: Space) -> Any:
    """Kernel: how many particles are far from the one before them, if it is of the same body."""
    real, vec, separation = space.real, space.vec, difference(space)
    Particles, Reference = structure(space, "Particles"), structure(space, "Reference")

    @wp.kernel(module="unique", enable_backward=False)
    def count_parted(
        order: wp.array(dtype=wp.int32),
        particles: Particles,
        reference: Reference,
        box: vec,
        parted: wp.array(dtype=wp.int32),
    ):
        i = wp.tid()
        a = order[i]
        b = order[i + 1]
        spacing = particles.spacing[a] * reference.h[a] / particles.h[a]
        far = wp.length(separation(reference.x[b], reference.x[a], box)) > real(APART) * spacing
        if far and particles.body[a] == particles.body[b]:
            wp.atomic_add(parted, 0, 1)

    return count_parted


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

    def __init__(self, stepper: LaxWendroffStepper, order: Order, on: bool):
        self.stepper, self.order = stepper, order
        self.space, self.device = stepper.space, stepper.device
        self.on = on and all(condition.sortable for condition in stepper.conditions)
        if on and not self.on:
            log.info("particles are not sorted in memory: a condition does not say that it is sortable")
        self._parted = wp.zeros(1, dtype=wp.int32, device=self.device)
        self.look()

    def steps_left(self, step: int) -> int | None:
        """Steps from step number ``step`` to the next look; None if there is none."""
        if not self.on or self.stepper.policy.fixed:
            return None
        return STEPS_BETWEEN_SORTS - step % STEPS_BETWEEN_SORTS

    def look_after(self, step: int) -> None:
        """Look at the order if it is time to after ``step`` steps."""
        if self.steps_left(step) == STEPS_BETWEEN_SORTS:
            self.look()

    def look(self) -> None:
        """Sort the particles if it makes their order much better."""
        if not self.on:
            return
        parted = self.parted(np.arange(self.stepper.n))
        if parted <= MOST_PARTED:
            return
        sorted_places = self._sorted_places()
        if self.parted(sorted_places) > 0.5 * parted:
            return  # debris: nothing is near anything
        log.debug("particles sorted in memory after step %d: %.0f %% had parted", self.stepper.steps, 100.0 * parted)
        self.permute(sorted_places)

    def parted(self, places: np.ndarray) -> float:
        """Share of the particles at these places, (n,), that are far from the one before them there; reads the
        device."""
        stepper, configuration = self.stepper, self.stepper.configuration
        order = wp.array(places, dtype=wp.int32, device=self.device)
        self._parted.zero_()
        arguments = [order, stepper.particles, configuration.fields, configuration.lists.box, self._parted]
        wp.launch(_make_count_parted(self.space), stepper.n - 1, arguments, device=self.device)
        return int(self._parted.numpy()[0]) / stepper.n

    def permute(self, places: np.ndarray) -> None:
        """Move the particles at these places, (n,), to the places 0, 1, …, each body within its range."""
        for array, body in self._arrays():
            chosen = wp.array(places[body.start : body.stop] - body.start, dtype=wp.int32, device=self.device)
            wp.copy(array, array[chosen].contiguous())
        self.order.rearrange(self.order.ids.numpy()[places])
        self.stepper.rebuild()

    def _arrays(self) -> Iterator[tuple[wp.array, range]]:
        """What evolves and has an element for each particle, and the particles that each array is of."""
        stepper, n = self.stepper, self.stepper.n
        conditions = [array for condition in stepper.conditions for array in condition.evolving().values()]
        own = {id(array) for array in conditions}  # they go by number
        bodies = dict(zip(map(id, stepper.flux.histories), stepper.flux.bodies, strict=True))
        for array in stepper.evolving().values():
            body = bodies.get(id(array), range(n))
            if len(array) == len(body) and id(array) not in own:
                yield array, body

    def _sorted_places(self) -> np.ndarray:
        """Places in the order that particles should have, each body within its range, (n,)."""
        stepper, configuration = self.stepper, self.stepper.configuration
        reference, particles = configuration.fields, stepper.particles
        x = reference.x.numpy().astype(float)
        box = np.array(configuration.lists.box, dtype=float)
        x -= box * np.floor(np.divide(x, box, out=np.zeros_like(x), where=box > 0.0))
        spacing = particles.spacing.numpy() * reference.h.numpy() / particles.h.numpy()
        sorted_bodies = [
            body.start + spatial_order(x[body.start : body.stop], float(np.median(spacing[body.start : body.stop])))
            for body in stepper.flux.bodies
        ]
        return np.concatenate(sorted_bodies)
