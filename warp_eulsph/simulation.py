"""Bodies, conditions and scheme put together: the object a user runs."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from .boundaries import Assembly, Boundary
from .fields import allocate
from .materials import Material
from .scheme.flux import Flux
from .scheme.lax_wendroff import LaxWendroff, LaxWendroffStepper
from .scheme.reference import Always, Configuration, ReferencePolicy
from .scheme.time_step import DeviceClock, TimeStep
from .space import Space
from .weights import CubicSpline, Weight


@dataclass(frozen=True, eq=False, kw_only=True)
class Body:
    """A solid as particles.

    Args:
        x: initial positions [m], (n, dim).
        volume: initial volumes [m^dim], a number or (n,).
        spacing: initial particle spacing [m], a number or (n,); by default volume^(1/dim).
        material: its law.
        velocity: initial velocities [m/s], (dim,) or (n, dim).
        name: for boundary conditions and output.
    """

    x: np.ndarray
    volume: Any
    material: Material
    spacing: Any = None
    velocity: Any = 0.0
    name: str = "body"


class Simulation:
    """Runs bodies under conditions with one scheme.

    Args:
        bodies: one or several ``Body``; particles of different bodies are never neighbours.
        boundaries: conditions, imposed in this order.
        reference: when the reference is refreshed: Never() total Lagrangian, Every(k), Always() Eulerian.
        scheme: LaxWendroff options.
        time_step: TimeStep options.
        weight: SPH weight.
        dilation: smoothing length over spacing.
        periodic: lengths [m] of a periodic box with a corner at the origin, (dim,), 0 where open; None is open.
        dtype: ``wp.float64`` or ``wp.float32``.
        device: Warp device name; the default device if None.
    """

    def __init__(
        self,
        bodies: Body | Sequence[Body],
        *,
        boundaries: Sequence[Boundary] = (),
        reference: ReferencePolicy = Always(),
        scheme: LaxWendroff = LaxWendroff(),
        time_step: TimeStep = TimeStep(),
        weight: Weight = CubicSpline(),
        dilation: float = 1.3,
        periodic: Sequence[float] | None = None,
        dtype: type = wp.float64,
        device: Any = None,
    ):
        self.bodies = [bodies] if isinstance(bodies, Body) else list(bodies)
        X = np.concatenate([np.asarray(body.x, dtype=float) for body in self.bodies])
        self.space = space = Space(X.shape[1], dtype, periodic is not None)
        self.device = wp.get_device(device)
        n = len(X)
        counts = [len(body.x) for body in self.bodies]
        volume = np.concatenate([np.broadcast_to(body.volume, c) for body, c in zip(self.bodies, counts, strict=True)])
        spacing = volume ** (1.0 / space.dim)
        density = np.concatenate(
            [np.full(c, body.material.density) for body, c in zip(self.bodies, counts, strict=True)]
        )
        self.particles = allocate(space, "Particles", n, self.device)
        self.particles.mass.assign(density * volume)
        self.particles.V0.assign(volume)
        self.particles.h.assign(dilation * spacing)
        self.particles.spacing.assign(spacing)
        self.particles.body.assign(np.repeat(np.arange(len(counts)), counts))
        U = allocate(space, "State", n, self.device)
        U.x.assign(X)
        U.v.assign(np.concatenate([np.broadcast_to(body.velocity, body.x.shape) for body in self.bodies]))
        U.F.assign(np.broadcast_to(np.eye(space.dim), (n, space.dim, space.dim)))
        ends = np.cumsum([0, *counts])
        names = {body.name: range(ends[i], ends[i + 1]) for i, body in enumerate(self.bodies)}
        self.assembly = Assembly(space, self.device, X, self.particles, names)
        self.conditions = [boundary.bind(self.assembly) for boundary in boundaries]
        flux = Flux(
            space, [(b.material, c) for b, c in zip(self.bodies, counts, strict=True)], self.particles, self.device
        )
        box = tuple(periodic) if periodic is not None else (0.0,) * space.dim
        configuration = Configuration(space, weight, self.particles, box, self.device)
        self.clock = DeviceClock(space, time_step, self.device)
        self.stepper = LaxWendroffStepper(
            scheme, space, U, self.particles, flux, configuration, reference, self.clock, self.conditions
        )

    @property
    def t(self) -> float:
        """Time [s]."""
        return self.clock.t

    @property
    def steps(self) -> int:
        """Steps taken."""
        return self.stepper.steps

    @property
    def x(self) -> np.ndarray:
        """Positions [m], a copy of shape (n, dim)."""
        return self.stepper.U.x.numpy().copy()

    @property
    def v(self) -> np.ndarray:
        """Velocities [m/s], a copy of shape (n, dim)."""
        return self.stepper.U.v.numpy().copy()

    @property
    def F(self) -> np.ndarray:
        """Deformation gradients [-], a copy of shape (n, dim, dim)."""
        return self.stepper.U.F.numpy().copy()

    def run(self, until: float) -> None:
        """Step to the time ``until`` [s], which is hit exactly."""
        self.clock.aim(until)
        while self.clock.t < until:
            self.stepper.step()

    def frames(self, times: Sequence[float]) -> Iterator[float]:
        """Step through ``times`` [s], yielding each when it is reached exactly."""
        for time in times:
            self.run(time)
            yield time
