"""Which number of a snapshot a picture is coloured by."""

from dataclasses import dataclass

import numpy as np

from ..output import FIELDS, Snapshot

AXES = "xyz"


@dataclass(frozen=True)
class Quantity:
    """A scalar at each particle.

    Attributes:
        label: name and unit.
        values: (n,).
    """

    label: str
    values: np.ndarray


def quantity(snapshot: Snapshot, name: str) -> Quantity:
    """A scalar of a snapshot by its name.

    Args:
        snapshot: the frame.
        name: of a field: a scalar, or a vector for its length; ``velocity.x``, ``cauchy_stress.xy`` for a component;
            ``von_mises`` for √(3/2 s:s) of the stress deviator s.

    Raises:
        ValueError: no such field or component in the snapshot.
    """
    field, _, component = name.partition(".")
    source = "cauchy_stress" if field == "von_mises" else field
    if source not in snapshot.fields:
        known = [*snapshot.fields, *(["von_mises"] if "cauchy_stress" in snapshot.fields else [])]
        raise ValueError(
            f"a picture must be coloured by one of {known}, or a component such as velocity.x, got {name!r}"
        )
    values = snapshot.fields[source].astype(float)
    unit = snapshot.units.get(source) or FIELDS[source].unit
    rank = values.ndim - 1
    if field == "von_mises":
        deviator = values - np.trace(values.T)[:, None, None] / 3.0 * np.eye(3)
        values = np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))
    elif component:
        index = tuple(AXES.find(letter) for letter in component)
        if len(index) != rank or any(not 0 <= i < size for i, size in zip(index, values.shape[1:], strict=True)):
            example = field + "." + "x" * rank if rank else field
            raise ValueError(
                f"{field} has {'no components' if not rank else f'components such as {example}'}, got {name!r}"
            )
        values = values.reshape(len(values), -1)[:, np.ravel_multi_index(index, values.shape[1:])]
    elif rank:
        values = np.sqrt(np.square(values).reshape(len(values), -1).sum(axis=1))
        field = f"|{field}|"
    shown = (
        "von Mises stress" if field == "von_mises" else field.replace("_", " ") + (f" {component}" if component else "")
    )
    return Quantity(f"{shown} [{unit}]", values)
