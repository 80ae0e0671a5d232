"""A scheme at work: the lines of which its step is made, each over the media of the world."""

from abc import ABC, abstractmethod

from ..structs import StateArrays
from .base import Scheme
from .health import check
from .updates import make_add
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
        self.prepare()
        self.move_on()
        self.steps += 1

    def prepare(self) -> None:
        """What interactions need of the host before a step."""
        for interaction in self.interactions:
            interaction.prepare(self)

    def move_on(self) -> None:
        """Advance U on the present references, and what interactions have of their own; launches only."""
        self.advance()
        for interaction in self.interactions:
            interaction.advance(self)

    @abstractmethod
    def advance(self) -> None:
        """Advance U on the present references, and tick; launches only."""

    def _velocity_gradient(self, state: StateArrays) -> None:
        for medium in self.media:
            medium.velocity_gradient(state)

    def _known_gradient(self, state: StateArrays) -> None:
        for medium in self.media:
            medium.known_gradient(state)

    def _mean_gradient(self, state: StateArrays, mean: StateArrays) -> None:
        for medium in self.media:
            medium.mean_gradient(state, mean)

    def _gradients(self, state: StateArrays) -> None:
        for medium in self.media:
            medium.gradients(state)

    def _choose_dt(self, state: StateArrays) -> None:
        self.clock.ask()
        for medium in self.media:
            medium.wave_speeds(state)
        for condition in self.limiting:
            condition.limit(state, self.clock.fields)
            self.clock.add()
        for interaction in self.interactions:
            if interaction.limits:
                interaction.rate(self)
                self.clock.add()
        self.clock.choose()

    def _sense(self, state: StateArrays) -> None:
        for medium in self.media:
            medium.sense(state)

    def _stress(self, state: StateArrays, fraction: float) -> None:
        for medium in self.media:
            medium.stress(state, fraction)

    def _sum_forces(self, state: StateArrays, rates: StateArrays, fraction: float) -> None:
        for medium in self.media:
            medium.sum_forces(state, rates)
        if self.loaded:
            self.forces.external.zero_()
        for condition in self.conditions:
            condition.load(state, self.clock.fields, fraction, self.forces.external)
        if self.damped:
            self.forces.damping.zero_()
            for condition in self.conditions:
                condition.damp(state, self.clock.fields, self.forces)
        for interaction, exchanged in zip(self.interactions, self.exchanged, strict=True):
            exchanged.zero_()
            interaction.forces(self, state, fraction, exchanged)
            self._launch(make_add(self.space), self.n, [exchanged, self.forces.external])

    def _smooth(self, state: StateArrays, out: StateArrays) -> None:
        for medium in self.media:
            medium.smooth(state, out)

    def _predict(self, state: StateArrays, out: StateArrays, fraction: float) -> None:
        for medium in self.media:
            medium.predict(state, out, fraction)

    def _kick(self, state: StateArrays) -> None:
        for medium in self.media:
            medium.kick(state)

    def _drift(self, state: StateArrays, rates: StateArrays, fraction: float, out: StateArrays) -> None:
        for medium in self.media:
            medium.drift(state, rates, fraction, out)

    def _limit(self, state: StateArrays) -> None:
        self.ledger.open_limiter(state)
        for medium in self.media:
            medium.limit(state)
        self.ledger.close_limiter(state)

    def _release(self, state: StateArrays, steady: bool | None = None) -> None:
        for medium in self.media:
            if steady in (None, medium.steady):
                medium.release(state)

    def _update(self, state: StateArrays) -> None:
        for medium in self.media:
            medium.update(state)
        if self.exchanging:  # M24
            for medium in self.exchanging:
                medium.find_exchange()
            self._reflect()
            for medium in self.exchanging:
                medium.exchange(state)
        if self.heated:  # M21
            for medium in self.heated:
                medium.find_heat(state)
            self._reflect()
            for medium in self.heated:
                medium.heat(state)

    def _reflect(self) -> None:
        for condition in self.conditions:
            condition.reflect(self.scratch)

    def _check(self, state: StateArrays) -> None:
        check(self._launch, self.space, state, self.clock.fields)
