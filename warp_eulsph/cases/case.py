"""The case: the schema of a case file, and what it builds."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from ..body import checked_bodies
from ..boundaries import Boundary, mirror
from ..boundaries.mirror import Image
from ..building import Given, options_of_each
from ..interactions import Contact, Interaction, RigidBody
from ..materials import Material
from ..output import DEFAULT_FIELDS, FIELDS, Probe
from ..scheme.arrangement import Arrangement
from ..scheme.base import Scheme
from ..scheme.policy import ReferencePolicy
from ..scheme.time_step import TimeStep
from ..simulation import Body, Simulation
from ..weights import Weight
from .expressions import COORDINATES, nearest
from .options import Table, choice, one_of, open_choice, table_of
from .problem import PRECISIONS, OutputTable, Problem
from .shapes import SHAPES, dimension, particles
from .values import Formula, Number, PlaceFormula, ZoneFormula

#: What a body may have of its own.
OWN = "of this body; that of the case where it is left out"
#: What takes its value from the matter of each body.
SUITED = "what suits the matter of each body where it is left out"


class MirrorPlane(Table):
    """A plane behind which a body gets mirror ghosts."""

    point: list[Number] = Field(description="a point of the plane [m], (dim,)")
    normal: list[Number] = Field(description="normal of the plane, out of the body, (dim,)")
    depth: Number | None = Field(
        None, description="particles this near get a ghost [m]; three support radii by default"
    )
    image: choice(Image) = Field("Wall", validate_default=True, description="Wall, NoSlip or Antisymmetry")  # type: ignore[valid-type]


class BodyTable(Table):
    """A solid: a shape filled with particles, its material, and how it starts."""

    shape: one_of(*SHAPES) = Field(description="a function of warp_eulsph.geometry")  # type: ignore[valid-type]
    material: open_choice(Material)  # type: ignore[valid-type]
    velocity: PlaceFormula = Field(0.0, validate_default=True, description="initial velocity [m/s]")
    cut: ZoneFormula | None = Field(None, description="which particles of the shape are left out, such as a notch")
    volume: PlaceFormula | None = Field(None, description="volumes [m^dim] instead of those of the shape")
    spacing: PlaceFormula | None = Field(None, description="spacings [m]; the dim-th root of the volume by default")
    surface: PlaceFormula | None = Field(
        None,
        description="outward area vectors [m^(dim-1)] of the particles, 0 inside; as the shape has them by default",
    )
    mirror: list[MirrorPlane] = Field([], description="planes behind which the body gets mirror ghosts")
    reference: choice(ReferencePolicy, optional=True) = Field("None", validate_default=True, description=OWN)  # type: ignore[valid-type]
    arrangement: choice(Arrangement, optional=True) = Field("None", validate_default=True, description=OWN)  # type: ignore[valid-type]
    scheme: choice(Scheme, optional=True) = Field("None", validate_default=True, description=OWN)  # type: ignore[valid-type]
    weight: choice(Weight, optional=True) = Field("None", validate_default=True, description=OWN)  # type: ignore[valid-type]
    dilation: Number | None = Field(None, gt=0.0, description=OWN)
    bonded: str | None = Field(None, description="a body above that it is bonded to, as one solid of two materials")

    @property
    def dim(self) -> int:
        """Dimension, by the first point of the shape; meshes are in 3-D."""
        return dimension(self.shape)

    def build(self, name: str) -> Body:
        """The body, without ghosts."""
        x, volume, *given = particles(self.shape, f"body.{name}.shape")
        surface = given[0] if given else None
        if self.cut is not None:
            if surface is not None:
                raise ValueError(
                    f"body.{name}.cut: a shape with area vectors, {self.shape.kind}, would have none on the cut; "
                    "take another shape, such as box"
                )
            kept = ~self.cut.at(x)[:, 0].astype(bool)
            if not kept.any():
                raise ValueError(f"body.{name}.cut: leaves nothing of {len(x)} particles")
            x, volume = x[kept], np.broadcast_to(volume, len(x))[kept]
        return Body(
            x=x,
            volume=volume if self.volume is None else self.volume.at(x)[:, 0],
            spacing=None if self.spacing is None else self.spacing.at(x)[:, 0],
            material=self.material.make(),
            velocity=np.broadcast_to(self.velocity.at(x), x.shape),  # one part is for all components
            surface=surface if self.surface is None else np.broadcast_to(self.surface.at(x), x.shape),
            name=name,
            reference=self.reference.make(),
            arrangement=self.arrangement.make(),
            scheme=self.scheme.make(),
            weight=self.weight.make(),
            dilation=self.dilation,
            bonded=self.bonded,
        )


class SolidsOutput(OutputTable):
    """What a run of solids writes, and when."""

    held = FIELDS

    fields: list[str] | None = Field(
        None,
        description=f"fields of a snapshot, of {', '.join(FIELDS)}; by default {', '.join(DEFAULT_FIELDS)}",
    )
    body: str | None = Field(None, description="body whose particles are in the snapshots, any by default")


class Case(Problem):
    """A problem of solids; SI units throughout, plane strain in 2-D and uniaxial strain in 1-D.

    Numbers may be formulas of ``parameters``; regions, velocities and loads may be formulas of place and time.
    """

    body: dict[str, BodyTable] = Field(min_length=1, description="bodies by name")
    boundary: list[open_choice(Boundary)] = Field([], description="conditions, imposed in this order")  # type: ignore
    rigid: dict[str, table_of(RigidBody, sole=True, without=("name",))] = Field(  # type: ignore[valid-type]
        {}, description="rigid bodies by name"
    )
    contact: list[one_of(Contact)] = Field([], description="bodies that touch; empty [[contact]]: all with all")  # type: ignore
    interaction: list[open_choice(Interaction)] = Field([], description="other forces between bodies")  # type: ignore
    reference: choice(ReferencePolicy) = Field("Always", validate_default=True)  # type: ignore[valid-type]
    arrangement: choice(Arrangement) = Field("Convected", validate_default=True)  # type: ignore[valid-type]
    scheme: choice(Scheme, optional=True) = Field("None", validate_default=True, description=SUITED)  # type: ignore
    weight: choice(Weight, optional=True) = Field("None", validate_default=True, description=SUITED)  # type: ignore
    dilation: Number | None = Field(None, gt=0.0, description=f"smoothing length over spacing; {SUITED}")
    time_step: choice(TimeStep) = Field("TimeStep", validate_default=True)  # type: ignore[valid-type]
    settle: Number | None = Field(
        None, gt=0.0, description="end when in equilibrium to this residual; needs the condition Damping"
    )
    independent: bool = Field(False, description="every body is a run with clock, ledger and end of its own")
    sort: bool = Field(True, description="keep particles sorted in memory; false is for comparisons")
    output: SolidsOutput = Field({}, validate_default=True)  # type: ignore[arg-type]
    probe: list[choice(Probe)] = Field([], description="what goes to tables of its own; boundary counts from 0")  # type: ignore

    @property
    def dim(self) -> int:
        """Dimension of the first body."""
        return next(iter(self.body.values())).dim

    def build(self) -> Simulation:
        """The simulation at its start; raises as ``Problem.build``."""
        space, ghosts = self.space, []
        defaults = Given(
            reference=self.reference.make(),
            arrangement=self.arrangement.make(),
            scheme=self.scheme.make(),
            weight=self.weight.make(),
            dilation=self.dilation,
        )
        bodies = checked_bodies([table.build(name) for name, table in self.body.items()])
        options = options_of_each(bodies, defaults)
        for k, table in enumerate(self.body.values()):
            for plane in table.mirror:
                depth, own = plane.depth, options[bodies[k].name]
                if depth is None:
                    depth = 3.0 * own.weight.support * own.dilation * float(bodies[k].spacing.max())
                bodies[k], condition = mirror(
                    bodies[k], point=plane.point, normal=plane.normal, depth=depth, image=plane.image.make()
                )
                ghosts.append(condition)
        conditions: Sequence[Boundary] = [condition.make(space) for condition in self.boundary]
        rigid = [RigidBody(**table.arguments(space), name=name) for name, table in self.rigid.items()]
        return Simulation(
            bodies,
            boundaries=[*conditions, *ghosts],
            interactions=[*rigid, *[table.make(space) for table in [*self.contact, *self.interaction]]],
            time_step=self.time_step.make(),
            **defaults._asdict(),
            periodic=self.periodic,
            dtype=PRECISIONS[self.precision],
            device=self.device,
            independent=self.independent,
            sort=self.sort,
        )

    def particular(self, simulation: Simulation) -> dict[str, Any]:
        """The body whose particles snapshots hold, probes, and when the run is at rest."""
        probes = []
        for table in self.probe:
            arguments = table.arguments()
            if "boundary" in arguments:
                arguments["boundary"] = simulation.boundaries[arguments["boundary"]]
            probes.append(table.target(**arguments))
        return {"body": self.output.body, "probes": probes, "settle": self.settle}

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
            of = getattr(table, "rigid", None)
            if of is not None and of not in self.rigid:
                wrong.append(
                    f"{path}.rigid: unknown rigid body {of!r}{nearest(of, self.rigid)}; they are {sorted(self.rigid)}"
                )
        touched = [(f"rigid.{name}.bodies", of) for name, table in self.rigid.items() for of in table.bodies or ()]
        for k, contact in enumerate(self.contact):
            touched += [(f"contact.{k}.between", of) for two in contact.between or () for of in two]
        for path, of in touched:
            if of not in self.body:
                wrong.append(f"{path}: unknown body {of!r}{nearest(of, self.body)}; bodies are {sorted(self.body)}")
        names = [table.name for _, table in probes]
        wrong += [f"probe.{k}.name: is taken by another, got {n!r}" for k, n in enumerate(names) if n in names[:k]]
        if wrong:
            raise ValueError("\n".join(wrong))
        return self

    def _formulas(self) -> list[tuple[str, Formula]]:
        """Path and value of every formula of place."""
        tables: dict[str, Table] = {f"body.{name}": body for name, body in self.body.items()}
        tables |= {f"boundary.{k}": condition for k, condition in enumerate(self.boundary)} | {"output": self.output}
        tables |= {f"rigid.{name}.motion": table.motion for name, table in self.rigid.items()}
        pairs = ((f"{path}.{name}", value) for path, table in tables.items() for name, value in table)
        return [(path, value) for path, value in pairs if isinstance(value, Formula)]
