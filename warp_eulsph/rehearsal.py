"""Kernels compiled ahead, several at a time: what a simulation will launch is found out by a rehearsal.

Compiled one after the other, as steps come to launch them, the forty kernels of a first run take most of its first ten
seconds. In a rehearsal a stepper of one particle per body takes a step whose launches are only noted.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from .execution import rehearsal, simd
from .fields import allocate
from .materials import Material
from .scheme.flux import Flux
from .scheme.reference import Configuration, ReferencePolicy
from .scheme.time_step import DeviceClock, TimeStep
from .space import Space
from .weights import Weight

_rehearsed: set[Any] = set()


def compile_ahead(
    space: Space,
    materials: Sequence[Material],
    *,
    scheme: Any,
    reference: ReferencePolicy,
    weight: Weight,
    surface_given: bool,
    by_graphs: bool,
    device: Any,
) -> None:
    """Compile, or load from the cache, the kernels of a simulation with these options; once in a process.

    Conditions are left out: they may do anything.
    """
    laws = tuple(material.law(space) for material in materials)
    key = (
        space,
        laws,
        scheme,
        reference.fixed,
        weight,
        surface_given,
        by_graphs,
        wp.get_device(device).alias,
        simd(device),
    )
    if key in _rehearsed:
        return
    _rehearsed.add(key)
    n = len(materials)
    particles, U = allocate(space, "Particles", n, device), allocate(space, "State", n, device)
    for field in ("mass", "V0", "h", "spacing", "share"):
        getattr(particles, field).fill_(1.0)
    particles.body.assign(np.arange(n))
    flux = Flux(space, [(material, 1) for material in materials], particles, device)
    box = (10.0 * weight.support,) * space.dim if space.periodic else (0.0,) * space.dim
    configuration = Configuration(space, weight, particles, box, device)
    clock = DeviceClock(space, TimeStep(), scheme.cfl, device)
    with rehearsal(device):
        stepper = scheme.build(space, U, particles, flux, configuration, reference, clock, (), surface_given)
        if not reference.fixed:
            stepper.refresh()
        stepper.advance()
        if by_graphs:
            clock.open_batch()
            configuration.lists.check_room(clock.fields.running)
