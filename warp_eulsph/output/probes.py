"""Probes: figures of a run at a place, of a body, of a condition or across a plane, each to a table of its own."""

import re
import unicodedata
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..boundaries import Boundary
from ..diagnostics import BodySums, SectionForce
from ..interactions import BoundRigidBody
from ..schedule import EverySteps, Schedule
from ..scheme.laws import Part
from .recorded import RecordedSolids
from .shape_functions import shape_functions
from .stress import body_stress, stresses

# Bytes of a name; file systems take 255.
LONGEST_NAME = 200

#: Figures of the present state, by name; the same names and shapes every time.
Measure = Callable[[], dict[str, Any]]


@dataclass(frozen=True, eq=False, kw_only=True)
class Probe(ABC):
    """What is looked at, and when.

    Args:
        name: of the table: letters, digits, ``-``, ``_``.
        schedule: when; every step by default.
    """

    name: str
    schedule: Schedule = EverySteps(1)

    #: SI units of the figures, by name.
    units: ClassVar[dict[str, str]]

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not re.fullmatch(r"[\w-]+", self.name):
            raise ValueError(f"probe name must be of letters, digits, - and _, got {self.name!r}")
        if unicodedata.normalize("NFKC", self.name) != self.name or len(self.name.encode()) > LONGEST_NAME:
            raise ValueError(
                f"probe name must be of plain letters and at most {LONGEST_NAME} bytes, for it names a folder, got "
                f"{self.name!r}"
            )

    def units_in(self, simulation: Any) -> dict[str, str]:
        """SI units of what it measures of this simulation, by name."""
        return dict(self.units)

    @abstractmethod
    def bind(self, simulation: RecordedSolids) -> Measure:
        """What measures; made before the first step, for a run that is resumed too.

        Raises:
            ValueError: what is looked at is not in the simulation.
        """


@dataclass(frozen=True, eq=False, kw_only=True)
class PointProbe(Probe):
    """Position, velocity, deformation gradient, Cauchy stress and history of a material point.

    Means over its neighbours with the simulation's weight, corrected to be exact for fields that are linear in the
    initial position (Shepard's and Bonet's corrections together); near a surface they extrapolate.

    Args:
        X: initial position [m], (dim,).
        body: name of its body; the first by default.
    """

    X: Sequence[float]
    body: str | None = None
    units: ClassVar[dict[str, str]] = {"x": "m", "v": "m/s", "F": "-", "cauchy_stress": "Pa"}

    def units_in(self, simulation: Any) -> dict[str, str]:
        law = _part(self, simulation, self.body).law
        return {**self.units, **{variable.name: variable.unit for variable in law.history}}

    def bind(self, simulation: RecordedSolids) -> Measure:
        body, part = _body(self, simulation, self.body), _part(self, simulation, self.body)
        point = np.asarray(self.X, dtype=float)
        if point.shape != (simulation.space.dim,) or not np.isfinite(point).all():
            raise ValueError(f"probe {self.name!r}: X must be ({simulation.space.dim},) finite numbers, got {self.X}")
        near, share = _shape_functions(simulation, body, point, self.name)
        places = simulation.order.places_of(near + simulation.ranges[body.name].start)
        U, space = simulation.stepper.U, simulation.space
        stress = stresses(space, len(near), simulation.device)

        def measure() -> dict[str, Any]:
            x, v, F = (array[places].contiguous() for array in (U.x, U.v, U.F))
            history = part.history
            if part.law.history:
                own = wp.array(
                    places.numpy() - simulation.ranges[body.name].start, dtype=wp.int32, device=simulation.device
                )
                history = history[own].contiguous()
            body_stress(space, body.material, range(len(near)), F, history, stress)
            fields = {"x": x, "v": v, "F": F, "cauchy_stress": stress}
            values = {name: field.numpy() for name, field in fields.items()} | part.law.by_name(history.numpy())
            return {name: np.tensordot(share, value.astype(float), 1) for name, value in values.items()}

        return measure


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyProbe(Probe):
    """Centre of mass, momenta (angular about the origin) and kinetic energy of a body.

    Args:
        body: its name; the first by default.
    """

    body: str | None = None
    units: ClassVar[dict[str, str]] = {
        "centre": "m",
        "momentum": "kg m/s",
        "angular_momentum": "kg m^2/s",
        "kinetic": "J",
    }

    def bind(self, simulation: RecordedSolids) -> Measure:
        particles = simulation.ranges[_body(self, simulation, self.body).name]
        sums = BodySums(simulation.space, simulation.particles, particles, simulation.device)
        return lambda: dict(sums(simulation.stepper.U))


@dataclass(frozen=True, eq=False, kw_only=True)
class ReactionProbe(Probe):
    """Force that a velocity condition exerts on its particles, mean over the step.

    Args:
        boundary: the condition, one of the simulation's.
    """

    boundary: Boundary
    units: ClassVar[dict[str, str]] = {"force": "N"}

    def bind(self, simulation: RecordedSolids) -> Measure:
        if self.boundary not in simulation.boundaries:
            raise ValueError(
                f"probe {self.name!r}: boundary must be one of the simulation's {len(simulation.boundaries)}, "
                f"got {self.boundary!r}"
            )
        return lambda: {"force": simulation.reaction(self.boundary)}


@dataclass(frozen=True, eq=False, kw_only=True)
class InteractionProbe(Probe):
    """Force that interactions exert on a body in the last step: of contact with others, for example.

    Args:
        body: its name; the first by default.
    """

    body: str | None = None
    units: ClassVar[dict[str, str]] = {"force": "N"}

    def bind(self, simulation: RecordedSolids) -> Measure:
        if not simulation.interactions:
            raise ValueError(f"probe {self.name!r}: the simulation has no interactions whose forces it could look at")
        own = simulation.ranges[_body(self, simulation, self.body).name]
        return lambda: {"force": simulation.interaction_force[own.start : own.stop].sum(axis=0)}


@dataclass(frozen=True, eq=False, kw_only=True)
class SectionProbe(Probe):
    """Force across a cut of the material: what the part in front of a plane exerts on the part behind it.

    The cut moves with the material. What particles exert on each other is summed, so the force is that of the scheme,
    exact in its balance of momentum; a correction by surface vectors (M10) is no force between particles and is in it.

    Args:
        point: a point of the plane in the initial configuration [m], (dim,).
        normal: normal of the plane there, pointing to the front, (dim,).
        body: name of the body that is cut; the first by default.
    """

    point: Sequence[float]
    normal: Sequence[float]
    body: str | None = None
    units: ClassVar[dict[str, str]] = {"force": "N"}

    def bind(self, simulation: RecordedSolids) -> Measure:
        body, dim = _body(self, simulation, self.body), simulation.space.dim
        point, normal = (np.asarray(given, dtype=float) for given in (self.point, self.normal))
        if point.shape != (dim,) or normal.shape != (dim,) or not np.linalg.norm(normal) > 0.0:
            raise ValueError(
                f"probe {self.name!r}: point and normal must be ({dim},) numbers, normal not zero, "
                f"got {self.point} and {self.normal}"
            )
        behind = np.flatnonzero((body.x - point) @ normal < 0.0)
        if behind.size in (0, len(body.x)):
            raise ValueError(
                f"probe {self.name!r}: the plane must cut body {body.name!r}, all of its particles lie on one side; "
                f"they reach from {body.x.min(axis=0)} to {body.x.max(axis=0)} m"
            )
        places = simulation.order.places_of(behind + simulation.ranges[body.name].start)
        force = SectionForce(simulation.space, places)
        return lambda: {"force": force(simulation.stepper.forces)}


@dataclass(frozen=True, eq=False, kw_only=True)
class RigidProbe(Probe):
    """Place and velocity of a rigid body, force and torque of the bodies on it in the last step.

    Args:
        rigid: its name; the first by default.
    """

    rigid: str | None = None
    units: ClassVar[dict[str, str]] = {"x": "m", "v": "m/s", "force": "N", "spin": "rad/s", "torque": "N m"}

    def units_in(self, simulation: Any) -> dict[str, str]:
        return dict(list(self.units.items())[: 3 if simulation.space.dim == 1 else 5])  # nothing turns in 1-D

    def bind(self, simulation: RecordedSolids) -> Measure:
        bodies = [each for each in simulation.bound_interactions if isinstance(each, BoundRigidBody)]
        found = next((each for each in bodies if self.rigid in (None, each.option.name)), None)
        if found is None:
            names = sorted(each.option.name for each in bodies)
            raise ValueError(f"probe {self.name!r}: rigid must be one of {names}, got {self.rigid!r}")
        names = list(self.units_in(simulation))
        return lambda: {name: getattr(found, name) for name in names}


def _body(probe: Probe, simulation: RecordedSolids, name: str | None) -> Any:
    if name is None:
        return simulation.bodies[0]
    for body in simulation.bodies:
        if body.name == name:
            return body
    raise ValueError(f"probe {probe.name!r}: body must be one of {sorted(simulation.ranges)}, got {name!r}")


def _part(probe: Probe, simulation: RecordedSolids, name: str | None) -> Part:
    own = simulation.ranges[_body(probe, simulation, name).name]
    return next(part for span, part in simulation.stepper.remembering if span == own)


def _shape_functions(simulation: RecordedSolids, body: Any, X: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Particles of the body near X, (k,), and their shares, (k,), exact for linear fields."""
    own = simulation.ranges[body.name]
    weight = next(m.configuration.weight for m in simulation.stepper.media if own.start in m.span)
    h = simulation.order.by_number(simulation.particles.h.numpy())[own.start : own.stop]
    functions = shape_functions(X[None, :], body.x, body.volume, h, weight)
    if not functions.inside[0]:
        raise ValueError(
            f"probe {name!r}: X = {X.tolist()} m must lie in body {body.name!r}, whose particles lie in "
            f"{body.x.min(axis=0)} to {body.x.max(axis=0)} m"
        )
    return functions.particle, functions.share
