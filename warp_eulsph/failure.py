"""When a run has failed, and what the user is told: a bad particle, a step that vanished, energy that a step made."""

import logging
from typing import Any, Protocol

import numpy as np

from .body import Body
from .order import Order
from .scheme.arrangement import Arrangement
from .scheme.health import WELL, UnstableError, last_good
from .scheme.stepper import Stepper
from .scheme.time_step import DeviceClock

log = logging.getLogger(__name__)

# A time step that fell below this share of the longest one means neighbourhoods that collapsed: the run would not end.
STALLED = 1e-6
# Share of the most energy there ever was that the steps themselves may make. Verlet's wobble is 1e-5 of it, and the
# midpoint rule at twice its step fails within a few steps once it made a tenth; what follows is worth nothing.
MADE = 0.5
REMEDY = "try a smaller cfl, a finer resolution or a limiter"
# Steps before that is asked: loads on a body at rest have done no work yet.
SETTLING = 100


class Failing(Protocol):
    """What is asked of a simulation.

    Attributes:
        output: who keeps frames, None where nobody does.
        tear: the first time that a solid came apart.
        broken: words on the first particle that failed by its law.
    """

    stepper: Stepper
    clock: DeviceClock
    order: Order
    bodies: list[Body]
    ranges: dict[str, range]
    arrangement: Arrangement
    output: Any
    tear: UnstableError | None
    broken: str | None

    @property
    def t(self) -> float:
        """Time [s]."""

    @property
    def steps(self) -> int:
        """Steps taken."""

    @property
    def x(self) -> np.ndarray:
        """Positions [m], (n, dim)."""

    @property
    def v(self) -> np.ndarray:
        """Velocities [m/s], (n, dim)."""

    @property
    def F(self) -> np.ndarray:
        """Deformation gradients, (n, dim, dim)."""

    def history(self, name: str) -> np.ndarray:
        """What materials remember under this name, by number."""


def failure(simulation: Failing) -> UnstableError | None:
    """What is wrong with the present state of a ``Simulation``, None while all is well; reads the device."""
    place, dt = simulation.clock.bad, simulation.clock.free_dt
    remedy = REMEDY
    if place is not None:
        particle = int(simulation.order.ids.numpy()[place])
        what = unphysical(simulation, particle)
    elif dt < STALLED * simulation.clock.longest_dt:
        particle = fastest(simulation)
        what = f"the highest wave speed, and the time step fell to {dt:.3g} s, {STALLED:g} of the longest"
    elif simulation.steps > SETTLING and (made := simulation.stepper.ledger.made()) > MADE:
        particle = fastest(simulation)
        what = f"the highest wave speed, and the steps have made {100.0 * made:.3g} % of the most energy there was"
        remedy = remedy_of_steps(simulation)
    else:
        return look_at_matter(simulation)
    return unstable(simulation, particle, what, remedy, simulation.t, simulation.steps)


def unphysical(simulation: Failing, particle: int) -> str:
    """What is wrong with the state of a particle that is."""
    x, v, F = simulation.x[particle], simulation.v[particle], simulation.F[particle]
    if not (np.isfinite(x).all() and np.isfinite(v).all() and np.isfinite(F).all()):
        return f"non-finite values, v = {v}, F = {F.tolist()}"
    if np.linalg.det(F) > 0.0:
        return f"no state that its material allows, {_history(simulation, particle)}, F = {F.tolist()}"
    return f"det F = {np.linalg.det(F):.4g}, must be positive"


def remedy_of_steps(simulation: Failing) -> str:
    """What to do where steps make energy."""
    return f"cfl is {simulation.clock.cfl:g}, {type(simulation.stepper.options).cfl:g} is the scheme's own"


def unstable(simulation: Failing, particle: int, what: str, remedy: str, time: float, step: int) -> UnstableError:
    """The error of a run that ended at ``time`` [s] after ``step`` steps, for a particle that has ``what``."""
    return UnstableError(
        f"unstable at t = {time:.8g} s, step {step}: particle {particle} "
        f"{where(simulation, particle, simulation.x)} has {what}; {last_good(simulation.output)}; {remedy}",
        particle,
        time,
        step,
    )


def look_at_matter(simulation: Failing) -> UnstableError | None:
    """Note and log, once each, the first matter that failed by its law and the first tear; the latter where it ends
    the run."""
    _look_for_failed(simulation)
    return _look_for_tears(simulation)


def _look_for_tears(simulation: Failing) -> UnstableError | None:
    """Note the first tear of a solid and log it, once; it is a failure where the arrangement says so."""
    if simulation.tear is None:
        for particle in _first_torn(simulation):
            body = next(body for body in simulation.bodies if particle in simulation.ranges[body.name])
            if body.material.flows:  # opens and closes all the time
                continue
            simulation.tear = _tear(simulation, particle)
            if getattr(body.arrangement or simulation.arrangement, "stop_when_torn", False):
                return simulation.tear
            log.warning("%s", simulation.tear)
            break
    return None


def _look_for_failed(simulation: Failing) -> None:
    """Note the first particle that has failed by its law and log it, once."""
    if simulation.broken is None:
        media = [(medium.span.start, medium.breaking) for medium in simulation.stepper.media]
        places = [(start, int(breaking.first.numpy()[0])) for start, breaking in media if breaking is not None]
        found = [start + place for start, place in places if place != WELL]
        if found:
            particle = int(simulation.order.ids.numpy()[found[0]])
            simulation.broken = (
                f"matter has failed by t = {simulation.t:.8g} s, step {simulation.steps}: particle {particle} "
                f"{where(simulation, particle, simulation.x)} is among the first"
            )
            log.warning("%s", simulation.broken)


def _tear(simulation: Failing, particle: int) -> UnstableError:
    """That a solid has come apart, the first of whose particles with a new face is this one."""
    lost = -simulation.stepper.ledger.accounts()["dissipation"]
    return UnstableError(
        f"a solid comes apart without a law of failure by t = {simulation.t:.8g} s, step {simulation.steps}: the first "
        f"particle with a new face is {particle} {where(simulation, particle, simulation.x)}; dissipation has taken "
        f"{lost:.4g} J so far; arrangement=Convected() holds solids together",
        particle,
        simulation.t,
        simulation.steps,
    )


def _first_torn(simulation: Failing) -> list[int]:
    """Number of the first particle with a new face of each medium that has one; reads the device."""
    found = [(medium, getattr(medium.stabiliser, "potentials", None)) for medium in simulation.stepper.media]
    places = [medium.span.start + int(own.torn.numpy()[0]) for medium, own in found if own is not None]
    ids = simulation.order.ids.numpy() if places else []
    return [int(ids[place]) for place in places if place < len(ids)]


def where(simulation: Failing, particle: int, x: np.ndarray) -> str:
    """Words on a particle's body and place."""
    name = next(name for name, indices in simulation.ranges.items() if particle in indices)
    return place_of(name, x[particle])


def place_of(body: str, x: np.ndarray) -> str:
    """Words on a body and a place x [m], (dim,)."""
    return f"of body {body!r} at x = {np.array2string(x, precision=6)} m"


def _history(simulation: Failing, particle: int) -> str:
    names = {variable.name for _, part in simulation.stepper.remembering for variable in part.law.history}
    return ", ".join(f"{name} = {simulation.history(name)[particle].tolist()}" for name in sorted(names))


def fastest(simulation: Failing, among: range | None = None) -> int:
    """The particle with the highest wave speed, ``among`` these or all."""
    speeds = [medium.flux.fields.speed.numpy() for medium in simulation.stepper.media]
    by_number = simulation.order.by_number(np.concatenate(speeds))
    return int(by_number.argmax()) if among is None else among.start + int(by_number[among].argmax())
