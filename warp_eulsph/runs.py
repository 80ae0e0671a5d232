"""Bodies as independent runs of one simulation: what may be one, and what became of each."""

import logging
import math
from collections.abc import Sequence
from itertools import groupby, pairwise

import numpy as np

from .body import Body, groups_of
from .boundaries import Bound
from .building import MediumPlan
from .diagnostics import Diagnostics
from .failure import MADE, SETTLING, STALLED, Cause, Failing, found_bad, gained, stalled, unstable
from .interactions import Interaction
from .scheme.health import WELL, UnstableError
from .scheme.policy import Always, Every, Never

log = logging.getLogger(__name__)


def runs_of(bodies: Sequence[Body], independent: bool) -> list[list[Body]]:
    """The bodies of each run: bonded ones together, or all in one.

    Raises:
        ValueError: bonded bodies with others between them.
    """
    if not independent:
        return [list(bodies)]
    groups = groups_of(bodies)
    found = [[body for body, _ in alike] for _, alike in groupby(zip(bodies, groups, strict=True), lambda two: two[1])]
    if len(found) > len(set(groups)):
        names = [body.name for body in bodies]
        raise ValueError(f"independent: bonded bodies must follow each other, got {names}; put those of a run together")
    return found


def check_independent(
    media: Sequence[MediumPlan], conditions: Sequence[Bound], interactions: Sequence[Interaction]
) -> int:
    """Steps between two in which references of independent runs may be refreshed, 1 where none ever is.

    Raises:
        ValueError: something that couples runs, or that decides by all of them.
    """
    if interactions:
        who = type(interactions[0]).__name__
        raise ValueError(
            f"independent: runs have clocks of their own and cannot touch each other, got {who}; leave out"
        )
    for condition in conditions:
        if not condition.independent:
            who = type(condition).__name__.removeprefix("Bound")
            raise ValueError(
                f"independent: {who} must know of clocks, got one that asks the host or sums over several runs; give "
                "its value by a wp.func, a Damping its rate or body, and a Bound of your own independent = True"
            )
    every = 1
    for medium in media:
        policy = medium.options.reference
        if not isinstance(policy, Never | Every | Always):
            raise ValueError(f"independent: reference must be Never(), Every(k) or Always(), got {policy}")
        if getattr(medium.options.arrangement, "stop_when_torn", False):
            raise ValueError("independent: stop_when_torn=True ends all runs at once; leave it out, tears are logged")
        every = math.lcm(every, policy.steps if isinstance(policy, Every) else 1)
    return every


class Runs:
    """The runs of a simulation, in the order of their bodies: one for each body, or group of bonded ones, where they
    are independent, else one of all.

    Attributes:
        bodies: names of the bodies of each.
        ranges: numbers of their particles.
        failures: why it ended early; None for those that did not.
    """

    def __init__(self, simulation: Failing, diagnostics: Diagnostics, bodies: Sequence[Sequence[Body]]):
        self._simulation, self._diagnostics, self._clock = simulation, diagnostics, simulation.clock
        self.bodies = [tuple(body.name for body in together) for together in bodies]
        ends = np.cumsum([0, *self._clock.sizes]).tolist()
        self.ranges = [range(first, end) for first, end in pairwise(ends)]
        self.failures: list[UnstableError | None] = [None] * len(self.ranges)

    def __len__(self) -> int:
        return len(self.ranges)

    @property
    def t(self) -> np.ndarray:
        """Time [s] of each, (runs,)."""
        return self._clock.fields.t.numpy().copy()

    @property
    def dt(self) -> np.ndarray:
        """Last time step [s] of each that no time to hit shortened, (runs,)."""
        return self._clock.fields.free_dt.numpy().copy()

    @property
    def steps(self) -> np.ndarray:
        """Steps that each has taken, (runs,)."""
        taken = self._clock.fields.steps.numpy().copy()
        return taken if self._clock.independent else np.array([self._simulation.steps])

    def energy(self) -> dict[str, np.ndarray]:
        """Energies [J] as of ``Simulation.energy``, (runs,) each, without what interactions hold."""
        ledger, U = self._simulation.stepper.ledger, self._simulation.stepper.U
        accounts = ledger.accounts_of_runs()
        parts = {"kinetic": ledger.kinetic_of_runs(U), "stored": ledger.stored_of_runs(U)}
        parts["tied"] = -accounts.pop("tie")
        total = sum(parts.values(), np.zeros(len(self)))
        residual = total - ledger.start_of_runs() - sum(accounts.values())
        return {**parts, "total": total, **accounts, "residual": residual}

    def momentum(self) -> np.ndarray:
        """Linear momentum [kg m/s] of each, (runs, dim)."""
        return self._diagnostics.momenta(self._simulation.stepper.U)[0][:, : self._simulation.stepper.space.dim]

    def angular_momentum(self) -> np.ndarray:
        """Angular momentum about the origin [kg m²/s], (runs, 3) in 3-D, (runs, 1) in 2-D, (runs, 0) in 1-D."""
        about = self._diagnostics.momenta(self._simulation.stepper.U)[1]
        return {1: about[:, :0], 2: about[:, 2:], 3: about}[self._simulation.stepper.space.dim]

    def look(self) -> UnstableError | None:
        """End the independent runs that have failed since the last look, and log why; an error once none is left. Reads
        the device."""
        clock, simulation = self._clock, self._simulation
        bad, t, steps = clock.fields.bad.numpy().copy(), self.t, self.steps
        free_dt, longest = clock.fields.free_dt.numpy(), clock.fields.longest_dt.numpy()
        made = np.where(steps > SETTLING, simulation.stepper.ledger.made_by_runs(), 0.0)
        error = None
        ended = (bad != WELL) | (free_dt < STALLED * longest) | (made > MADE)
        for r in np.flatnonzero(ended & (bad >= 0)).tolist():
            if bad[r] != WELL:
                cause = found_bad(simulation, int(bad[r]), self.ranges[r])
            elif free_dt[r] < STALLED * longest[r]:
                cause = stalled(simulation, float(free_dt[r]), self.ranges[r])
            else:
                cause = gained(simulation, float(made[r]), self.ranges[r])
            error = unstable(simulation, cause, float(t[r]), int(steps[r]))
            self.failures[r] = error
            bad[r] = -1 - cause.particle
            log.warning("run %d of %d has ended: %s", r, len(self), error)
        if error is not None:
            clock.fields.bad.assign(bad)
        return error or next(filter(None, self.failures)) if (bad < 0).all() else None

    def recall(self) -> None:
        """Say of runs that had failed when a checkpoint was taken what it still tells."""
        bad, t, steps = self._clock.fields.bad.numpy(), self.t, self.steps
        self.failures = [None] * len(self)
        for r in np.flatnonzero(bad < 0).tolist():
            cause = Cause(int(-1 - bad[r]), "ended the run before this session", "see its log")
            self.failures[r] = unstable(self._simulation, cause, float(t[r]), int(steps[r]))
