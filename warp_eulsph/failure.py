"""When a run has failed, and what the user is told: a bad particle, a step that vanished, energy that a step made."""

import logging
from typing import Any, Protocol

import numpy as np

from .body import Body
from .scheme.arrangement import Arrangement
from .scheme.health import WELL, UnstableError, last_good
from .scheme.time_step import DeviceClock
from .worst import Bad, worst_of

log = logging.getLogger(__name__)

# A time step that fell below this share of the longest one means neighbourhoods that collapsed: the run would not end.
STALLED = 1e-6
# Share of the most energy there ever was that the steps themselves may make. Verlet's wobble is 1e-5 of it, and the
# midpoint rule at twice its step fails within a few steps once it made a tenth; what follows is worth nothing.
MADE = 0.5
# Steps before that is asked: loads on a body at rest have done no work yet.
SETTLING = 100


class Failing(Bad, Protocol):
    """What is asked of a simulation.

    Attributes:
        output: who keeps frames, None where nobody does.
        tear: the first time that a solid came apart.
        broken: words on the first particle that failed by its law.
    """

    clock: DeviceClock
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

    def history(self, name: str) -> np.ndarray:
        """What materials remember under this name, by number."""


def failure(simulation: Failing) -> UnstableError | None:
    """What is wrong with the present state of a ``Simulation``, None while all is well; reads the device."""
    place, dt = simulation.clock.bad, simulation.clock.free_dt
    step = f"a shorter step than {fixed:g} s" if (fixed := simulation.clock.option.fixed) else "a smaller cfl"
    remedy = f"try {step}, a finer resolution or a limiter"
    if place is not None:
        particle, what = _worst(simulation, place)
        material = body_of(simulation, particle).material
        if material.flows:
            remedy = f"try {step} or a finer resolution"
        if material.liquid:
            remedy += ", or stiffer matter: a sound_speed of 10 times the largest speed of the flow"
    elif dt < STALLED * simulation.clock.longest_dt:
        particle = _fastest(simulation)
        what = f"the highest wave speed, and the time step fell to {dt:.3g} s, {STALLED:g} of the longest"
    elif simulation.steps > SETTLING and (made := simulation.stepper.ledger.made()) > MADE:
        particle = _fastest(simulation)
        what = f"the highest wave speed, and the steps have made {100.0 * made:.3g} % of the most energy there was"
        remedy = f"cfl is {simulation.clock.cfl:g}, {type(simulation.stepper.options).cfl:g} is the scheme's own"
    else:
        _look_for_failed(simulation)
        return _look_for_tears(simulation)
    return UnstableError(
        f"unstable at t = {simulation.t:.8g} s, step {simulation.steps}: particle {particle} "
        f"{where(simulation, particle)} has {what}; {last_good(simulation.output)}; {remedy}",
        particle,
        simulation.t,
        simulation.steps,
    )


def _worst(simulation: Failing, place: int) -> tuple[int, str]:
    """The particle that is named, and words on what it has and how many are bad."""
    particle, J, finite, bad = worst_of(simulation, place)
    F = f"F = {simulation.F[particle].tolist()}"
    if J <= 0.0 and body_of(simulation, particle).material.forgets:  # which made 0 of whatever J was
        what = "no volume left, its J = det F went from positive to zero or below in this step"
    elif J <= 0.0:
        what = f"det F = {J:.4g}, must be positive"
    elif finite:
        what = f"no state that its material allows, {_history(simulation, particle)}, {F}"
    else:
        what = f"non-finite values, v = {simulation.v[particle]}, {F}"
    n = len(simulation.order.places)
    if bad == n > 1:
        what += f"; all {n} particles are bad, as when steps are too long or units do not fit"
    elif bad > 1:
        what += f"; {bad} of {n} particles are bad"
    return particle, what


def _look_for_tears(simulation: Failing) -> UnstableError | None:
    """Note the first tear of a solid and log it, once; it is a failure where the arrangement says so."""
    if simulation.tear is None:
        for particle in _first_torn(simulation):
            body = body_of(simulation, particle)
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
                f"{where(simulation, particle)} is among the first"
            )
            log.warning("%s", simulation.broken)


def _tear(simulation: Failing, particle: int) -> UnstableError:
    """That a solid has come apart, the first of whose particles with a new face is this one."""
    lost = -simulation.stepper.ledger.accounts()["dissipation"]
    return UnstableError(
        f"a solid comes apart without a law of failure by t = {simulation.t:.8g} s, step {simulation.steps}: the first "
        f"particle with a new face is {particle} {where(simulation, particle)}; dissipation has taken "
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


def body_of(simulation: Failing, particle: int) -> Body:
    """The body of a particle."""
    return next(body for body in simulation.bodies if particle in simulation.ranges[body.name])


def where(simulation: Failing, particle: int) -> str:
    """Words on a particle's body and place, that of the start where it has none."""
    name, x = body_of(simulation, particle).name, simulation.x[particle]
    if np.isfinite(x).all():
        return place_of(name, x)
    return f"{place_of(name, simulation.X[particle])} at the start"


def place_of(body: str, x: np.ndarray) -> str:
    """Words on a body and a place x [m], (dim,)."""
    return f"of body {body!r} at x = {np.array2string(x, precision=6)} m"


def _history(simulation: Failing, particle: int) -> str:
    names = {variable.name for _, part in simulation.stepper.remembering for variable in part.law.history}
    return ", ".join(f"{name} = {simulation.history(name)[particle].tolist()}" for name in sorted(names))


def _fastest(simulation: Failing) -> int:
    speeds = [medium.flux.fields.speed.numpy() for medium in simulation.stepper.media]
    return int(simulation.order.by_number(np.concatenate(speeds)).argmax())
