"""Which number of a frame a picture is coloured by."""

from dataclasses import dataclass

import numpy as np

from ..output.derived import DERIVED
from ..output.reader import RunFrame

AXES = "xyz"


@dataclass(frozen=True)
class Quantity:
    """A scalar at each particle.

    Attributes:
        label: name and unit.
        values: (n,).
        exact: those that it should have, (n,); None where the frame does not hold them.
    """

    label: str
    values: np.ndarray
    exact: np.ndarray | None = None

    @property
    def range(self) -> tuple[float, float]:
        """Least and largest value, those that it should have among them."""
        both = self.values if self.exact is None else np.concatenate([self.values, self.exact])
        return float(both.min()), float(both.max())


def default_field(frame: RunFrame) -> str:
    """The field of a frame that a picture shows unless it is told: velocity, a transported value, or the first one."""
    held = [name for name in frame.units if name != "x"]
    return next((name for name in ("velocity", "value") if name in held), held[0] if held else "x")


def quantity(frame: RunFrame, name: str) -> Quantity:
    """A scalar of a frame by its name.

    Args:
        frame: of a run.
        name: of a field that the frame has or derives, such as ``J`` or ``von_mises``; a vector or tensor gives its
            length, in 1-D a vector itself; ``velocity.x``, ``cauchy_stress.xy``, ``principal_stresses.z`` give a
            component.

    Raises:
        ValueError: no such field or component in the frame.
    """
    field, _, component = name.partition(".")
    units = {**DERIVED, **frame.units}
    try:
        values = np.asarray(frame.field(field), dtype=float)
    except KeyError:
        raise ValueError(
            f"a picture must be coloured by one of {[*frame.units, *DERIVED]}, derived ones only where the snapshots "
            f"hold stress or deformation gradient, or by a component such as velocity.x; got {name!r}"
        ) from None
    rank = values.ndim - 1
    if component:
        index = tuple(AXES.find(letter) for letter in component)
        if len(index) != rank or any(not 0 <= i < size for i, size in zip(index, values.shape[1:], strict=True)):
            example = f"components such as {field}.{'x' * rank}" if rank else "no components"
            raise ValueError(f"{field} has {example}, got {name!r}")
        values = values.reshape(len(values), -1)[:, np.ravel_multi_index(index, values.shape[1:])]
    elif values.shape[1:] == (1,):  # along a line a vector is a number with a sign
        values = values[:, 0]
    elif rank:
        values = np.sqrt(np.square(values).reshape(len(values), -1).sum(axis=1))
    shown = "von Mises stress" if field == "von_mises" else field.replace("_", " ")
    shown = f"|{shown}|" if rank and not component and frame.x.shape[1] > 1 else f"{shown} {component}".strip()
    exact = np.asarray(frame["exact"], dtype=float) if name == "value" and "exact" in units else None
    return Quantity(f"{shown} [{units[field]}]", values, exact)
