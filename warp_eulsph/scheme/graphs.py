"""Steps recorded as graphs: one launch of a graph instead of the launches of a step, and no look at the device between.

A step with a refresh and one without are a graph each, recorded after the first of its kind was taken by the host. A
graph decides on the device whether it does anything: not after the target time, not after a particle turned bad, and
not where a refresh found more neighbours than the lists have room for; then the host makes room and ends that step.
So steps by graphs equal those by the host in every bit, however many are launched between two looks.
"""

from typing import Any

import warp as wp

from .lax_wendroff import LaxWendroffStepper


def recordable(stepper: LaxWendroffStepper) -> bool:
    """Whether steps launch kernels only: conditions given as Python functions need the host in every step."""
    return all(condition.recordable for condition in stepper.conditions)


class StepGraphs:
    """The graphs of one stepper's steps."""

    def __init__(self, stepper: LaxWendroffStepper):
        self.stepper = stepper
        self._taken: set[bool] = set()
        self._graphs: dict[bool, Any] = {}
        self._lists: Any = None  # the graphs are of these lists, which may grow

    def take(self, most: int) -> None:
        """Take steps, ``most`` at most, fewer when the target is reached or a particle turns bad."""
        stepper, clock, lists = self.stepper, self.stepper.clock, self.stepper.configuration.lists
        due = stepper.due(stepper.steps)
        if due not in self._taken:  # by the host: its kernels get compiled, and all it needs allocated
            stepper.step()
            self._taken.add(due)
            return
        clock.open_batch()
        launched = 0
        while due in self._taken:
            wp.capture_launch(self._graph(due))
            launched += 1
            if launched == most or not stepper.policy.by_count:
                break
            due = stepper.due(stepper.steps + launched)
        taken = clock.taken
        stepper.steps += taken
        if taken < launched and lists.waiting:
            lists.make_room()
            stepper.renew_reference()
            stepper.advance()
            stepper.steps += 1

    def _graph(self, due: bool) -> Any:
        rows = self.stepper.configuration.near
        if self._lists is not rows.index:
            self._graphs.clear()
            self._lists = rows.index
        if due not in self._graphs:
            with wp.ScopedCapture(self.stepper.device) as capture:
                self._record(due)
            self._graphs[due] = capture.graph
        return self._graphs[due]

    def _record(self, due: bool) -> None:
        stepper, running = self.stepper, self.stepper.clock.fields.running
        lists = stepper.configuration.lists
        if due:
            wp.capture_if(running, stepper.move_reference)
            # By itself, because it allocates, which a branch of a CUDA graph may not; repeating it changes nothing
            lists.sum_counts()
            lists.check_room(running)
            wp.capture_if(running, stepper.renew_reference)
        wp.capture_if(running, stepper.advance)
