"""When a run has failed, and what the user is told: a bad particle, a step that vanished, energy that a step made."""

import logging
from typing import Any, NamedTuple, Protocol

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


class Cause(NamedTuple):
    """Why a run has ended: a particle, words on what it has, and what to try."""

    particle: int
    what: str
    remedy: str


def failure(simulation: Failing) -> UnstableError | None:
    """What is wrong with a ``Simulation`` that has one clock, None while all is well; reads the device."""
    place, dt, everyone = simulation.clock.bad, simulation.clock.free_dt, range(simulation.stepper.n)
    if place is not None:
        cause = found_bad(simulation, place, everyone)
    elif dt < STALLED * simulation.clock.longest_dt:
        cause = stalled(simulation, dt, everyone)
    elif simulation.steps > SETTLING and (made := simulation.stepper.ledger.made()) > MADE:
        cause = gained(simulation, made, everyone)
    else:
        return look_at_matter(simulation)
    return unstable(simulation, cause, simulation.t, simulation.steps)


def unstable(simulation: Failing, cause: Cause, time: float, step: int) -> UnstableError:
    """The error of a run that ended at ``time`` [s] after ``step`` steps."""
    return UnstableError(
        f"unstable at t = {time:.8g} s, step {step}: particle {cause.particle} "
        f"{where(simulation, cause.particle)} has {cause.what}; {last_good(simulation.output)}; {cause.remedy}",
        cause.particle,
        time,
        step,
    )


def found_bad(simulation: Failing, place: int, among: range) -> Cause:
    """That the particle at ``place``, of a run of the particles ``among``, was found bad."""
    particle, what = _worst(simulation, place, among)
    step, remedy = _remedies(simulation)
    material = body_of(simulation, particle).material
    if material.flows:
        remedy = f"try {step} or a finer resolution"
    if material.liquid:
        remedy += ", or stiffer matter: a sound_speed of 10 times the largest speed of the flow"
    return Cause(particle, what, remedy)


def stalled(simulation: Failing, dt: float, among: range) -> Cause:
    """That the step of a run of the particles ``among`` fell to ``dt`` [s]."""
    what = f"the highest wave speed, and the time step fell to {dt:.3g} s, {STALLED:g} of the longest"
    return Cause(_fastest(simulation, among), what, _remedies(simulation)[1])


def gained(simulation: Failing, made: float, among: range) -> Cause:
    """That the steps of a run of the particles ``among`` made this share of its energy."""
    what = f"the highest wave speed, and the steps have made {100.0 * made:.3g} % of the most energy there was"
    own = type(simulation.stepper.options).cfl
    return Cause(_fastest(simulation, among), what, f"cfl is {simulation.clock.cfl:g}, {own:g} is the scheme's own")


def _remedies(simulation: Failing) -> tuple[str, str]:
    """A shorter step, in words, and all that may help."""
    step = f"a shorter step than {fixed:g} s" if (fixed := simulation.clock.option.fixed) else "a smaller cfl"
    return step, f"try {step}, a finer resolution or a limiter"


def look_at_matter(simulation: Failing) -> UnstableError | None:
    """Note and log, once each, the first matter that failed by its law and the first tear, an error if it ends all."""
    _look_for_failed(simulation)
    return _look_for_tears(simulation)


def _worst(simulation: Failing, place: int, among: range) -> tuple[int, str]:
    """The particle that is named, and words on what it has and how many are bad."""
    particle, J, finite, bad = worst_of(simulation, place, among)
    F = f"F = {simulation.F[particle].tolist()}"
    if J <= 0.0 and body_of(simulation, particle).material.forgets:  # which made 0 of whatever J was
        what = "no volume left, its J = det F went from positive to zero or below in this step"
    elif J <= 0.0:
        what = f"det F = {J:.4g}, must be positive"
    elif finite:
        what = ", ".join(["no state that its material allows", *_history(simulation, particle), F])
    else:
        what = f"non-finite values, v = {simulation.v[particle]}, {F}"
    n = len(among)
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


def _history(simulation: Failing, particle: int) -> list[str]:
    names = {variable.name for _, part in simulation.stepper.remembering for variable in part.law.history}
    return [f"{name} = {simulation.history(name)[particle].tolist()}" for name in sorted(names)]


def _fastest(simulation: Failing, among: range) -> int:
    """The particle ``among`` these with the highest wave speed."""
    speeds = [medium.flux.fields.speed.numpy() for medium in simulation.stepper.media]
    return among.start + int(simulation.order.by_number(np.concatenate(speeds))[among].argmax())
