"""The order of a refresh, the same whether the host runs it or a graph records it."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence

import warp as wp

from ..operators.neighbours import NeighbourLists


class Refresh(ABC):
    """Who runs a refresh of one or several references.

    ``move`` makes the state the reference and counts neighbours, ``renew`` fills the lists and makes what depends on
    them: launches only. In between the lists may have to grow, which takes the host.
    """

    def __call__(self, move: Callable[[], None], lists: Sequence[NeighbourLists], renew: Callable[[], None]) -> None:
        """The whole refresh."""
        self.run(move)
        self.finish(lists, renew)

    def finish(self, lists: Sequence[NeighbourLists], renew: Callable[[], None]) -> None:
        """What follows when neighbours are counted."""
        for each in lists:
            each.sum_counts()  # by itself, because it allocates, which a branch of a CUDA graph may not
            self.make_room(each)
        self.run(renew)

    @abstractmethod
    def run(self, launches: Callable[[], None]) -> None:
        """Have these launches done."""

    @abstractmethod
    def make_room(self, lists: NeighbourLists) -> None:
        """See that the rows which were counted fit."""


class _ByHost(Refresh):
    def run(self, launches: Callable[[], None]) -> None:
        launches()

    def make_room(self, lists: NeighbourLists) -> None:
        lists.make_room()


class ByGraph(Refresh):
    """Recorded: done where ``running`` says so, which becomes 0 where the lists have no room."""

    def __init__(self, running: wp.array):
        self.running = running

    def run(self, launches: Callable[[], None]) -> None:
        wp.capture_if(self.running, launches)

    def make_room(self, lists: NeighbourLists) -> None:
        lists.check_room(self.running)


BY_HOST = _ByHost()
