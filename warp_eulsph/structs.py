"""What host code knows of the Warp structs, which are made at run time: protocols with the names of their arrays.

Shapes, units and meanings stand beside the makers, in ``fields.py``; a test holds the names of both together.
"""

from typing import Protocol

import warp as wp


class ParticleArrays(Protocol):
    """Struct ``Particles``: what does not change, but for the order in memory."""

    mass: wp.array
    V0: wp.array
    h: wp.array
    spacing: wp.array
    share: wp.array
    outward: wp.array
    body: wp.array
    group: wp.array


class StateArrays(Protocol):
    """Struct ``State``: what a scheme moves on."""

    x: wp.array
    v: wp.array
    F: wp.array
    surface: wp.array


class ReferenceArrays(Protocol):
    """Struct ``Reference``: configuration k."""

    x: wp.array
    balanced: wp.array
    h: wp.array
    V: wp.array
    resolution: wp.array
    L: wp.array
    F: wp.array
    moment: wp.array
    row: wp.array
    diagonal: wp.array


class FluxArrays(Protocol):
    """Struct ``Flux``: stress and wave speeds in the reference."""

    Q: wp.array
    Pi: wp.array
    tie: wp.array
    secant: wp.array
    tied: wp.array
    slipped: wp.array
    dissipated: wp.array
    drag: wp.array
    speed: wp.array
    impedance: wp.array
    shear_impedance: wp.array


class ForceArrays(Protocol):
    """Struct ``Forces``: by what they come from."""

    internal: wp.array
    correction: wp.array
    dissipation: wp.array
    tie: wp.array
    external: wp.array
    damping: wp.array
    free_v: wp.array
    reaction: wp.array


class NeighbourRows(Protocol):
    """Struct ``Neighbours``: rows with their weights; ``box`` is a vector."""

    start: wp.array
    stop: wp.array
    stride: int
    index: wp.array
    w: wp.array
    own: wp.array
    box: wp.array


class ClockArrays(Protocol):
    """Struct ``Clock``: arrays of one element per run, but for ``run``, of one per particle."""

    t: wp.array
    dt: wp.array
    free_dt: wp.array
    longest_dt: wp.array
    target: wp.array
    look: wp.array
    rate: wp.array
    frequency: wp.array
    added: wp.array
    bad: wp.array
    running: wp.array
    taken: wp.array
    steps: wp.array
    lag: wp.array
    run: wp.array
    first: int
    every: int
