"""A scheme at work: the lines of which its step is made, each over the media of the world."""

from abc import ABC, abstractmethod
from typing import Any

import warp as wp

from .base import Scheme
from .health import check
from .world import Parts, World


class Stepper(World, ABC):
    """A world that a scheme moves on. A scheme writes ``advance``, a table of contents of lines such as these.

    Attributes:
        options: of the scheme, those of the first medium where media differ.
    """

    def __init__(self, options: Scheme, parts: Parts):
        super().__init__(parts)
        self.options = options

    def step(self) -> None:
        """Advance U by one step."""
        due = self.due(self.steps)  # k = 0, every few steps, or n
        if due:
            self.refresh(due)
        self.advance()
        self.steps += 1

    @abstractmethod
    def advance(self) -> None:
        """Advance U on the present references; launches only."""

    def _velocity_gradient(self, state: Any) -> None:
        for medium in self.media:
            medium.velocity_gradient(state)

    def _gradients(self, state: Any) -> None:
        for medium in self.media:
            medium.gradients(state)

    def _choose_dt(self, state: Any) -> None:
        self.clock.fields.rate.zero_()
        for medium in self.media:
            medium.wave_speeds(state)
        self.clock.choose()

    def _sense(self, state: Any) -> None:
        for medium in self.media:
            medium.sense(state)

    def _stress(self, state: Any) -> None:
        for medium in self.media:
            medium.stress(state)

    def _sum_forces(self, state: Any, rates: Any, fraction: float) -> None:
        for medium in self.media:
            medium.sum_forces(state, rates)
        if self.loaded:
            self.forces.external.zero_()
        for condition in self.conditions:
            condition.load(state, self.clock.fields, fraction, self.forces.external)

    def _smooth(self, state: Any, out: Any) -> None:
        for medium in self.media:
            medium.smooth(state, out)

    def _predict(self, state: Any, out: Any, fraction: float) -> None:
        for medium in self.media:
            medium.predict(state, out, fraction)

    def _kick(self, state: Any) -> None:
        for medium in self.media:
            medium.kick(state)

    def _drift(self, state: Any, rates: Any, fraction: float, out: Any) -> None:
        for medium in self.media:
            medium.drift(state, rates, fraction, out)

    def _limit(self, state: Any) -> None:
        self.ledger.open_limiter(state)
        for medium in self.media:
            medium.limit(state)
        self.ledger.close_limiter(state)

    def _release(self, state: Any) -> None:
        wp.copy(self.forces.free_v, state.v)

    def _carry(self, state: Any) -> None:
        for medium in self.media:
            medium.carry(state)

    def _check(self, state: Any) -> None:
        check(self._launch, self.space, state, self.clock.fields)
