"""Bodies by kinds of law: those of one kind that follow each other are launched at once, whatever their constants."""

import functools
from collections.abc import Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from ..checks import instance
from ..fields import part_of, structure
from ..materials import Law, Material
from ..materials.base import history_row
from ..space import Space
from ..structs import ParticleArrays


class Part(NamedTuple):
    """One body: its first particle, how many it has, its law, and what the law's particles remember.

    ``history`` has one row per particle; it is empty where the law remembers nothing.
    """

    first: int
    size: int
    law: Law
    constants: Any
    history: wp.array


class Kind(NamedTuple):
    """Bodies that follow each other and have one kind of law: what is launched at once."""

    first: int
    size: int
    law: Law
    laws: Any
    history: wp.array
    parts: Sequence[Part]

    @property
    def several(self) -> bool:
        """Whether their constants differ."""
        return len(self.laws.constants) > 1


@functools.cache
def laws_structure(law: Law) -> Any:
    """The ``constants`` of bodies of one kind of law from body ``number`` on, or those that they all have.

    A struct, of which Warp asks the layout only: a law defined anew, word by word, finds the kernels of the old one.
    """

    @wp.struct
    class Laws:
        number: int
        constants: wp.array(dtype=law.Constants)

    return Laws


@functools.cache
def constants_of_body(space: Space, law: Law, several: bool) -> wp.Function:
    """``wp.func`` constants of the body of particle a."""
    Particles, Laws, Constants = structure(space, "Particles"), laws_structure(law), law.Constants

    @wp.func
    def constants_of(a: int, particles: Particles, laws: Laws) -> Constants:
        if wp.static(several):
            return laws.constants[particles.body[a] - laws.number]
        return laws.constants[0]

    return constants_of


def kinds_of(
    space: Space, bodies: Sequence[tuple[Material, int]], particles: ParticleArrays, device: wp.DeviceLike
) -> list[Kind]:
    """The kinds of (material, number of particles) in the order of the ``particles``."""
    kinds: list[Kind] = []
    first, number, spacing = 0, int(particles.body.numpy()[0]), particles.spacing.numpy()
    for law, alike in groupby(bodies, lambda body: _law_of(body[0], space)):
        kinds.append(_kind(space, law, list(alike), number, first, spacing[first:], device))
        first += kinds[-1].size
        number += len(kinds[-1].parts)
    return kinds


def _law_of(material: Material, space: Space) -> Law:
    example = "Law(Constants, stress, energy, wave_moduli)"
    found: Law = instance(material.law(space), Law, f"what {type(material).__name__}.law(space) returns", example)
    return found


def _kind(
    space: Space,
    law: Law,
    bodies: list[tuple[Material, int]],
    number: int,
    first: int,
    spacing: np.ndarray,
    device: wp.DeviceLike,
) -> Kind:
    size = sum(count for _, count in bodies)
    history = wp.zeros(size if law.history else 0, dtype=history_row(space, law), device=device)
    if law.history:
        history.assign(law.start_of(spacing[:size]))
    ends = np.cumsum([0, *(count for _, count in bodies)]).tolist()
    constants = [material.filled_constants(law) for material, _ in bodies]
    parts = [
        Part(first + begin, end - begin, law, own, part_of(history, range(begin, end)))
        for begin, end, own in zip(ends, ends[1:], constants, strict=False)
    ]
    if all(material.constants() == bodies[0][0].constants() for material, _ in bodies):
        constants = constants[:1]
    laws = laws_structure(law)()
    laws.number, laws.constants = number, wp.array(constants, dtype=law.Constants, device=device)
    return Kind(first, size, law, laws, history, parts)
