"""Bodies and options as the parts of a world: particles, a state, and the media that share a reference."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from .body import Body, groups_of
from .defaults import suited
from .failure import place_of
from .fields import allocate, part
from .materials import Material
from .scheme.arrangement import Arrangement
from .scheme.base import Scheme
from .scheme.flux import Flux, check_reference
from .scheme.medium import MediumParts, is_corrected
from .scheme.policy import Never, ReferencePolicy
from .scheme.reference import Configuration
from .scheme.world import World
from .space import Space
from .structs import ParticleArrays, StateArrays
from .weights import Weight


class Options(NamedTuple):
    """What the bodies of a medium share."""

    reference: ReferencePolicy
    arrangement: Arrangement
    scheme: Scheme
    weight: Weight
    dilation: float


class Given(NamedTuple):
    """Options of a simulation; None is what suits the matter of each body (``defaults.py``)."""

    reference: ReferencePolicy
    arrangement: Arrangement
    scheme: Scheme | None
    weight: Weight | None
    dilation: float | None


@dataclass(frozen=True)
class MediumPlan:
    """A medium to be: bodies that follow each other, with the same options.

    Attributes:
        options: the reference is Never() where the arrangement does not move.
        span: numbers of its particles.
    """

    bodies: Sequence[Body]
    options: Options
    span: range

    @property
    def n(self) -> int:
        """Particles."""
        return len(self.span)

    @property
    def moves(self) -> bool:
        """Whether the reference moves."""
        return not self.options.reference.fixed

    @property
    def reach(self) -> float:
        """Support radius in spacings."""
        return self.options.weight.support * self.options.dilation

    def build(
        self, space: Space, particles: ParticleArrays, box: Sequence[float], device: wp.DeviceLike
    ) -> MediumParts:
        """Allocate; ``particles`` are those of all media."""
        scheme, policy, given = self.options.scheme, self.options.reference, self.bodies[0].surface is not None
        own = part(space, particles, "Particles", self.span)
        flux = Flux(space, [(body.material, len(body.x)) for body in self.bodies], own, device)
        configuration = Configuration(
            space,
            self.options.weight,
            own,
            box,
            device,
            fixed=policy.fixed,
            corrected=is_corrected(scheme, policy, given),
            tilt=scheme.tilt,
            sharpened=scheme.sharpening is not None,
        )
        return MediumParts(scheme, policy, self.span, own, flux, configuration, given, groups_of(self.bodies))


def plan_media(bodies: Sequence[Body], defaults: Given) -> list[MediumPlan]:
    """The media of these bodies, in their order.

    Raises:
        ValueError: options that do not suit a material, or schemes of different kinds.
    """
    ranges = ranges_of(bodies)
    every = options_of_each(bodies, defaults)
    _check_kinds(bodies, every, defaults.scheme)
    media: list[MediumPlan] = []
    for body in bodies:
        options = every[body.name]
        check_reference([body.material], options.reference)
        together, span = [body], ranges[body.name]
        if not options.arrangement.moves(body.material):
            options = options._replace(reference=Never())
        if media and media[-1].options == options:
            before = media.pop()
            together, span = [*before.bodies, body], range(before.span.start, span.stop)
        media.append(MediumPlan(together, options, span))
    for medium in media:
        for body in medium.bodies:
            if body.bonded not in (None, *(other.name for other in medium.bodies)):
                raise ValueError(
                    f"bodies {body.bonded!r} and {body.name!r} are bonded and must be of one medium; give them the "
                    "same options, and no body with others between them"
                )
    return media


def _check_kinds(bodies: Sequence[Body], every: Mapping[str, Options], given: Scheme | None) -> None:
    """Raise ValueError unless schemes are of one kind: that of the one ``given`` to the simulation, or the first."""
    first = bodies[0]
    whose, kind = ("the simulation", type(given)) if given else (f"body {first.name!r}", type(every[first.name].scheme))
    for body in bodies:
        other = type(every[body.name].scheme)
        if other is not kind:
            remedy = f"give body {body.name!r} scheme={kind.__name__}(...)"
            if given is None and None in (first.scheme, body.scheme):
                remedy += f", or the simulation scheme={(other if body.scheme else kind).__name__}(...)"
            raise ValueError(
                f"schemes must be of one kind, for all bodies take the same steps, got {kind.__name__} of {whose} and "
                f"{other.__name__} of body {body.name!r}{'' if body.scheme else ' by default'}; {remedy}"
            )


def options_of_each(bodies: Sequence[Body], defaults: Given) -> dict[str, Options]:
    """Name of each body -> its options: its own, for those that are None the simulation's, then what suits its matter.

    Bonded bodies take what suits theirs together.
    """
    matter: dict[int, list[Material]] = {}
    groups, found = groups_of(bodies), {}
    for body, group in zip(bodies, groups, strict=True):
        matter.setdefault(group, []).append(body.material)
    for body, group in zip(bodies, groups, strict=True):
        options: dict[str, Any] = suited(matter[group])._asdict()
        for given in (defaults._asdict(), {name: getattr(body, name) for name in Options._fields}):
            options |= {name: value for name, value in given.items() if value is not None}
        found[body.name] = Options(**options)
    return found


def ranges_of(bodies: Sequence[Body]) -> dict[str, range]:
    """Name of each body -> numbers of its particles."""
    ends = np.cumsum([0, *[len(body.x) for body in bodies]]).tolist()
    return {body.name: range(ends[i], ends[i + 1]) for i, body in enumerate(bodies)}


def make_particles(space: Space, media: Sequence[MediumPlan], device: wp.DeviceLike) -> ParticleArrays:
    """Struct ``Particles`` of all media."""
    bodies = [body for medium in media for body in medium.bodies]
    dilations = np.concatenate([np.full(medium.n, medium.options.dilation) for medium in media])
    counts = [len(body.x) for body in bodies]
    volume, spacing = (np.concatenate([getattr(body, name) for body in bodies]) for name in ("volume", "spacing"))
    density = np.repeat([body.material.density for body in bodies], counts)
    particles: ParticleArrays = allocate(space, "Particles", len(volume), device)
    particles.mass.assign(density * volume)
    particles.V0.assign(volume)
    particles.h.assign(dilations * spacing)
    particles.spacing.assign(spacing)
    particles.share.fill_(1.0)
    particles.body.assign(np.repeat(np.arange(len(counts)), counts))
    groups = groups_of(bodies)
    if groups == list(range(len(bodies))):  # nothing is bonded
        particles.group = particles.body
    else:
        particles.group.assign(np.repeat(groups, counts))
    return particles


def make_state(space: Space, bodies: Sequence[Body], device: wp.DeviceLike) -> StateArrays:
    """Struct ``State`` of the bodies at the start."""
    X = np.concatenate([body.x for body in bodies])
    U: StateArrays = allocate(space, "State", len(X), device)
    U.x.assign(X)
    U.v.assign(np.concatenate([body.velocity for body in bodies]))
    U.F.assign(np.broadcast_to(np.eye(space.dim), (len(X), space.dim, space.dim)))
    if bodies[0].surface is not None:
        U.surface.assign(np.concatenate([body.surface for body in bodies]))
    return U


def check_neighbourhoods(world: World, bodies: Sequence[Body]) -> None:
    """Raise ValueError where particles coincide, or have neighbours that do not span the space; at the start only."""
    X = np.concatenate([body.x for body in bodies])

    def who(number: int) -> str:
        name = next(name for name, numbers in ranges_of(bodies).items() if number in numbers)
        return f"particle {number} {place_of(name, X[number])}"

    for medium in world.media:
        configuration, first = medium.configuration, medium.span.start
        nearest = configuration.nearest()
        close = np.flatnonzero(nearest < 1e-6 * medium.particles.spacing.numpy())
        if close.size:
            raise ValueError(
                f"particles of a body must not coincide, got {close.size} with a neighbour closer than 1e-6 spacings; "
                f"the first is {who(first + int(close[0]))}; remove duplicates; in float32 the "
                "origin must be near the bodies"
            )
        poor = np.flatnonzero(configuration.poor.numpy())
        if poor.size:
            a = int(poor[0])
            own = next(numbers for numbers in ranges_of(bodies).values() if first + a in numbers)
            away = np.delete(np.linalg.norm(X[own.start : own.stop] - X[first + a], axis=1), first + a - own.start)
            spacings = float(away.min(initial=np.inf)) / float(medium.particles.spacing.numpy()[a])
            raise ValueError(
                f"the neighbours of a particle must span all {world.space.dim} directions, {poor.size} particles lack "
                f"some; the first is {who(first + a)} with {configuration.lists.lengths[a]} neighbours within "
                f"h = {medium.particles.h.numpy()[a]:.6g} m times {configuration.weight.support}, the nearest of its "
                f"body {spacings:.3g} spacings away; that is 1 where x, volume and spacing have one unit; dilation is "
                "1.3 or somewhat more, and at least 2 particles lie across each direction"
            )
