"""Bodies, conditions and scheme put together: the object a user runs."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import warp as wp

from .arguments import bound, check_options, warn
from .body import Body, checked_bodies
from .boundaries import Assembly, Bound, Boundary
from .building import Given, check_neighbourhoods, make_particles, make_state, plan_media, ranges_of
from .checks import check_restorable, checked_box, objects, real_number, whole_number
from .diagnostics import Diagnostics
from .execution import device_of, graphs
from .failure import failure, look_at_matter
from .interactions import BoundInteraction, Interaction
from .looks import Looks
from .memory import check_memory
from .order import Order
from .overlap import Encounters
from .progress import Bar
from .runs import Runs, check_independent, runs_of
from .schedule import AtTimes, EveryTime, Schedule, next_target
from .scheme.arrangement import Arrangement, Convected
from .scheme.base import Scheme
from .scheme.graphs import StepGraphs, recordable
from .scheme.health import UnstableError
from .scheme.policy import Always, ReferencePolicy
from .scheme.reference import Configuration
from .scheme.time_step import DeviceClock, TimeStep
from .scheme.world import Parts
from .sorting import Sorting
from .space import Space
from .turns import alone, in_turn
from .weights import Weight
from .whole import Whole

# Steps by graphs between two looks at the clock; graphs past the target or past a failure do nothing.
STEPS_BETWEEN_LOOKS = 8


@in_turn("run", "frames", "step", "advance")
class Simulation(Looks):
    """Runs bodies under conditions with one scheme.

    Args:
        bodies: one or several ``Body``; particles of different bodies are never neighbours.
        boundaries: conditions, imposed in this order.
        interactions: forces between bodies, or between bodies and what moves beside them.
        reference: when the reference is refreshed: Never() total Lagrangian, Every(k), Always() Eulerian. This,
            arrangement, scheme, weight and dilation are those of bodies that have none of their own; the step is one.
        arrangement: which bodies a refresh reads anew from their positions: Convected() those that flow, Current() all.
        scheme: Verlet options, or those of the paper's LaxWendroff or one-step Lax. Where this, weight and dilation are
            None, each body takes what suits its matter, bonded ones theirs together (``defaults.py``): Verlet(),
            CubicSpline() and 1.3, what yields Verlet(dissipation=Upwind(stress=True)), liquids their own.
        time_step: TimeStep options.
        weight: SPH weight.
        dilation: smoothing length over spacing.
        periodic: lengths [m] of a periodic box with a corner at the origin, (dim,), 0 where open; None is open.
        dtype: ``wp.float64`` or ``wp.float32``.
        device: Warp device name; the default device if None.
        independent: every body, with those bonded to it, is a run with steps, time, ledger and end of its own
            (``runs``). Times to hit are hit by all; ``t`` is where all are that have not failed, and sums are of those.
        sort: keep particles sorted in memory, so that steps do not slow down as they move; False is for comparisons.
            Results come in the order of the bodies' particles either way; for arrays on the device see ``order``.

    Raises:
        ValueError: bodies of different dimension, equal names, coincident particles, particles whose neighbours do not
            span the space, a region that selects nothing, options out of range.
        MemoryError: more particles than the device has memory for; the message says how much each takes.
    """

    def __init__(
        self,
        bodies: Body | Sequence[Body],
        *,
        boundaries: Sequence[Boundary] = (),
        interactions: Sequence[Interaction] = (),
        reference: ReferencePolicy = Always(),
        arrangement: Arrangement = Convected(),
        scheme: Scheme | None = None,
        time_step: TimeStep = TimeStep(),
        weight: Weight | None = None,
        dilation: float | None = None,
        periodic: Sequence[float] | None = None,
        dtype: type = wp.float64,
        device: wp.DeviceLike = None,
        independent: bool = False,
        sort: bool = True,
    ):
        self.bodies = checked_bodies(objects(bodies, Body, "bodies", "Body(...)"))
        check_options(reference, arrangement, scheme, time_step, weight, dilation, dtype)
        X = np.concatenate([body.x for body in self.bodies])
        self.space = Space(X.shape[1], dtype, periodic is not None)
        self.device = device_of(device)
        self.boundaries = tuple(objects(boundaries, Boundary, "boundaries", "Fixed(lambda X: X[:, 0] < 0.1)"))
        self.interactions = tuple(objects(interactions, Interaction, "interactions", "an Interaction"))
        self.reference, self.arrangement = reference, arrangement
        box = checked_box(periodic, self.space.dim)
        self.options = Given(reference, arrangement, scheme, weight, dilation)
        media = plan_media(self.bodies, self.options)
        first = media[0].options
        self.dilation = first.dilation
        check_memory(self.space, [(each.n, each.reach, each.moves) for each in media], self.device)
        self.ranges = ranges_of(self.bodies)
        self.particles = make_particles(self.space, media, self.device)
        self.order = Order(len(X), self.device)
        surface_given = self.bodies[0].surface is not None
        assembly = Assembly(self.space, self.device, X, self.particles, self.ranges, self.order, surface_given)
        self.conditions = [bound(boundary, Bound, assembly) for boundary in self.boundaries]
        self.bound_interactions = [bound(each, BoundInteraction, assembly) for each in self.interactions]
        touching = {two for interaction in self.bound_interactions for two in interaction.touching}
        unmet = (self.particles.share.numpy() == 0.0) | independent
        self.encounters = Encounters(self.bodies, unmet, box, touching)
        warn(self.bodies, self.encounters, self.space.real)
        runs, every = runs_of(self.bodies, independent), 0
        sizes = [sum(len(body.x) for body in together) for together in runs]
        if independent:
            every = check_independent(media, self.conditions, self.interactions)
        self.clock = DeviceClock(self.space, time_step, first.scheme.cfl, self.device, sizes, every)
        self.stepper = first.scheme.build(
            Parts(
                space=self.space,
                U=make_state(self.space, self.bodies, self.device),
                particles=self.particles,
                media=[each.build(self.space, self.particles, box, self.device) for each in media],
                conditions=self.conditions,
                interactions=self.bound_interactions,
                clock=self.clock,
            )
        )
        check_neighbourhoods(self.stepper, self.bodies)
        self.sorting = Sorting(self.stepper, self.order, sort)
        self._graphs: StepGraphs | None = None
        self.by_graphs = graphs(self.device, len(X)) and recordable(self.stepper)
        self.diagnostics = Diagnostics(self.space, self.particles, self.device, sizes)
        self.runs = Runs(self, self.diagnostics, runs)
        self.whole = Whole()
        self.tear: UnstableError | None = None  # the first time that a solid came apart without a law of failure
        self.broken: str | None = None  # words on the first particle that failed by its law
        self.watch: Bar | None = None  # shows how far a run is
        self.output: Any = None  # who keeps frames: its ``last`` is named when the run fails

    # what a run does

    def run(
        self,
        until: float,
        *,
        every: float | None = None,
        exact: bool = True,
        output: Any = None,
        progress: bool | None = None,
    ) -> None:
        """Step to the time ``until`` [s], which is hit exactly.

        Args:
            until: end time [s], not before the present time.
            every: time between frames [s]; the first frame is the present state, the last the end.
            exact: steps are shortened so that frames are of their times; if not, frames are of the steps that reach
                these times, and cost no steps.
            output: directory of the run, which can be resumed (``output.record``); what it held moves to ``abandoned/``
                there. Or an object with ``write(simulation)``, asked once per frame.
            progress: whether a bar is shown; on a terminal and in a notebook if None.

        Raises:
            UnstableError: det F ≤ 0 or non-finite values; the last good frame stays on disk.
            BrokenError: an exception left an earlier step half done.
            OSError: the directory cannot be written.
        """
        self.whole.check()
        if not (np.isfinite(real_number(until, "until")) and until >= self.t):
            raise ValueError(f"until must be finite and not before the present time {self.t} s, got {until}")
        frames = AtTimes() if every is None else EveryTime(every, self.t, exact)
        frames.check(self.t, until)
        with Bar(self, until, progress) as self.watch:
            if output is None:
                self._advance(until)
            elif hasattr(output, "write"):
                self.output = output
                output.write(self)
                for _ in self._looks(frames, until):
                    output.write(self)
            else:
                from .output import Recording, record

                record(self, output, until, Recording(snapshots=frames), replace=True, watch=self.watch)

    def frames(self, times: Iterable[float]) -> Iterator[float]:
        """Step through increasing ``times`` [s], yielding each when it is reached exactly."""
        for time in times:
            self._advance(time)
            yield time

    def _looks(self, schedule: Schedule, until: float) -> Iterator[float]:
        """Step to ``until`` [s], yielding the time when ``schedule`` is due, and at the end."""
        while self.t < until:
            target, look = next_target(schedule, self.t, until), schedule.next_look(self.t)
            self._advance(target, look)
            yield self.t

    def step(self, count: int = 1) -> None:
        """Take ``count`` steps of the scheme's own length, aiming at no time."""
        end = self.steps + whole_number(count, 0, "count of steps")
        self.clock.aim(np.inf)
        while self.steps < end:
            self._take_steps(end - self.steps)

    def advance(self, until: float, most: int | None = None, look: float = np.inf) -> None:
        """Take the steps between two looks at the clock towards ``until`` [s], at most ``most`` steps.

        None is taken after the one that reaches ``look`` [s], and none is shortened for it.

        Raises:
            UnstableError: det F ≤ 0 or non-finite values.
            BrokenError: an exception left an earlier step half done.
        """
        self.clock.aim(until, look)
        self._take_steps(most)

    def _advance(self, until: float, look: float = np.inf) -> None:
        self.clock.aim(until, look)
        while self.t < min(until, look):
            self._take_steps(None)
            if self.watch is not None:
                self.watch(self)

    @alone
    def _take_steps(self, most: int | None) -> None:
        self.whole.check()
        with self.whole:
            if self._graphs is None:
                self.stepper.step()
            else:
                limits = (STEPS_BETWEEN_LOOKS, most, self.sorting.steps_left(self.steps))
                self._graphs.take(min(limit for limit in limits if limit is not None))
            unstable = failure(self) if not self.clock.independent else self.runs.look() or look_at_matter(self)
            if unstable is None:
                self.sorting.look_after(self.steps)
        if unstable is not None:
            raise unstable
        self.encounters.look_now_and_then(self)

    # what a checkpoint holds

    def evolving(self) -> dict[str, wp.array]:
        """Every array that a step reads before it writes it, by name."""
        return {"Order.ids": self.order.ids, **self.stepper.evolving()}

    @property
    def counters(self) -> dict[str, float]:
        """The numbers beside the arrays that evolve: steps taken, starting energy [J], longest step so far [s]."""
        return {"steps": self.steps, "start": self.stepper.ledger.start, "longest_dt": self.clock.longest_dt}

    def restore(self, arrays: Mapping[str, np.ndarray], counters: Mapping[str, float]) -> None:
        """Take over what ``evolving`` and ``counters`` were in this same simulation, at any step of it.

        Raises:
            ValueError: names or shapes that are not those of this simulation; nothing was changed.
        """
        check_restorable(self, arrays, counters)
        with self.whole:
            self.order.rearrange(arrays["Order.ids"])
            for name, array in self.evolving().items():
                array.assign(arrays[name])
            self.stepper.steps = int(counters["steps"])
            if not self.clock.independent:
                self.stepper.ledger.start = counters["start"]
                self.clock.fields.longest_dt.fill_(counters["longest_dt"])
            self.stepper.rebuild()
            if self._graphs is not None and self.whole.broken is not None:
                self._graphs = StepGraphs(self.stepper)  # what broke in may have cut a recording short
        self.runs.recall()
        self.whole.mend()

    # what a user looks at

    @property
    def t(self) -> float:
        """Time [s]."""
        return self.clock.t

    @property
    def dt(self) -> float:
        """Last time step [s]."""
        return self.clock.dt

    @property
    def by_graphs(self) -> bool:
        """Whether steps are taken as recorded graphs, not launched kernel by kernel; may be set at any time.

        By default as ``execution.graphs`` says, unless a condition needs Python in every step.
        """
        return self._graphs is not None

    @by_graphs.setter
    def by_graphs(self, on: bool) -> None:
        if on and not recordable(self.stepper):
            raise ValueError(
                "by_graphs must be False: a condition takes its values from a Python function; give it a wp.func"
            )
        self._graphs = StepGraphs(self.stepper) if on else None

    @property
    def steps(self) -> int:
        """Steps taken."""
        return self.stepper.steps

    @property
    def configuration(self) -> Configuration:
        """The configuration in which weights live now, of the first medium; ``stepper.media`` has all."""
        return self.stepper.media[0].configuration

    @property
    def x(self) -> np.ndarray:
        """Positions [m], a copy of shape (n, dim)."""
        return self.order.by_number(self.stepper.U.x.numpy())

    @property
    def v(self) -> np.ndarray:
        """Velocities [m/s], a copy of shape (n, dim)."""
        return self.order.by_number(self.stepper.U.v.numpy())

    @property
    def F(self) -> np.ndarray:
        """Deformation gradients [-], a copy of shape (n, dim, dim)."""
        return self.order.by_number(self.stepper.U.F.numpy())

    @property
    def J(self) -> np.ndarray:
        """Volume ratios det F [-], (n,)."""
        return self.order.by_number(self.diagnostics.jacobians(self.stepper.U))

    def extrema(self) -> dict[str, float]:
        """Least and largest volume ratio det F [-], largest speed [m/s] and largest mismatch [spacings]."""
        U = self.stepper.U
        found = dict(zip(("least J", "largest J", "speed"), self.diagnostics.extrema(U), strict=True))
        return found | {"mismatch": self.diagnostics.mismatch(self.stepper.media, U)[1]}

    @property
    def mismatch(self) -> np.ndarray:
        """How far positions and F disagree around each particle [spacings], rms of r_ab of its pairs (M16), (n,)."""
        return self.order.by_number(self.diagnostics.mismatch(self.stepper.media, self.stepper.U)[0].numpy())

    def energy(self) -> dict[str, float]:
        """Energies [J]: kinetic, stored in strain, in the tie (M16), total, what each mechanism added, the residual.

        Where there are interactions also ``held``, what they hold, and ``interaction``, what they added or dissipated.
        """
        U, ledger = self.stepper.U, self.stepper.ledger
        parts = {"kinetic": ledger.kinetic(U), "stored": ledger.stored(U)}
        accounts = ledger.accounts()
        parts["tied"] = -accounts.pop("tie")
        if self.interactions:
            parts["held"] = ledger.held()
        total = sum(parts.values())
        return {**parts, "total": total, **accounts, "residual": total - ledger.start - sum(accounts.values())}

    def momentum(self) -> np.ndarray:
        """Linear momentum [kg m/s], (dim,)."""
        return self.runs.momentum()[self.clock.well].sum(axis=0)

    def angular_momentum(self) -> np.ndarray:
        """Angular momentum about the origin [kg m²/s]: (3,) in 3-D, (1,) about z in 2-D, (0,) in 1-D."""
        return self.runs.angular_momentum()[self.clock.well].sum(axis=0)

    def reaction(self, boundary: Boundary) -> np.ndarray:
        """Force [N] that a velocity condition exerted on its particles, mean over the last step, (dim,).

        Of independent runs it leaves out those that have failed.
        """
        if boundary not in self.boundaries:
            raise ValueError(f"reaction: {boundary!r} is not one of simulation.boundaries; give one of these")
        numbers = self.conditions[self.boundaries.index(boundary)].indices
        reaction = self.order.by_number(self.stepper.forces.reaction.numpy())
        well = np.repeat(self.clock.well, [len(own) for own in self.runs.ranges])
        return reaction[numbers[well[numbers]]].sum(axis=0)
