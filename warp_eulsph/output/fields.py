"""What snapshots can hold: fields of solids, and of a transported quantity."""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from ..fields import PARTICLES, STATE
from ..materials import Variable
from ..scheme.reference import LARGEST_GROWTH, LEAST_GROWTH
from .recorded import Recorded, RecordedSolids, solids, transport
from .stress import stress_array
from .tensors import first_piola


class SnapshotField(NamedTuple):
    """A field of a snapshot: shape of one value at a dimension, SI unit, meaning, and how it is made of sources.

    ``default`` says whether snapshots hold it unless fields are chosen.
    """

    shape: Callable[[int], tuple[int, ...]]
    unit: str
    meaning: str
    sources: tuple[str, ...]
    values: Callable[..., np.ndarray] = lambda source: source
    default: bool = True


def _positions(simulation: Recorded) -> wp.array:
    return simulation.stepper.U.x if solids(simulation) else simulation.configuration.fields.x


#: What fields are made of: arrays of the device, by place, to be copied, or of the host, by number, made for it.
SOURCES: dict[str, Callable[[Any], wp.array | np.ndarray]] = {
    "x": _positions,
    "v": lambda simulation: simulation.stepper.U.v,
    "F": lambda simulation: simulation.stepper.U.F,
    "J": lambda simulation: simulation.diagnostics.volume_ratios(simulation.stepper.U),
    "stress": stress_array,
    "mass": lambda simulation: simulation.particles.mass,
    "V0": lambda simulation: simulation.particles.V0,
    "body": lambda simulation: simulation.particles.body,
    "share": lambda simulation: simulation.particles.share,
    "h": lambda simulation: simulation.particles.h,
    "X": lambda simulation: simulation.X,
    "force": lambda simulation: simulation.force,
    "run_time": lambda simulation: np.repeat(simulation.runs.t, simulation.clock.sizes),
    "interaction_force": lambda simulation: simulation.interaction_force,
    "energy_density": lambda simulation: simulation.strain_energy_density,
    "mismatch": lambda simulation: simulation.mismatch,
    "particle": lambda simulation: np.arange(len(simulation.particles.mass), dtype=np.int32),
    "U": lambda transport: transport.values,
    "exact": lambda transport: transport.exact_values,
}

#: Fields of solids. Stress has nine components in any dimension: σ33 of plane strain counts.
FIELDS = {
    "velocity": SnapshotField(lambda d: (d,), STATE["v"].unit, STATE["v"].meaning, ("v",)),
    "deformation_gradient": SnapshotField(
        lambda d: (d, d), STATE["F"].unit, STATE["F"].meaning + "; missing stretches are 1", ("F",)
    ),
    "J": SnapshotField(lambda d: (), "-", "volume over initial volume, det F", ("J",)),
    "cauchy_stress": SnapshotField(lambda d: (3, 3), "Pa", "Cauchy stress", ("stress",)),
    "pressure": SnapshotField(
        lambda d: (),
        "Pa",
        "pressure, minus a third of the trace of the stress",
        ("stress",),
        lambda stress: -np.trace(stress.T) / 3.0,
    ),
    "density": SnapshotField(
        lambda d: (), "kg/m^3", "density", ("mass", "V0", "J"), lambda mass, V0, J: mass / (V0 * J)
    ),
    "body": SnapshotField(lambda d: (), PARTICLES["body"].unit, PARTICLES["body"].meaning, ("body",)),
    "share": SnapshotField(lambda d: (), PARTICLES["share"].unit, PARTICLES["share"].meaning, ("share",)),
    "volume": SnapshotField(lambda d: (), PARTICLES["V0"].unit, "volume", ("V0", "J"), lambda V0, J: V0 * J),
    "smoothing_length": SnapshotField(
        lambda d: (),
        "m",
        "smoothing length of the present configuration",
        ("x", "h", "J"),
        lambda x, h, J: h * np.clip(J ** (1.0 / x.shape[1]), LEAST_GROWTH, LARGEST_GROWTH),
    ),
    "particle": SnapshotField(lambda d: (), "-", "number of the particle in the simulation", ("particle",)),
    "run_time": SnapshotField(
        lambda d: (),
        "s",
        "time that the run of the particle has reached, less than the frame's where it failed",
        ("run_time",),
        default=False,
    ),
    "displacement": SnapshotField(
        lambda d: (d,), "m", "displacement since the start", ("x", "X"), lambda x, X: x - X, default=False
    ),
    "acceleration": SnapshotField(
        lambda d: (d,),
        "m/s^2",
        "acceleration in the last step, zero before the first",
        ("force", "mass"),
        lambda force, mass: force / mass[:, None],
        default=False,
    ),
    "force": SnapshotField(
        lambda d: (d,), "N", "force on the particle in the last step, zero before the first", ("force",), default=False
    ),
    "first_piola": SnapshotField(
        lambda d: (3, 3),
        "Pa",
        "first Piola-Kirchhoff stress, force per initial area",
        ("stress", "F"),
        first_piola,
        default=False,
    ),
    "strain_energy_density": SnapshotField(
        lambda d: (), "J/m^3", "stored energy per initial volume", ("energy_density",), default=False
    ),
    "mismatch": SnapshotField(
        lambda d: (), "-", "how far positions and F disagree, in spacings (M16)", ("mismatch",), default=False
    ),
    "interaction_force": SnapshotField(
        lambda d: (d,),
        "N",
        "force of interactions on the particle in the last step, such as of contact; zero before the first",
        ("interaction_force",),
        default=False,
    ),
}

#: Fields of a transported quantity, on particles that stay where they are; the exact one only where it is known.
TRANSPORT_FIELDS = {
    "value": SnapshotField(lambda d: (), "-", "transported quantity", ("U",)),
    "exact": SnapshotField(lambda d: (), "-", "exact transported quantity", ("exact",)),
    "volume": SnapshotField(lambda d: (), PARTICLES["V0"].unit, "volume", ("V0",)),
    "smoothing_length": SnapshotField(lambda d: (), "m", "smoothing length", ("h",)),
    **{name: FIELDS[name] for name in ("body", "particle")},
}
KNOWN = {**FIELDS, **TRANSPORT_FIELDS}
#: Fields of solids that snapshots hold unless others are chosen.
DEFAULT_FIELDS = tuple(name for name, field in FIELDS.items() if field.default)
# Before the name of a history variable, as a source.
HISTORY = "history of "


def source(name: str, simulation: Recorded) -> wp.array | np.ndarray:
    """What fields are made of, by the name of a source: of ``SOURCES``, or a history variable."""
    if solids(simulation) and name.startswith(HISTORY):
        return simulation.history(name.removeprefix(HISTORY))
    return SOURCES[name](simulation)


def history_fields(simulation: RecordedSolids) -> dict[str, SnapshotField]:
    """What the materials of a simulation remember, as fields; NaN in bodies whose law does not."""
    variables = [variable for _, part in simulation.stepper.remembering for variable in part.law.history]
    return {variable.name: _remembered(variable) for variable in variables}


def _remembered(variable: Variable) -> SnapshotField:
    shape = (3, 3) if isinstance(variable.start, tuple) else ()
    return SnapshotField(lambda d: shape, variable.unit, variable.meaning, (HISTORY + variable.name,))


def chosen_fields(names: Iterable[str] | None, simulation: Recorded) -> dict[str, SnapshotField]:
    """The fields of these names, those by default if None, that snapshots of ``simulation`` hold.

    Raises:
        ValueError: a name that is none of its fields.
    """
    if not transport(simulation):
        remembered = history_fields(simulation) if solids(simulation) else {}
        return _chosen(names, {**FIELDS, **remembered})
    held = {name: field for name, field in TRANSPORT_FIELDS.items() if name != "exact" or simulation.exact is not None}
    return _chosen(names, held)


def _chosen(names: Iterable[str] | None, fields: dict[str, SnapshotField]) -> dict[str, SnapshotField]:
    wanted = [name for name, field in fields.items() if field.default] if names is None else list(names)
    unknown = [name for name in wanted if name not in fields]
    if unknown:
        raise ValueError(f"snapshot fields must be among {list(fields)}, got {unknown}")
    return {name: fields[name] for name in wanted}
