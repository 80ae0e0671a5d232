"""The skin of bodies: their outermost particles, the face of each, and which way out is."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..boundaries import Assembly
from ..boundaries.outermost import LARGE
from ..execution import Launcher, launch
from ..space import Space
from ..structs import StateArrays
from .faces import make_area, make_find, make_outward
from .normals import make_beside, make_lever, make_normals, make_planes, make_turn, make_want

if TYPE_CHECKING:
    from ..scheme.medium import Medium
    from ..scheme.world import World


def flowing(medium: "Medium") -> np.ndarray:
    """Which particles of a medium flow, (n,) int32: they change places all the time."""
    flows = np.zeros(medium.n, dtype=np.int32)
    for part in medium.flux.parts:
        moves = not medium.configuration.fixed and part.law.update is not None and part.law.rebase is None
        flows[part.first : part.first + part.size] = moves
    return flows


class _Layer:
    """The skin of one medium; its outermost particles are those of the reference.

    Attributes:
        outermost: of all its particles, (n,) int32. outward: which way out is, (n,) of vec; zero in liquids.
        alone: which of them have no normal, (n,) int32: those that flow, and those beside a crack.
        changes: whether other particles may become outermost. breaking: what cracks it, if anything does.
    """

    def __init__(self, space: Space, medium: "Medium", device: Any):
        self.space, self.medium, self._launch = space, medium, Launcher(device)
        n = medium.n
        self.outermost = wp.zeros(n, dtype=wp.int32, device=device)
        fixed, exact = medium.configuration.fixed, medium.surface_given
        flows = flowing(medium)
        self._flowing = wp.array(flows, dtype=wp.int32, device=device)
        self.outward = medium.particles.outward
        if not fixed and (flows.any() or not exact):
            self.outward = wp.zeros(n, dtype=space.vec, device=device)
        self.breaking = medium.breaking if fixed else None
        self.alone = self._flowing if self.breaking is None else self.breaking.frayed
        self.changes = self.breaking is not None
        self.changes |= self.outward is not medium.particles.outward and not flows.all()
        self.least = 0.0 if exact else LARGE
        self._normals, self._centres = (wp.zeros(n, dtype=space.vec, device=device) for _ in range(2))
        self._levers = wp.zeros(n, dtype=space.mat, device=device)
        self._masses = wp.zeros(n, dtype=space.real, device=device)
        self.wanted = wp.zeros(n, dtype=wp.int32, device=device)

    def find(self) -> None:
        """Which are outermost in the present reference."""
        configuration, n = self.medium.configuration, self.medium.n
        if self.outward is not self.medium.particles.outward:
            arguments = [configuration.fields, configuration.near, self._flowing, self.outward]
            self._launch(make_outward(self.space), n, arguments)
        arguments = [self.medium.particles, configuration.fields, configuration.near, configuration.poor]
        arguments += [self._flowing, self.outward]
        self._launch(make_find(self.space), n, [*arguments, self.least, self.outermost])
        if configuration.fixed and self.space.dim > 1:
            arguments = [self.medium.particles, configuration.fields, configuration.near, self.outward, self.outermost]
            self._launch(make_planes(self.space), n, [*arguments, self._normals, self._centres, self._masses])

    def areas(self, places: wp.array, *found: wp.array) -> None:
        """What the skin has of its particles at ``places``: ``there``, ``torn``, ``came``, ``area`` and ``bend``."""
        cut = self._flowing if self.breaking is None else self.breaking.cut
        arguments = [*self._of(places), self.outward, self.outermost, self.alone, cut, *found]
        self._launch(make_area(self.space), len(places), arguments)

    def normals(self, places: wp.array, state: StateArrays, normal: wp.array, answer: wp.array) -> None:
        """Which way out is of those at ``places``, by where the particles of ``state`` are."""
        arguments = [*self._of(places), self.medium.of(state), self.outward, self.outermost]
        arguments += [self.alone, self.wanted, self._normals, self._centres, self._masses, normal, answer]
        kernel = make_normals(self.space, self.medium.configuration.fixed)
        self._launch(kernel, len(places), arguments)

    def want(self, places: wp.array, start: wp.array, beside: wp.array) -> None:
        """Ask for the normals of those at ``places`` whose rows, from ``start`` on, are not empty."""
        first = self.medium.span.start
        device = self.wanted.device
        launch(make_want(self.space), len(places), [places, first, start, self.wanted], device)
        arguments = [places, first, self.medium.configuration.near, self.outermost, self.wanted, beside]
        launch(make_beside(self.space), len(places), arguments, device)

    def turn(
        self, places: wp.array, answer: wp.array, beside: wp.array, state: StateArrays, slope: wp.array, out: wp.array
    ) -> None:
        """Add the forces on particles by which normals answer the slopes ∂E/∂n of an energy."""
        fixed = self.medium.configuration.fixed
        arguments = [places, self.medium.span.start, self.medium.particles, self.wanted, self._normals, self._masses]
        self._launch(make_lever(self.space, fixed), len(places), [*arguments, answer, slope, self._levers])
        arguments = [*self._of(places), self.medium.of(state), self.outward, self.wanted, beside]
        arguments += [self._centres, self._masses, self._levers, out]
        self._launch(make_turn(self.space, fixed), len(places), arguments)

    def _of(self, places: wp.array) -> list[Any]:
        configuration = self.medium.configuration
        return [places, self.medium.span.start, self.medium.particles, configuration.fields, configuration.near]


class Skin:
    """The outermost particles of bodies, in gathers that are the same on any number of threads.

    Where the arrangement stays that of the start, its outermost particles stay outermost, and the skin has them alone;
    where it is read anew, or breaks, every particle may be, and ``there`` says which are. Particles of liquids change
    places all the time: all of them are, and have no normal. So are those that lost a neighbour to a crack: no plane
    says where their surface is. An outermost particle lies half a
    spacing beneath the surface; bodies are at least two particles thick.

    Args:
        world: at its start, with the first references.
        assembly: what its parts were bound with.
        bodies: names; all if None.

    Attributes:
        indices: numbers of the particles that are or may be outermost, (k,) int32, ascending.
        places: where they lie, (k,) int32 on the device, kept right.
        bodies: number of the body of each, (k,) int32, on the device.
        there: whether it is outermost, (k,) int32.
        torn: 1 where it lost pairs to a crack, 2 where it lost all, (k,) int32.
        came: whether it is outermost, or more torn, since the last ``find``, (k,) int32.
        area: face of each in the reference [m^(d−1)], (k,).
        half: distance from the particle to the surface, half a spacing [m], (k,).
        modulus, shear_modulus: ρ c² of pressure and of shear waves at F = I [Pa], (k,).
        normal: unit vector that points out, (k,) of vec, zero where a fragment has none; after ``look``.
        slope: ∂E/∂n of each [J], (k,) of vec, of an energy that depends on normals; for ``turn``.
        bend: how far the particles around are from a plane in the reference, 0 flat to 1 (k,): least over next
            eigenvalue of their second moment; about ½ in corners. Where it is 1 the normal tells nothing.

    Raises:
        ValueError: a body without outermost particles.
    """

    def __init__(self, world: "World", assembly: Assembly, bodies: Sequence[str] | None = None):
        self.space, device = world.space, world.device
        names = list(assembly.bodies) if bodies is None else list(bodies)
        self._layers = [_Layer(world.space, medium, device) for medium in world.media]
        self.find_layers()
        ranges = [assembly.bodies[name] for name in names]
        may_be = np.zeros(len(assembly.X), dtype=bool)
        for layer in self._layers:
            span = layer.medium.span
            found = np.ones(len(span), dtype=bool) if layer.changes else layer.outermost.numpy() == 1
            may_be[span.start : span.stop] = found
        may_be = assembly.order.by_number(may_be)
        wanted = np.zeros_like(may_be)
        for name, own in zip(names, ranges, strict=True):
            wanted[own.start : own.stop] = True
            if not may_be[own.start : own.stop].any():
                raise ValueError(
                    f"body {name!r} has no outermost particles, at least two particles across each direction are "
                    "needed, and no surface=0"
                )
        self.indices = np.flatnonzero(may_be & wanted).astype(np.int32)
        self.places, k = assembly.order.places_of(self.indices), len(self.indices)
        ends = np.searchsorted(self.indices, [0, *[layer.medium.span.stop for layer in self._layers]])
        self._spans = [range(*pair) for pair in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)]
        body, spacing = (
            assembly.order.by_number(values.numpy())[self.indices]
            for values in (world.particles.body, world.particles.spacing)
        )
        moduli = np.array([both for layer in self._layers for both in layer.medium.flux.moduli()])[body]
        self.bodies = wp.array(body, dtype=wp.int32, device=device)
        self.half = wp.array(0.5 * spacing, dtype=world.space.real, device=device)
        self.modulus, self.shear_modulus = (wp.array(M, dtype=world.space.real, device=device) for M in moduli.T)
        self.there, self.torn, self.came = (wp.zeros(k, dtype=wp.int32, device=device) for _ in range(3))
        self.area, self.bend = (wp.zeros(k, dtype=world.space.real, device=device) for _ in range(2))
        self.normal, self.slope = (wp.zeros(k, dtype=world.space.vec, device=device) for _ in range(2))
        self._beside = wp.full(k, 1, dtype=wp.int32, device=device)
        self._answer = wp.zeros(k, dtype=world.space.mat, device=device)
        self._parts = [[array[own.start : own.stop] for array in self._arrays()] for own in self._spans]
        self.find()
        self._all = wp.array(np.arange(k + 1), dtype=wp.int32, device=device)
        self.want(self._all)  # until somebody knows better

    def _arrays(self) -> list[wp.array]:
        of_find = [self.places, self.there, self.torn, self.came, self.area, self.bend]
        return [*of_find, self.normal, self.slope, self._answer, self._beside]

    @property
    def changes(self) -> bool:
        """Whether other particles may become outermost."""
        return any(layer.changes for layer in self._layers)

    def tell(self, stale: wp.array) -> None:
        """Set ``stale``, (1,) int32, to 1 if a crack grew in the last step; launches only."""
        for layer in self._layers:
            if layer.breaking is not None:
                layer.breaking.tell(stale)

    def find_layers(self) -> None:
        """Which particles of the media are outermost."""
        for layer in self._layers:
            layer.find()

    def find(self) -> None:
        """Which particles are outermost in the present references, and the face of each; launches only."""
        self.find_layers()
        for layer, parts in zip(self._layers, self._parts, strict=True):
            layer.areas(*parts[:6])

    def rebuild(self) -> None:
        """Derive what goes by place, after particles changed places; all normals are asked for."""
        self.find_layers()
        for layer in self._layers:
            layer.wanted.zero_()
        self.want(self._all)

    def want(self, start: wp.array) -> None:
        """Have ``look`` find the normals of those alone that have something near them; launches only.

        Args:
            start: where the row of each begins, (k + 1,) int32; what has an empty row needs no normal.
        """
        for layer, parts, own in zip(self._layers, self._parts, self._spans, strict=True):
            layer.want(parts[0], start[own.start : own.stop + 1], parts[-1])

    def look(self, state: StateArrays) -> None:
        """Normals of the skin where the particles are in ``state`` (struct ``State``); launches only."""
        for layer, (places, *_, normal, _, answer, _) in zip(self._layers, self._parts, strict=True):
            layer.normals(places, state, normal, answer)

    def turn(self, state: StateArrays, out: wp.array) -> None:
        """Add the forces [N] of an energy that depends on the normals of the last look to ``out``, (n,) of vec.

        They are −∂E/∂n · ∂n/∂x: with them forces are those of the energy, and have no moment where it does not change
        when all turns together; their sum is zero. Launches only.

        Args:
            state: that of the look.
            out: forces; ``slope`` holds ∂E/∂n.
        """
        if self.space.dim > 1:
            for layer, parts in zip(self._layers, self._parts, strict=True):
                places, *_, slope, answer, beside = parts
                layer.turn(places, answer, beside, state, slope, out)
