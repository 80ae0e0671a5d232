"""The flux of momentum: stress in the reference, body by body (M1), the wave speeds there, and what laws remember."""

from collections.abc import Callable, Sequence
from itertools import groupby, pairwise
from typing import Any

import numpy as np
import warp as wp

from ..execution import Launcher, simd
from ..fields import allocate
from ..materials import Law, Material
from ..materials.base import Eights, history_row
from ..materials.in_eights import EIGHT
from ..space import Space
from ..structs import ClockArrays, FluxArrays, ParticleArrays
from . import flux_eights
from . import flux_kernels as kernels
from .laws import Kind, kinds_of
from .policy import Always, Every, ReferencePolicy
from .reference import Configuration


def check_reference(materials: Sequence[Material], policy: ReferencePolicy) -> None:
    """Raise unless the reference moves every step where a material needs that.

    Raises:
        ValueError: a material that forgets and a policy other than Always().
    """
    for material in materials:
        if material.forgets and policy not in (Always(), Every(1)):
            raise ValueError(
                f"reference must be Always() for {type(material).__name__}, whose F is not counted from the initial "
                f"configuration, got {policy}"
            )


def _blocks(sizes: Sequence[int], device: wp.DeviceLike) -> wp.array:
    """First particles of blocks of eight, of bodies of these ``sizes`` each by itself, and the end."""
    starts = np.cumsum([0, *sizes])
    blocks = [np.arange(start, end, EIGHT) for start, end in pairwise(starts)]
    return wp.array(np.concatenate([*blocks, starts[-1:]]), dtype=wp.int32, device=device)


class Flux:
    """Stress, wave speeds, stored energy and histories of all bodies; a launch per kind of law and quantity.

    Args:
        bodies: (material, number of particles) in the order of the particle arrays.

    Attributes:
        kinds: the bodies by kinds of law, in their order. parts: the bodies with their laws and histories.
        bodies: particle indices of each body.
        forgets: every body carries J alone.
    """

    def __init__(
        self, space: Space, bodies: list[tuple[Material, int]], particles: ParticleArrays, device: wp.DeviceLike
    ):
        self.space, self.particles, self.device = space, particles, device
        self._launch, self._simd = Launcher(device), simd(device)
        self.kinds = kinds_of(space, bodies, particles, device)
        self.parts = [part for kind in self.kinds for part in kind.parts]
        self._constants = [material.constants() for material, _ in bodies]
        self._blocks = {kind.first: None if kind.several else _blocks([kind.size], device) for kind in self.kinds}
        n = sum(part.size for part in self.parts)
        remembers = any(part.law.history for part in self.parts)
        empty = ["Pi", "tie", "drag", "secant", "tied", "slipped"] + ([] if remembers else ["dissipated"])
        self.fields: FluxArrays = allocate(space, "Flux", n, device, empty=empty)
        self.bodies = [range(part.first, part.first + part.size) for part in self.parts]
        self.forgets = all(material.forgets for material, _ in bodies)

    def evolving(self) -> dict[str, wp.array]:
        """The histories of the bodies that have one, and what yielding left of the tie; what a checkpoint must hold."""
        held = {f"Flux.history.{i}": part.history for i, part in enumerate(self.parts) if part.law.history}
        return held | ({"Flux.secant": self.fields.secant} if len(self.fields.slipped) else {})

    def keep_dual(self) -> None:
        """Have ``compute`` write Π too, for forces that take it from the array (M5)."""
        if not len(self.fields.Pi):
            self.fields.Pi = wp.zeros_like(self.fields.Q)

    def keep_dissipated(self) -> None:
        """Have the ledger read ``fields.dissipated``, which others than the laws write to."""
        if not len(self.fields.dissipated):
            self.fields.dissipated = wp.zeros_like(self.fields.speed)

    def go_run_by_run(self, groups: Sequence[int]) -> None:
        """Ask laws for eight particles at once of one run, which have one step: bodies of these ``groups``, one each.

        Where constants differ within a run laws are asked for one particle at once, as they are for it alone.
        """
        number = 0
        for kind in self.kinds:
            own = range(number, number + len(kind.parts))
            runs = [list(bonded) for _, bonded in groupby(own, lambda k: groups[k])]
            alike = all(self._constants[k] == self._constants[run[0]] for run in runs for k in run)
            sizes = [sum(self.parts[k].size for k in run) for run in runs]
            self._blocks[kind.first] = _blocks(sizes, self.device) if alike else None
            number = own.stop

    def moduli(self) -> list[tuple[float, float]]:
        """Moduli of pressure and of shear waves at F = I [Pa] of each body; reads the device."""
        found = []
        for part in self.parts:
            out = wp.zeros(1, dtype=self.space.row(2), device=self.device)
            row = history_row(self.space, part.law)
            start = wp.array([row(*part.law.start)], dtype=row, device=self.device)
            arguments = [start, part.constants, out]
            self._launch.once(kernels.make_moduli(self.space, part.law), 1, arguments)
            found.append((float(out.numpy()[0, 0]), float(out.numpy()[0, 1])))
        return found

    def compute(
        self, F: wp.array, grad_v: wp.array, configuration: Configuration, clock: ClockArrays, fraction: float = 0.0
    ) -> None:
        """Q of the deformation gradients ``F`` (M1), and Π = Q Lᵀ (M5) if it is kept.

        F is ``fraction`` Δt ahead of the histories, moved by ``grad_v`` = ∇_k v.
        """
        space, fixed, dual = self.space, configuration.fixed, len(self.fields.Pi) > 0
        for kind in self.kinds:
            arguments = [kind.first, F, grad_v, kind.history, self.particles, configuration.fields, clock, fraction]
            self._run(
                kind,
                [*arguments, kind.laws, self.fields],
                lambda law, several: kernels.make_flux(space, law, several, fixed, dual),
                lambda law, eights, several: flux_eights.make_flux(space, law, eights, several, fixed, dual),
            )

    def wave_speeds(self, F: wp.array, grad_v: wp.array, configuration: Configuration, clock: ClockArrays) -> None:
        """Wave speeds measured in the reference; raise ``clock.rate`` to the largest rate of waves or strain [1/s]."""
        space, fixed = self.space, configuration.fixed
        for kind in self.kinds:
            arguments = [kind.first, F, grad_v, kind.history, self.particles, configuration.fields]
            self._run(
                kind,
                [*arguments, kind.laws, self.fields, clock],
                lambda law, several: kernels.make_wave_speeds(space, law, several, fixed),
                lambda law, eights, several: flux_eights.make_wave_speeds(space, law, eights, several, fixed),
            )

    def energy(self, F: wp.array, out: wp.array) -> None:
        """Stored energy [J] of each particle."""
        space = self.space
        for kind in self.kinds:
            arguments = [kind.first, F, kind.history, self.particles, kind.laws, out]
            self._run(
                kind,
                arguments,
                lambda law, several: kernels.make_energy(space, law, several),
                lambda law, eights, several: flux_eights.make_energy(space, law, eights, several),
            )

    def update(self, F: wp.array, grad_v: wp.array, configuration: Configuration, clock: ClockArrays) -> None:
        """After a full step that ``grad_v`` = ∇_k v made: what each law keeps of F, its history, what it dissipated."""
        space, fixed, tied = self.space, configuration.fixed, len(self.fields.slipped) > 0
        for kind in self.kinds:
            law = kind.law
            if law.history and law.update is not None:
                arguments = [kind.first, F, grad_v, kind.history, self.particles, configuration.fields, clock]
                self._run(
                    kind,
                    [*arguments, kind.laws, self.fields],
                    lambda law, several: kernels.make_update(
                        space, law, several, fixed, law.secant is not None and tied
                    ),
                    lambda law, eights, several: flux_eights.make_update(
                        space, law, eights, several, law.secant is not None and tied
                    ),
                )
            elif law.update is not None:
                kernel = kernels.make_forget(self.space, law, kind.several)
                self._launch(kernel, kind.size, [F, self.particles, kind.laws], kind.first)

    def _run(
        self,
        kind: Kind,
        arguments: Sequence[Any],
        make: Callable[[Law, bool], wp.Kernel],
        make_of_eights: Callable[[Law, Eights, bool], wp.Kernel],
    ) -> None:
        """Launch over the particles of a kind, eight at once where that is to be done."""
        law, blocks = kind.law, self._blocks[kind.first]
        if law.eights is None or blocks is None or not self._simd:
            self._launch(make(law, kind.several), kind.size, arguments, kind.first)
        else:
            kernel = make_of_eights(law, law.eights, kind.several)
            self._launch(kernel, len(blocks) - 1, [blocks, *arguments], each=EIGHT)

    def rebase(self, F: wp.array) -> None:
        """Before a refresh: F and histories as the new reference takes them."""
        for kind in self.kinds:
            if kind.law.rebase is not None:
                arguments = [kind.first, F, kind.history, self.particles, kind.laws]
                self._launch(kernels.make_rebase(self.space, kind.law, kind.several), kind.size, arguments, kind.first)
