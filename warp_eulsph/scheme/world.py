"""The world of a simulation: media under conditions, with one state, one clock and one ledger."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import warp as wp

from ..boundaries import Bound
from ..execution import Launcher
from ..fields import allocate, arrays, repeated
from ..interactions import BoundInteraction
from ..operators.neighbours import NeighbourLists
from ..space import Space
from ..structs import ForceArrays, ParticleArrays, StateArrays
from .exchanges import Exchange, Exchanges
from .flux import Flux
from .laws import Part
from .ledger import Ledger
from .medium import Medium, MediumParts
from .reference import Configuration
from .refresh import BY_HOST, Refresh
from .stabiliser import Stabiliser
from .time_step import DeviceClock
from .waiting import Waiting


@dataclass(frozen=True)
class Parts:
    """What a world is made of.

    Attributes:
        space: dimension and precision.
        U: struct ``State``, the state at the start.
        particles: struct ``Particles``.
        media: in the order of the particles.
        conditions: imposed in this order.
        interactions: between the media, or with what moves beside them.
        clock: time on the device.
    """

    space: Space
    U: StateArrays
    particles: ParticleArrays
    media: Sequence[MediumParts]
    conditions: Sequence[Bound]
    interactions: Sequence[BoundInteraction]
    clock: DeviceClock


class _Steady(NamedTuple):
    """Media in which imposed velocities have the mean of a step in its middle, and the conditions that impose there."""

    media: Sequence[Medium]
    conditions: Sequence[Bound]


def _steady(media: Sequence[Medium], conditions: Sequence[Bound]) -> _Steady:
    """What is steady: no limiter changes v, no breaking matter M4, no condition v that is not steady itself and in all
    of its media.
    """
    imposing = [condition for condition in conditions if type(condition).impose is not Bound.impose]
    where = {id(c): [m for m in media if _acts_on(c, m.span)] for c in imposing}
    found = [medium for medium in media if medium.limiter is None and medium.breaking is None]
    for _ in media:  # a condition of two media may make both unsteady, which others share
        for c in imposing:
            if not c.steady or any(medium not in found for medium in where[id(c)]):
                found = [medium for medium in found if medium not in where[id(c)]]
    return _Steady(found, [c for c in imposing if all(medium in found for medium in where[id(c)])])


def _acts_on(condition: Bound, span: range) -> bool:
    return bool(((condition.indices >= span.start) & (condition.indices < span.stop)).any())


class World:
    """Media under conditions. All that bodies have in common is in one set of arrays, of which media have views.

    Attributes:
        U: state at tⁿ (struct ``State``). half: state at t^{n+½}.
        media: in the order of the particles. conditions: imposed in this order.
        interactions: between the media; ``exchanged``: the forces [N] of each, (n,) of vec.
        forces, grad_v: of the last step. clock: time on the device. ledger: where the energy went. steps: taken so far.
        heated: the media whose dissipation heats; exchanging: between whose pairs volume flows. scratch: what one of
            these leaves in a step, (n,).
    """

    #: Whether steps leave ∇_k v^{n+1} for the next one, in media where conditions are steady and nothing limits v.
    keeps_gradient: ClassVar[bool] = False

    def __init__(self, parts: Parts):
        self.space, self.clock, self.conditions = parts.space, parts.clock, parts.conditions
        self.interactions = parts.interactions
        self.particles, self.U, space = parts.particles, parts.U, parts.space
        self.device, self.n, self.steps = self.clock.device, len(self.U.x), 0
        n, device, self._launch = self.n, self.device, Launcher(self.device)
        self.media = [Medium(space, each, self.conditions, device) for each in parts.media]
        # A fixed reference has no use for surface vectors, and most conditions have none
        self.moves_surfaces = not all(medium.policy.fixed for medium in self.media) or any(
            condition.reads_surface for condition in self.conditions
        )
        self._steady = _steady(self.media, self.conditions) if self.keeps_gradient else _Steady((), ())
        self.limiting = [condition for condition in self.conditions if condition.limits]
        self.exchanged = [wp.zeros(n, dtype=space.vec, device=device) for _ in self.interactions]
        self.half: StateArrays = allocate(space, "State", n, device, empty=() if self.moves_surfaces else ("surface",))
        if not self.moves_surfaces:
            self.half.surface = self.U.surface
        self.forces = self._allocate_forces()
        self.grad_v = wp.zeros(n, dtype=space.mat, device=device)
        for medium in self.media:
            medium.join(self.U, self.half, self.forces, self.grad_v, self.clock.of(medium.span), self.moves_surfaces)
            medium.keep_gradients(medium in self._steady.media)
        self._waiting: Waiting | None = None  # nobody waits at the start
        self._start([each.surface_given for each in parts.media])
        self.ledger = Ledger(space, self.particles, self.media, self.clock, device, self._exchanges(), self.damped)
        self.ledger.open(self.U)
        self.heated = [medium for medium in self.media if medium.heats]
        self.exchanging = [medium for medium in self.media if medium.exchanges]
        self.scratch = wp.zeros(n if self.heated or self.exchanging else 0, dtype=space.real, device=device)
        for medium in self.media:
            medium.take_scratch(self.scratch, self.ledger.v_old)
            if self.clock.independent:
                medium.wait(self.U)
        if self.clock.independent and self.conditions:
            self._waiting = Waiting(space, [(0, self.U.v)], self.clock.fields, device)

    def _allocate_forces(self) -> ForceArrays:
        """Struct ``Forces``, where those that are always zero take the memory of one."""
        n, vec, device = self.n, self.space.vec, self.device
        self.damped = any(condition.damps for condition in self.conditions)
        self.loaded = self.damped or bool(self.interactions) or any(condition.loads for condition in self.conditions)
        there = {
            "correction": any(medium.stabiliser.corrects for medium in self.media),
            "tie": any(medium.pairs is not None for medium in self.media),
            "external": self.loaded,
            "damping": self.damped,
        }
        forces: ForceArrays = allocate(self.space, "Forces", n, device, empty=there)
        self._zero = wp.zeros(1, dtype=vec, device=device)
        for name, needed in there.items():
            setattr(forces, name, wp.zeros(n, dtype=vec, device=device) if needed else repeated(self._zero, n))
        return forces

    def _start(self, surface_given: Sequence[bool]) -> None:
        """The first references, the area vectors and what depends on them."""
        self._impose(self.U, 0.0)
        for medium, given in zip(self.media, surface_given, strict=True):
            medium.start(self.U)
            if not given:
                medium.find_surface(self.U)
            medium.look_outward(self.U)
        for condition in self.conditions:
            condition.start(self.U)
        for medium in self.media:
            medium.stabilise(self.U)
        for interaction in self.interactions:
            interaction.start(self)
        for medium in self.media:
            medium.keep_gradient(self.U)

    def _exchanges(self) -> Exchanges | None:
        """The page of the interactions, where there are any."""
        if not self.interactions:
            return None
        between = zip(self.interactions, self.exchanged, strict=True)
        listed = [
            Exchange(forces, functools.partial(interaction.energy, self), interaction.passed, interaction.supplied)
            for interaction, forces in between
        ]
        return Exchanges(self.space, self.particles, self.clock.fields, listed, self.device)

    # the references

    def due(self, step: int) -> tuple[int, ...]:
        """Which media's references are to be refreshed before step number ``step``; the first finds them fresh."""
        if step == 0:
            return ()
        return tuple([k for k, medium in enumerate(self.media) if medium.due(step, self.U)])

    def refresh(self, due: Sequence[int], by: Refresh = BY_HOST) -> None:
        """Make U the reference of these media, shifted (M15)."""
        by(lambda: self._move(due), self._lists(due), lambda: self._renew(due))

    def finish_refresh(self, due: Sequence[int]) -> None:
        """The rest of a refresh that found lists too short."""
        BY_HOST.finish(self._lists(due), lambda: self._renew(due))

    def _lists(self, due: Sequence[int]) -> list[NeighbourLists]:
        return [self.media[k].configuration.lists for k in due]

    def _move(self, due: Sequence[int]) -> None:
        """First part of a refresh, launches only: the reference becomes U, shifted (M15); neighbours are counted."""
        self._shift(self.U, due)
        for k in due:
            self.media[k].move(self.U)

    def _renew(self, due: Sequence[int]) -> None:
        """Last part of a refresh, launches only, when the lists have room: neighbours, corrections, balance."""
        for k in due:
            self.media[k].renew(self.U)

    def _shift(self, U: StateArrays, due: Sequence[int] | None = None) -> None:
        shifted = [m for k, m in enumerate(self.media) if m.shifter is not None and (due is None or k in due)]
        for medium in shifted:
            medium.shift(U)
        if shifted:
            self._impose(U, 0.0)
            self.ledger.book_shift(U)

    def rebuild(self) -> None:
        """Derive what the evolving arrays determine, ∇_k v of U too; to be called when they were overwritten."""
        for medium in self.media:
            medium.rebuild()
            medium.keep_gradient(self.U)
        for interaction in self.interactions:
            interaction.rebuild(self)

    # what a checkpoint holds

    def evolving(self) -> dict[str, wp.array]:
        """Every array that a step reads before it writes it, by name: with ``steps`` what a checkpoint must hold."""
        listed = [arrays(self.U, "State"), arrays(self.particles, "Particles"), {"reaction": self.forces.reaction}]
        for k, medium in enumerate(self.media):
            name = "" if len(self.media) == 1 else f"Medium.{k}."
            listed.append({name + own: array for own, array in medium.evolving().items()})
        listed += [self.clock.evolving(), self.ledger.evolving()]
        parts: list[tuple[str, Bound | BoundInteraction]] = []
        parts += [(f"Condition.{i}", condition) for i, condition in enumerate(self.conditions)]
        parts += [(f"Interaction.{i}", interaction) for i, interaction in enumerate(self.interactions)]
        for own, part in parts:
            listed.append({f"{own}.{name}": array for name, array in part.evolving().items()})
        return {name: array for held in listed for name, array in held.items()}

    @property
    def remembering(self) -> list[tuple[range, Part]]:
        """Places of each body's particles, with its law and what they remember."""
        found = []
        for medium in self.media:
            for part in medium.flux.parts:
                first = medium.span.start + part.first
                found.append((range(first, first + part.size), part))
        return found

    # of the only medium, where there is one

    @property
    def medium(self) -> Medium:
        """The only medium.

        Raises:
            ValueError: there are several.
        """
        if len(self.media) > 1:
            raise ValueError(f"there are {len(self.media)} media, none of them is the only one; ask one of media")
        return self.media[0]

    @property
    def configuration(self) -> Configuration:
        """The reference k of the only medium."""
        return self.medium.configuration

    @property
    def flux(self) -> Flux:
        """Stress, wave speeds and stored energy of the only medium."""
        return self.medium.flux

    @property
    def stabiliser(self) -> Stabiliser:
        """What keeps the sums of the only medium stable."""
        return self.medium.stabiliser

    # lines of a step

    def _impose(self, state: StateArrays, fraction: float, steady: bool | None = None) -> None:
        waiting = self._waiting if state is self.U else None  # what is imposed twice may differ by round-off
        if waiting is not None:
            waiting.keep()
        for condition in self.conditions:
            if steady in (None, condition in self._steady.conditions):
                condition.impose(state, self.clock.fields, fraction)
        if waiting is not None:
            waiting.put_back()
