"""What a run keeps, as options."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..boundaries import Assembly, Region
from ..checks import objects
from ..schedule import AnyOf, AtTimes, EverySteps, Schedule
from ..settling import STEPS_BETWEEN_LOOKS, check_tolerance, residual
from .probes import Probe
from .recorded import Recorded
from .snapshot import checked_precision

# When it is looked whether the bodies are in equilibrium
BALANCE = EverySteps(STEPS_BETWEEN_LOOKS)


@dataclass(frozen=True, kw_only=True)
class Recording:
    """What a run keeps, and when.

    Args:
        snapshots: when a snapshot is written besides the start and the end.
        fields: names of ``FIELDS`` (or ``TRANSPORT_FIELDS``) in them; ``DEFAULT_FIELDS`` (or all of these) by default.
        dtype: ``np.float32`` or ``np.float64`` of their reals.
        region: which particles are in them (see ``Region`` of the boundaries), by initial positions or numbers; all by
            default. Their numbers are in the field ``particle``. Log, probes and checkpoints are of all particles.
        body: name of the body whose particles are in them, any by default.
        log: when energies, momenta and extrema go to the log besides the start and the end. A GPU takes 8 steps
            between two looks at it, so that other numbers of steps cost time there.
        probes: what goes to tables of its own.
        checkpoint: wall time between checkpoints [s]; one is written at the start, at the end and at a stop, too.
        settle: residual at which bodies count as in equilibrium (see ``settle``), which ends the run; None runs on.

    Raises:
        ValueError: unknown fields or dtype, probes of equal names, a wall time that is not positive.
    """

    snapshots: Schedule = AtTimes()
    fields: Iterable[str] | None = None
    dtype: Any = np.float32
    region: Region | None = None
    body: str | None = None
    log: Schedule = EverySteps(16)
    probes: Sequence[Probe] = ()
    checkpoint: float = 600.0
    settle: float | None = None

    def __post_init__(self) -> None:
        if isinstance(self.fields, str):
            raise ValueError(f"fields must be a list of names, got {self.fields!r}; write [{self.fields!r}]")
        if self.fields is not None:
            named = list(self.fields) if isinstance(self.fields, Mapping) else self.fields
            object.__setattr__(self, "fields", tuple(objects(named, str, "fields", '"v", "J"')))
        object.__setattr__(self, "dtype", np.dtype(checked_precision(self.dtype)).name)
        object.__setattr__(self, "probes", tuple(objects(self.probes, Probe, "probes", "BodyProbe(name='whole')")))
        names = [probe.name for probe in self.probes]
        if len(set(names)) < len(names):
            raise ValueError(f"names of probes must differ, got {names}")
        if math.isnan(self.checkpoint) or self.checkpoint <= 0.0:
            raise ValueError(f"checkpoint must be a positive wall time [s], got {self.checkpoint}; 600 is 10 minutes")
        if self.settle is not None:
            check_tolerance(self.settle)

    def particles(self, simulation: Recorded) -> np.ndarray | None:
        """Numbers of the particles that snapshots hold, (k,) int32, ascending; None if all.

        Raises:
            ValueError: unknown body, a region of wrong shape, or nothing selected.
        """
        if self.region is None and self.body is None:
            return None
        space, device, particles = simulation.space, simulation.device, simulation.particles
        assembly = Assembly(space, device, simulation.X, particles, simulation.ranges, simulation.order)
        return np.sort(assembly.select(self.region, self.body, "Recording"))

    @property
    def schedule(self) -> Schedule:
        """When anything is due."""
        looks = [] if self.settle is None else [BALANCE]
        return AnyOf([self.snapshots, self.log, *(probe.schedule for probe in self.probes), *looks])

    def settled(self, simulation: Recorded) -> bool:
        """Whether this is a step at which the balance is looked at, and the bodies are in equilibrium."""
        if self.settle is None or not BALANCE.due(simulation.t, simulation.steps):
            return False
        return residual(simulation) <= self.settle  # type: ignore[arg-type]
