"""The case of a transported quantity: particles that stay where they are, and a value that is carried over them."""

from functools import partial
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from ..output import TRANSPORT_FIELDS
from ..scheme.scalar import ConservationLaw, LinearAdvection, ScalarScheme
from ..transport import Transport
from ..weights import Weight
from .expressions import COORDINATES
from .options import Table, Zone, choice, made, one_of
from .problem import PRECISIONS, OutputTable, Problem
from .shapes import SHAPES, dimension, particles
from .values import Formula, Number, PlaceFormula, PlaceTimeFormula


class TransportTable(Table):
    """Linear advection, u_t + a·∇u = 0, on a shape filled with particles."""

    shape: one_of(*SHAPES) = Field(description="a function of warp_eulsph.geometry")  # type: ignore[valid-type]
    velocity: list[Number] = Field(description="a [m/s], (dim,)")
    initial: PlaceFormula = Field(description="u at the start")
    exact: PlaceTimeFormula | None = Field(None, description="u at any time, to be stored and compared")
    held: Zone | None = Field(  # type: ignore[valid-type]
        None, description="particles that keep their initial value, such as an inflow"
    )


class TransportOutput(OutputTable):
    """What a run of a transported quantity writes, and when."""

    held = TRANSPORT_FIELDS

    fields: list[str] | None = Field(
        None, description=f"fields of a snapshot, all by default: {', '.join(TRANSPORT_FIELDS)}"
    )


class TransportCase(Problem):
    """A quantity carried along at a constant velocity; SI units throughout.

    Numbers may be formulas of ``parameters``; initial values may be formulas of place, exact ones of time too.
    """

    transport: TransportTable
    weight: choice(Weight) = Field("CubicSpline", validate_default=True)  # type: ignore[valid-type]
    dilation: Number = Field(1.3, gt=0.0, description="smoothing length over spacing")
    scheme: choice(ScalarScheme) = Field("TwoStepLaxWendroff", validate_default=True)  # type: ignore[valid-type]
    output: TransportOutput = Field({}, validate_default=True)  # type: ignore[arg-type]
    time_step: Number = Field(gt=0.0, description="length of the steps [s]; CFL number = velocity time_step/spacing")

    @property
    def dim(self) -> int:
        """Dimension of the shape."""
        return dimension(self.transport.shape)

    def build(self) -> Transport:
        """The quantity at its start; raises as ``Problem.build``."""
        table = self.transport
        x, volume, *_ = particles(table.shape, "transport.shape")
        law = ConservationLaw(
            x,
            volume,
            table.initial.at(x)[:, 0],
            flux=LinearAdvection(tuple(table.velocity)),
            scheme=self.scheme.make(),
            weight=self.weight.make(),
            dilation=self.dilation,
            periodic=self.periodic,
            held=made(table.held, self.space, "region"),
            dtype=PRECISIONS[self.precision],
            device=self.device,
        )
        return Transport(law, self.time_step, None if table.exact is None else partial(_exact, table.exact))

    @model_validator(mode="after")
    def _agree(self) -> "TransportCase":
        """Dimensions and fields."""
        wrong = []
        table, dim = self.transport, self.dim
        if len(table.velocity) != dim:
            wrong.append(f"transport.velocity: must have {dim} components, got {len(table.velocity)}")
        formulas: list[tuple[str, Any]] = [(name, getattr(table, name)) for name in ("initial", "exact", "held")]
        for name, value in formulas:
            if not isinstance(value, Formula):
                continue
            if beyond := value.names & set(COORDINATES[dim:]):
                wrong.append(f"transport.{name}: {sorted(beyond)} are not coordinates in {dim}-D")
            if len(value.parts) != 1:
                wrong.append(f"transport.{name}: must have 1 component, got {len(value.parts)}")
        if table.exact is None and "exact" in (self.output.fields or []):
            wrong.append("output.fields: 'exact' needs the exact solution; give transport.exact")
        if self.periodic is not None and len(self.periodic) != dim:
            wrong.append(f"periodic: must have {dim} lengths, got {len(self.periodic)}")
        if wrong:
            raise ValueError("\n".join(wrong))
        return self


def _exact(formula: Formula, x: np.ndarray, t: float) -> np.ndarray:
    """Values of the formula, (n,)."""
    return formula.at(x, t)[:, 0]
