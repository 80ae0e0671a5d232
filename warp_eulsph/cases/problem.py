"""What case files of solids and of transported quantities share: numbers, precision, output."""

from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
import warp as wp
from pydantic import Field, PrivateAttr, field_validator

from ..output import Recording
from ..output.fields import SnapshotField
from ..output.recorded import Recorded
from ..schedule import AnyOf, AtTimes, EverySteps, EveryTime, Schedule
from ..space import Space
from .expressions import nearest
from .options import Table, Zone, choice, made
from .values import Number, Whole

PRECISIONS = {"double": wp.float64, "single": wp.float32}
Precision = Literal["double", "single"]


class OutputTable(Table):
    """What a run writes, and when.

    Attributes:
        held: fields that its snapshots can hold, by name.
    """

    held: ClassVar[dict[str, SnapshotField]]

    fields: list[str] | None
    every: Number | None = Field(None, gt=0.0, description="time between snapshots [s]")
    steps: Whole | None = Field(None, gt=0, description="steps between snapshots")
    at: list[Number] = Field([], description="more times [s] of snapshots")
    exact: bool = Field(True, description="shorten steps to end at these times; else the steps that reach them count")
    precision: Precision = Field("single", description="of the stored numbers")
    region: Zone | None = Field(  # type: ignore[valid-type]
        None, description="particles in the snapshots, by initial positions; all by default"
    )
    log: choice(Schedule) = Field({"kind": "EverySteps", "count": 16}, validate_default=True)  # type: ignore[valid-type]
    checkpoint: Number = Field(600.0, gt=0.0, description="wall time between checkpoints [s]")

    @field_validator("fields")
    @classmethod
    def _known(cls, fields: list[str] | None) -> list[str] | None:
        for name in fields or []:
            if name not in cls.held:
                raise ValueError(f"unknown field {name!r}{nearest(name, cls.held)}; known are {list(cls.held)}")
        return fields

    @field_validator("at")
    @classmethod
    def _in_order(cls, at: list[float]) -> list[float]:
        return list(AtTimes(at).times)

    @property
    def snapshots(self) -> Schedule:
        """When snapshots are written."""
        schedules: list[Schedule] = [AtTimes(self.at, self.exact)]
        schedules += [EveryTime(self.every, exact=self.exact)] if self.every is not None else []
        schedules += [EverySteps(self.steps)] if self.steps is not None else []
        return AnyOf(schedules)


class Problem(Table):
    """A whole problem; SI units throughout."""

    title: str = Field("", description="what is solved, in one line")
    until: Number = Field(gt=0.0, description="end time [s]")
    parameters: dict[str, Number] = Field({}, description="numbers that formulas may use by name, or formulas of those")
    definitions: dict[str, str] = Field({}, description="formulas of place and time that others may use by name")
    periodic: list[Number] | None = Field(None, description="lengths [m] of a periodic box at the origin; 0 is open")
    precision: Precision = Field("double", description="of the simulation")
    device: str | None = Field(None, description="Warp device such as cuda:0; Warp's default otherwise")
    output: OutputTable
    _programs: tuple[Path, ...] = PrivateAttr(default=())

    @property
    def programs(self) -> tuple[Path, ...]:
        """Files beside the case file with materials and conditions that it names."""
        return self._programs

    @property
    def dim(self) -> int:
        """Dimension."""
        raise NotImplementedError

    @property
    def space(self) -> Space:
        """Dimension and precision."""
        return Space(self.dim, PRECISIONS[self.precision], self.periodic is not None)

    def build(self) -> Recorded:
        """What is run, at its start.

        Raises:
            ValueError: particles or regions that do not fit together.
            ModuleNotFoundError: a mesh without meshio.
            OSError: a mesh file that is not there.
        """
        raise NotImplementedError

    def recording(self, simulation: Recorded) -> Recording:
        """What a run of it keeps.

        Raises:
            ValueError: probes of equal names.
        """
        output = self.output
        return Recording(
            snapshots=output.snapshots,
            fields=output.fields,
            dtype=np.float64 if output.precision == "double" else np.float32,
            region=made(output.region, self.space, "region"),
            log=output.log.make(),
            checkpoint=output.checkpoint,
            **self.particular(simulation),
        )

    def particular(self, simulation: Any) -> dict[str, Any]:
        """Options of the recording that only problems of this kind have, by name."""
        return {}

    def describe(self) -> dict[str, Any]:
        """The full case with its defaults, formulas of parameters worked out; JSON and TOML can hold it.

        ``parse_case`` of it gives the same case.
        """
        return self.model_dump(mode="json", exclude_none=True)
