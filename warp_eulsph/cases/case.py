"""The case: the schema of a case file, and what it builds."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import warp as wp
from pydantic import Field, field_validator, model_validator

from .. import geometry
from ..boundaries import Boundary, mirror
from ..boundaries.mirror import Image
from ..materials import Material
from ..output import FIELDS, Probe, Recording
from ..schedule import AnyOf, AtTimes, EverySteps, EveryTime, Schedule
from ..scheme.lax import Lax
from ..scheme.lax_wendroff import LaxWendroff
from ..scheme.reference import ReferencePolicy
from ..scheme.time_step import TimeStep
from ..scheme.verlet import Verlet
from ..simulation import Body, Simulation
from ..space import Space
from ..weights import Weight
from .expressions import COORDINATES, nearest
from .options import Table, Zone, choice, made, one_of
from .values import Formula, Number, PlaceFormula, Whole

#: The shapes of ``geometry``: its functions.
SHAPES = tuple(getattr(geometry, name) for name in geometry.__all__ if not isinstance(getattr(geometry, name), type))
PRECISIONS = {"double": wp.float64, "single": wp.float32}
Precision = Literal["double", "single"]


class MirrorPlane(Table):
    """A plane behind which a body gets mirror ghosts."""

    point: list[Number] = Field(description="a point of the plane [m], (dim,)")
    normal: list[Number] = Field(description="normal of the plane, out of the body, (dim,)")
    depth: Number | None = Field(None, description="particles this near get a ghost [m]; two support radii by default")
    image: choice(Image) = Field("Wall", validate_default=True, description="Wall, or Antisymmetry for a linear law")  # type: ignore[valid-type]


class BodyTable(Table):
    """A solid: a shape filled with particles, its material, and how it starts."""

    shape: one_of(*SHAPES) = Field(description="a function of warp_eulsph.geometry")  # type: ignore[valid-type]
    material: choice(Material)  # type: ignore[valid-type]
    velocity: PlaceFormula = Field(0.0, validate_default=True, description="initial velocity [m/s]")
    volume: PlaceFormula | None = Field(None, description="volumes [m^dim] instead of those of the shape")
    spacing: PlaceFormula | None = Field(None, description="spacings [m]; the dim-th root of the volume by default")
    surface: PlaceFormula | None = Field(
        None,
        description="outward area vectors [m^(dim-1)] of the particles, 0 inside; as the shape has them by default",
    )
    mirror: list[MirrorPlane] = Field([], description="planes behind which the body gets mirror ghosts")

    @property
    def dim(self) -> int:
        """Dimension, by the first point of the shape; meshes are in 3-D."""
        points = [value for _, value in self.shape if isinstance(value, list)]
        return len(points[0]) if points else 3

    def build(self, name: str) -> Body:
        """The body, without ghosts."""
        try:
            x, volume, *given = self.shape.make()
        except ValueError as error:
            raise ValueError(f"body.{name}.shape: {error}") from None
        except MemoryError:
            raise ValueError(f"body.{name}.shape: it does not fit into memory; increase the spacing") from None
        surface = given[0] if given else None
        return Body(
            x=x,
            volume=volume if self.volume is None else self.volume.at(x)[:, 0],
            spacing=None if self.spacing is None else self.spacing.at(x)[:, 0],
            material=self.material.make(),
            velocity=self.velocity.at(x),
            surface=surface if self.surface is None else self.surface.at(x),
            name=name,
        )


class OutputTable(Table):
    """What a run writes, and when."""

    every: Number | None = Field(None, gt=0.0, description="time between snapshots [s]")
    steps: Whole | None = Field(None, gt=0, description="steps between snapshots")
    at: list[Number] = Field([], description="more times [s] of snapshots, hit exactly")
    fields: list[str] | None = Field(None, description=f"fields of a snapshot, all by default: {', '.join(FIELDS)}")
    precision: Precision = Field("single", description="of the stored numbers")
    region: Zone | None = Field(None, description="particles in the snapshots, by initial positions; all by default")
    body: str | None = Field(None, description="body whose particles are in the snapshots, any by default")
    log: choice(Schedule) = Field({"kind": "EverySteps", "count": 16}, validate_default=True)  # type: ignore[valid-type]
    checkpoint: Number = Field(600.0, gt=0.0, description="wall time between checkpoints [s]")

    @field_validator("fields")
    @classmethod
    def _known(cls, fields: list[str] | None) -> list[str] | None:
        for name in fields or []:
            if name not in FIELDS:
                raise ValueError(f"unknown field {name!r}{nearest(name, FIELDS)}; known are {list(FIELDS)}")
        return fields

    @field_validator("at")
    @classmethod
    def _in_order(cls, at: list[float]) -> list[float]:
        return list(AtTimes(at).times)


class Case(Table):
    """A whole problem; SI units throughout, plane strain in 2-D and uniaxial strain in 1-D.

    Numbers may be formulas of ``parameters``; regions, velocities and loads may be formulas of place and time.
    """

    title: str = Field("", description="what is solved, in one line")
    until: Number = Field(gt=0.0, description="end time [s]")
    parameters: dict[str, Number] = Field({}, description="numbers that formulas may use by name, or formulas of those")
    definitions: dict[str, str] = Field({}, description="formulas of place and time that others may use by name")
    body: dict[str, BodyTable] = Field(min_length=1, description="bodies by name")
    boundary: list[choice(Boundary)] = Field([], description="conditions, imposed in this order")  # type: ignore
    reference: choice(ReferencePolicy) = Field("Always", validate_default=True)  # type: ignore[valid-type]
    scheme: choice(Verlet, LaxWendroff, Lax) = Field("Verlet", validate_default=True)  # type: ignore[valid-type]
    time_step: choice(TimeStep) = Field("TimeStep", validate_default=True)  # type: ignore[valid-type]
    weight: choice(Weight) = Field("CubicSpline", validate_default=True)  # type: ignore[valid-type]
    dilation: Number = Field(1.3, gt=0.0, description="smoothing length over spacing")
    periodic: list[Number] | None = Field(None, description="lengths [m] of a periodic box at the origin; 0 is open")
    precision: Precision = Field("double", description="of the simulation")
    device: str | None = Field(None, description="Warp device such as cuda:0; Warp's default otherwise")
    output: OutputTable = Field({}, validate_default=True)  # type: ignore[arg-type]
    probe: list[choice(Probe)] = Field([], description="what goes to tables of its own; boundary counts from 0")  # type: ignore

    @property
    def dim(self) -> int:
        """Dimension of the first body."""
        return next(iter(self.body.values())).dim

    @property
    def space(self) -> Space:
        """Dimension and precision."""
        return Space(self.dim, PRECISIONS[self.precision], self.periodic is not None)

    def build(self) -> Simulation:
        """The simulation at its start.

        Raises:
            ValueError: as ``Simulation`` and the geometry say, particles or regions that do not fit together.
            ModuleNotFoundError: a mesh without meshio.
            OSError: a mesh file that is not there.
        """
        bodies, ghosts = [], []
        weight, space = self.weight.make(), self.space
        for name, table in self.body.items():
            body = table.build(name)
            for plane in table.mirror:
                depth = plane.depth
                if depth is None:
                    depth = 2.0 * weight.support * self.dilation * float(body.spacing.max())
                body, condition = mirror(
                    body, point=plane.point, normal=plane.normal, depth=depth, image=plane.image.make()
                )
                ghosts.append(condition)
            bodies.append(body)
        conditions: Sequence[Boundary] = [condition.make(space) for condition in self.boundary]
        return Simulation(
            bodies,
            boundaries=[*conditions, *ghosts],
            reference=self.reference.make(),
            scheme=self.scheme.make(),
            time_step=self.time_step.make(),
            weight=weight,
            dilation=self.dilation,
            periodic=self.periodic,
            dtype=PRECISIONS[self.precision],
            device=self.device,
        )

    def recording(self, simulation: Simulation) -> Recording:
        """What a run of this simulation keeps.

        Raises:
            ValueError: probes of equal names.
        """
        output = self.output
        snapshots: list[Schedule] = [AtTimes(output.at)]
        snapshots += [EveryTime(output.every)] if output.every is not None else []
        snapshots += [EverySteps(output.steps)] if output.steps is not None else []
        probes = []
        for table in self.probe:
            arguments = table.arguments()
            if "boundary" in arguments:
                arguments["boundary"] = simulation.boundaries[arguments["boundary"]]
            probes.append(table.target(**arguments))
        return Recording(
            snapshots=AnyOf(snapshots),
            fields=output.fields,
            dtype=np.float64 if output.precision == "double" else np.float32,
            region=made(output.region, self.space, "region"),
            body=output.body,
            log=output.log.make(),
            probes=probes,
            checkpoint=output.checkpoint,
        )

    def describe(self) -> dict[str, Any]:
        """The full case with its defaults, formulas of parameters worked out; JSON and TOML can hold it.

        ``parse_case`` of it gives the same case.
        """
        return self.model_dump(mode="json", exclude_none=True)

    @model_validator(mode="after")
    def _agree(self) -> "Case":
        """What one table says of another: bodies by name, dimensions."""
        wrong = []
        dim, where = self.dim, " and ".join(COORDINATES[: self.dim])
        for name, body in self.body.items():
            if body.dim not in (1, 2, 3):
                wrong.append(f"body.{name}.shape: points must have 1, 2 or 3 components, got {body.dim}")
            if body.dim != dim:
                wrong.append(f"body.{name}: bodies must have the same dimension, got {body.dim} and {dim}")
        for path, value in self._formulas():
            beyond = value.names & set(COORDINATES[dim:])
            if beyond:
                wrong.append(f"{path}: {sorted(beyond)} are not coordinates in {dim}-D, which has {where}")
            allowed = {1} if path.endswith((".volume", ".spacing")) else {1, dim}
            if len(value.parts) not in allowed:
                counts = " or ".join(str(count) for count in sorted(allowed))
                wrong.append(f"{path}: must have {counts} components in {dim}-D, got {len(value.parts)}")
        named = [(f"boundary.{k}", table) for k, table in enumerate(self.boundary)]
        probes = [(f"probe.{k}", table) for k, table in enumerate(self.probe)]
        for path, table in [*named, *probes, ("output", self.output)]:
            of = getattr(table, "body", None)
            if of is not None and of not in self.body:
                wrong.append(
                    f"{path}.body: unknown body {of!r}{nearest(of, self.body)}; bodies are {sorted(self.body)}"
                )
        for path, table in probes:
            count = len(self.boundary)
            if hasattr(table, "boundary") and not 0 <= table.boundary < count:
                wrong.append(f"{path}.boundary: must be one of the {count} conditions, from 0, got {table.boundary}")
        names = [table.name for _, table in probes]
        wrong += [f"probe.{k}.name: is taken by another, got {n!r}" for k, n in enumerate(names) if n in names[:k]]
        if wrong:
            raise ValueError("\n".join(wrong))
        return self

    def _formulas(self) -> list[tuple[str, Formula]]:
        """Path and value of every formula of place."""
        tables: dict[str, Table] = {f"body.{name}": body for name, body in self.body.items()}
        tables |= {f"boundary.{k}": condition for k, condition in enumerate(self.boundary)} | {"output": self.output}
        pairs = ((f"{path}.{name}", value) for path, table in tables.items() for name, value in table)
        return [(path, value) for path, value in pairs if isinstance(value, Formula)]
