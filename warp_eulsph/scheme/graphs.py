"""Steps recorded as graphs: one launch of a graph instead of the launches of a step, and no look at the device between.

A step with a refresh and one without are a graph each, recorded after the first of its kind was taken by the host. A
graph decides on the device whether it does anything: not after the target time, not after a particle turned bad, and
not where a refresh found more neighbours than the lists have room for; then the host makes room and ends that step.
So steps by graphs equal those by the host in every bit, however many are launched between two looks.
"""

import warp as wp

from ..boundaries import Bound
from ..interactions import BoundInteraction
from ..whole import undivided
from .refresh import ByGraph
from .stepper import Stepper


def recordable(stepper: Stepper) -> bool:
    """Whether steps launch kernels only: conditions given as Python functions need the host in every step."""
    parts: list[Bound | BoundInteraction] = [*stepper.conditions, *stepper.interactions]
    return all(part.recordable for part in parts)


class StepGraphs:
    """The graphs of one stepper's steps, by the media whose references they refresh."""

    def __init__(self, stepper: Stepper):
        self.stepper = stepper
        self._by_count = all(medium.policy.by_count for medium in stepper.media)
        self._taken: set[tuple[int, ...]] = set()
        self._graphs: dict[tuple[int, ...], wp.Graph] = {}
        self._recorded_for: list[object] = []  # such as lists, which may grow

    def take(self, most: int) -> None:
        """Take steps, ``most`` at most, fewer when the target is reached or a particle turns bad."""
        stepper, clock = self.stepper, self.stepper.clock
        due = stepper.due(stepper.steps)
        if due not in self._taken:  # by the host: its kernels get compiled, and all it needs allocated
            stepper.step()
            self._taken.add(due)
            return
        self._forget_old()
        clock.open_batch()
        launched, batch = 0, []
        while due in self._taken:
            wp.capture_launch(self._graph(due))
            batch.append(due)
            launched += 1
            if launched == most or not self._by_count:
                break
            due = stepper.due(stepper.steps + launched)
        taken = clock.taken
        stepper.steps += taken
        if taken < launched:
            full = any(medium.configuration.lists.waiting for medium in stepper.media)
            if full:
                stepper.finish_refresh(batch[taken])
            if full or any(interaction.waiting for interaction in stepper.interactions):
                stepper.prepare()
                stepper.move_on()
                stepper.steps += 1

    def _forget_old(self) -> None:
        now: list[object] = [medium.configuration.near.index for medium in self.stepper.media]
        now += [each for interaction in self.stepper.interactions for each in interaction.recorded_for()]
        if len(now) != len(self._recorded_for) or any(a is not b for a, b in zip(now, self._recorded_for, strict=True)):
            self._graphs.clear()
            self._recorded_for = now

    def _graph(self, due: tuple[int, ...]) -> wp.Graph:
        if due not in self._graphs:
            with undivided(), wp.ScopedCapture(self.stepper.device) as capture:
                self._record(due)
            self._graphs[due] = capture.graph
        return self._graphs[due]

    def _record(self, due: tuple[int, ...]) -> None:
        stepper, running = self.stepper, self.stepper.clock.fields.running
        if due:
            stepper.refresh(due, ByGraph(running))
        if stepper.interactions:
            wp.capture_if(running, self._check)
        wp.capture_if(running, stepper.move_on)

    def _check(self) -> None:
        for interaction in self.stepper.interactions:
            interaction.check(self.stepper, self.stepper.clock.fields.running)
