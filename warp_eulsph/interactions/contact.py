"""Contact of bodies, and of a body with itself: they push where they touch, and do not pass through."""

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..boundaries import Assembly
from ..boundaries.outermost import pairs
from ..execution import Launcher
from ..structs import StateArrays
from .base import BoundInteraction, Interaction
from .friction import make_slip
from .law import make_give, make_push, make_raise, make_rate, skin_structure
from .moved import Moved
from .nearby import Nearby, matter_structure
from .skin import Skin, flowing
from .thinness import tell_thin
from .wetting_solids import find_wettings

if TYPE_CHECKING:
    from ..scheme.world import World

_log = logging.getLogger(__name__)

# Least distance of particles of two bodies at the start, in spacings: faces that touch have 1, or more.
APART = 0.9


@dataclass(frozen=True)
class Contact(Interaction):
    """Bodies that touch: they push each other, do not stick, and rub. There is nothing to tune.

    Outermost particles lie half a spacing beneath the surface. The half cells of two that face each other are matter
    that the contact presses, so their stiffness is that of the bodies, M = ρ c² of pressure waves::

        p = K ln(r0/r) for r < r0 ,  r0 = w_a + w_b ,  K = r0/(w_a/M_a + w_b/M_b) ,  f_ab = −A_a A_b φ(r_t) p n ,

    with w half a spacing, r and r_t the distance along the normal n and across it, A the face of a particle, and φ the
    cubic spline of dimension d − 1, h = 1.2 of the larger spacing. n is that of planes through the outermost particles
    around. Pairs are antisymmetric in every bit. Friction is Coulomb's: half cells are sheared elastically until the
    stress is ``friction`` times the pressure, then they slide..

    A body whose arrangement stays that of the start touches itself, too, where it folds, is crushed, or a notch closes:
    matter that neither feels each other by weights nor would by this law at the start. Where the arrangement is read
    anew what meets becomes neighbours. Where it breaks (``Failing``), what lost its pairs touches what it lost.

    Args:
        between: pairs of names of bodies that touch each other, ("ring", "ring") for one that touches itself; all with
            all, and with themselves, if None. Bonded bodies are one.
        friction: Coulomb's coefficient, 0 without. Pairs that differ in it are a ``Contact`` each.

    Raises:
        ValueError: when the simulation is built: unknown names, nothing that can touch, a periodic box, bodies that lie
            in each other at the start, or one without outermost particles (at least two particles thick).
    """

    between: Sequence[tuple[str, str]] | None = None
    friction: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.friction) and self.friction >= 0.0):
            raise ValueError(f"Contact: friction must be 0 or more and finite, got {self.friction}")
        if self.between is not None:
            named = [tuple(two) if not isinstance(two, str) else (two,) for two in self.between]
            wrong = [two for two in named if len(two) != 2]
            if wrong or not named:
                raise ValueError(
                    'Contact: between must be pairs of names of two bodies such as [("left", "right")], got '
                    f"{self.between}; None lets all touch all"
                )
            object.__setattr__(self, "between", tuple(named))

    def bind(self, assembly: Assembly) -> "BoundContact":
        return BoundContact(self, assembly)


class BoundContact(BoundInteraction):
    """Contact at work.

    Attributes:
        rubs: whether there is friction.
        skin, nearby: from ``start`` on; and slip: elastic slip of the skin's particles [m], (k,) of vec.
    """

    sortable = recordable = True

    def __init__(self, option: Contact, assembly: Assembly):
        names, self.rubs = list(assembly.bodies), option.friction > 0.0
        self.option, self.assembly, self.space = option, assembly, assembly.space
        for name in {name for two in option.between or () for name in two} - set(names):
            raise ValueError(f"Contact: bodies must be among {sorted(names)}, got {name!r}")
        if assembly.space.periodic:
            raise ValueError("Contact: periodic boxes are not for bodies that touch; leave out periodic=...")
        first = [own.start for own in assembly.bodies.values()]
        groups = assembly.particles.group.numpy()[first]
        chosen = option.between or list(combinations_with_replacement(names, 2))
        numbers = [(names.index(one), names.index(other)) for one, other in chosen]
        self._felt = np.zeros((len(names), len(names)), dtype=np.int32)
        for i, j in numbers:
            self._felt[i, j] = self._felt[j, i] = 1 if groups[i] != groups[j] else 2
        self.touching = frozenset((names[i], names[j]) for i, j in np.argwhere(self._felt == 1).tolist())
        self._names = [name for k, name in enumerate(names) if self._felt[k].any()]
        self.indices = np.concatenate([np.arange(own.start, own.stop) for own in self._ranges()]).astype(np.int32)
        self._launch = Launcher(assembly.device)

    def _ranges(self) -> list[range]:
        return [self.assembly.bodies[name] for name in self._names]

    def start(self, world: "World") -> None:
        self._check_apart(world)
        self._leave_out_moving(world)
        self._passed = wp.zeros(1, dtype=wp.float64, device=world.device)
        self._wettings = find_wettings(world, self.assembly, self._felt)
        self.skin = Skin(world, self.assembly, self._names)
        tell_thin(world, self.assembly, self.skin, self.touching, self._wettings)
        self.nearby = Nearby(self.skin, self._felt, self._matter(world))
        self._arrays = skin_structure(self.space)()
        for name in ("places", "there", "area", "half", "modulus", "shear_modulus", "normal", "bend"):
            setattr(self._arrays, name, getattr(self.skin, name))
        k, n, device = len(self.skin.indices), world.n, world.device
        self._arrays.given, self._granted = (wp.zeros(k, dtype=self.space.real, device=device) for _ in range(2))
        self._energy = wp.zeros(k, dtype=wp.float64, device=device)
        self._frequency = wp.zeros(1, dtype=self.space.real, device=device)
        self._nothing = wp.zeros(n, dtype=self.space.vec, device=device)
        self.slip = wp.zeros(k if self.rubs else 0, dtype=self.space.vec, device=device)
        self._found = Moved(self.space, self.skin.places, self.nearby.moved.allowed)
        self._found.note(world.U.x)
        self.nearby.look(world.U, world.clock.fields)
        if self._push(world, world.U, 0.0, self._nothing):
            self._measure(world, world.U)

    def _leave_out_moving(self, world: "World") -> None:
        """Bodies whose arrangement is read anew do not touch themselves."""
        names = list(self.assembly.bodies)
        fixed = np.concatenate([np.full(medium.n, medium.configuration.fixed) for medium in world.media])
        stays = fixed[[own.start for own in self.assembly.bodies.values()]]
        moving = [names[k] for k in np.flatnonzero((np.diag(self._felt) == 2) & ~stays)]
        if moving and self.option.between is not None:
            raise ValueError(
                f"Contact: bodies that touch themselves must keep their arrangement, {moving} read it anew; "
                "what meets there becomes neighbours. Leave them out of between, or build with arrangement=Convected()"
            )
        flows = np.concatenate([flowing(medium) for medium in world.media])
        solids = [name for name in moving if not flows[self.assembly.bodies[name].start]]
        if solids:
            _log.info("Contact: %s read their arrangement anew and do not touch themselves", solids)
        self._felt[(self._felt == 2) & ~stays] = 0
        if not self._felt.any():
            raise ValueError(
                "Contact: two bodies that are not bonded, or one whose arrangement stays, which may touch itself, are "
                f"needed, got {names}"
            )

    def _matter(self, world: "World") -> Any:
        order, indices, device = self.assembly.order, self.skin.indices, world.device
        support = np.concatenate([np.full(medium.n, medium.configuration.lists.support) for medium in world.media])
        matter = matter_structure(self.space)()
        matter.torn = self.skin.torn
        for name, values in {
            "X": self.assembly.X,
            "outward": order.by_number(world.particles.outward.numpy()),
            "spacing": order.by_number(world.particles.spacing.numpy()),
            "support": order.by_number(support * world.particles.h.numpy()),
        }.items():
            dtype = self.space.real if values.ndim == 1 else self.space.vec
            setattr(matter, name, wp.array(values[indices], dtype=dtype, device=device))
        return matter

    def _check_apart(self, world: "World") -> None:
        """Raise ValueError where two bodies lie in each other."""
        by_number, bodies = self.assembly.order.by_number, self.assembly.bodies
        spacing, share = by_number(world.particles.spacing.numpy()), by_number(world.particles.share.numpy())
        X = self.assembly.X
        for one, other in sorted(two for two in self.touching if two[0] < two[1]):
            own, others = (np.arange(bodies[name].start, bodies[name].stop) for name in (one, other))
            own, others = own[share[own] > 0.0], others[share[others] > 0.0]
            reach = APART * max(spacing[own].max(), spacing[others].max())
            near = [
                numbers[
                    ((X[numbers] > X[those].min(axis=0) - reach) & (X[numbers] < X[those].max(axis=0) + reach)).all(1)
                ]
                for numbers, those in ((own, others), (others, own))
            ]
            i, j = pairs(X[near[0]], X[near[1]], reach)
            a, b = near[0][i], near[1][j]
            mean = 0.5 * (spacing[a] + spacing[b])
            close = np.linalg.norm(X[a] - X[b], axis=1) / mean
            if (close < APART).any():
                worst = int(np.argmin(close))
                raise ValueError(
                    f"Contact: bodies must not lie in each other at the start, {one!r} and {other!r} do: "
                    f"{len(np.unique(a[close < APART]))} and {len(np.unique(b[close < APART]))} particles, the nearest "
                    f"{close[worst]:.3g} spacings apart, at {X[a[worst]]} m; move them apart: faces that touch have "
                    "their particles one spacing from each other"
                )

    def rebuild(self, world: "World") -> None:
        for wetting in self._wettings:
            wetting.rebuild()
        self.skin.rebuild()
        self.nearby.forget()

    def prepare(self, world: "World") -> None:
        """What is outermost now, where the arrangement is read anew or a crack grew, and what is near it."""
        U, clock = world.U, world.clock
        self.skin.tell(self._found.stale)
        anew = self.skin.changes and self._found(U, clock.fields)
        if anew:
            self.skin.find()
            self._found.note(U.x)
            self.nearby.forget()
        self.nearby.look(U, clock.fields, clock.option.growth)
        if anew and self.nearby.pairs:
            self._give(U)

    def _give(self, U: StateArrays) -> None:
        """What came to the surface presses nothing yet."""
        self.skin.look(U)
        wp.copy(self._granted, self._arrays.given)
        arguments = [self._arrays, self.nearby.rows, U.x, self.skin.came, self._granted]
        self._launch(make_give(self.space), len(self._granted), arguments)
        wp.copy(self._arrays.given, self._granted)

    def check(self, world: "World", running: wp.array) -> None:
        if self.skin.changes:
            self.skin.tell(self._found.stale)
            self._found.check(world.U, world.clock.fields, 0.0, running)
        self.nearby.moved.check(world.U, world.clock.fields, world.clock.option.growth, running)

    @property
    def waiting(self) -> bool:
        return self._found.far or self.nearby.moved.far

    def recorded_for(self) -> list[object]:
        return [self.nearby.rows.index] if self.nearby.pairs else []

    def _push(self, world: "World", state: StateArrays, fraction: float, out: wp.array) -> bool:
        """Forces at ``state``, and the energy; whether there can be any."""
        if self.nearby.pairs:
            self.skin.look(state)
            arguments = [self._arrays, self.nearby.rows, state.x, state.v, world.clock.fields, fraction]
            arguments += [self.option.friction, self.slip, out, self.skin.slope, self._energy]
            self._launch(make_push(self.space, self.rubs), len(self.skin.indices), arguments)
            self.skin.turn(state, out)
        return self.nearby.pairs > 0

    def forces(self, world: "World", state: StateArrays, fraction: float, out: wp.array) -> None:
        for wetting in self._wettings:
            wetting.press(out)
        self._frequency.zero_()
        if self._push(world, state, fraction, out):
            self._measure(world, state)

    def _measure(self, world: "World", state: StateArrays) -> None:
        """The frequency that the next step is chosen by, with the normals that were found for ``state``."""
        arguments = [self._arrays, self.nearby.rows, state.x, state.v, world.particles, self._frequency]
        self._launch(make_rate(self.space), len(self.skin.indices), arguments)

    def rate(self, world: "World") -> None:
        self._launch.once(make_raise(self.space), 1, [self._frequency, world.clock.fields])
        for wetting in self._wettings:
            wetting.rate()

    def advance(self, world: "World") -> None:
        for wetting in self._wettings:
            wetting.account(self._passed)
        if self.rubs and self.nearby.pairs:  # by normals and places of the last forces
            half, clock = world.half, world.clock.fields
            arguments = [self._arrays, self.nearby.rows, half.x, half.v, clock, self.option.friction, self.slip]
            self._launch(make_slip(self.space), len(self.skin.indices), arguments)

    def energy(self, world: "World") -> float:
        self.nearby.look(world.U, world.clock.fields)
        return float(self._energy.numpy().sum()) if self._push(world, world.U, 0.0, self._nothing) else 0.0

    def passed(self) -> float:
        return float(self._passed.numpy()[0])

    def evolving(self) -> dict[str, wp.array]:
        held = {"frequency": self._frequency} | ({"slip": self.slip} if self.rubs else {})
        if self.skin.changes:
            held |= {
                "found_at": self._found.at,
                "stale": self._found.stale,
                "there": self.skin.there,
                "area": self.skin.area,
                "bend": self.skin.bend,
                "torn": self.skin.torn,
                "given": self._arrays.given,
            }
        for k, wetting in enumerate(self._wettings):
            held |= {"passed": self._passed} | {f"{name}.{k}": array for name, array in wetting.evolving().items()}
        return held
