"""What users give, checked: arrays of numbers, numbers, and objects of the right kind."""

import math
import numbers
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np


def real_array(given: Any, who: str, dtype: Any = float, *, finite: bool = True) -> np.ndarray:
    """``given`` as an array of real numbers, not a copy where it is one already.

    Args:
        given: numbers in any nesting; integers count, truth values, complex, masked and other entries do not.
        who: begins the message: ``body 'plate': velocity``.
        dtype: of the array.
        finite: refuse infinite numbers and not-a-number.

    Raises:
        ValueError: anything else, named.
    """
    if isinstance(given, np.ma.MaskedArray):
        raise ValueError(f"{who} must not be a masked array, whose masked entries would count; use filled(...)")
    for unit in ("units", "unit"):
        if hasattr(given, unit):
            raise ValueError(f"{who} must be plain numbers in SI units, got a {type(given).__name__} with units")
    try:
        array = np.asarray(given)
    except ValueError:
        raise ValueError(f"{who} must be rows of equal length, got {short(given)}") from None
    if array.dtype.kind not in "iuf":
        kind = {"c": "complex numbers", "b": "truth values", "O": "objects"}.get(array.dtype.kind, f"{array.dtype}")
        raise ValueError(f"{who} must be real numbers, got {kind}: {short(given)}")
    with np.errstate(over="ignore"):
        array = array.astype(dtype, copy=False)
    if finite and not np.isfinite(array).all():
        wrong = np.argwhere(~np.isfinite(array))
        where = f" at {wrong[0].tolist()} ({len(wrong)} such values)" if array.ndim else ""
        raise ValueError(f"{who} must be finite, got {array[tuple(wrong[0])]}{where}")
    return array


def spread(values: np.ndarray, shape: tuple[int, ...], who: str) -> np.ndarray:
    """Numbers for all, (), for all rows, shape[1:], or one each, ``shape``, as an array of ``shape``; a view.

    Nothing else is spread: a column (n, 1) for vectors is more often a mistake than meant.

    Raises:
        ValueError: another shape.
    """
    allowed: list[tuple[int, ...]] = list(dict.fromkeys([(), shape[1:], shape]))
    if values.shape not in allowed:
        hint = ""
        if len(shape) == 2 and values.shape == (shape[0], 1):
            hint = f"; for the same in all components repeat the column {shape[1]} times"
        elif values.ndim == len(shape) + 1 and values.shape[-1] == 1 and values.shape[:-1] == shape:
            hint = "; take its column [:, 0]"
        if len(allowed) == 2:
            raise ValueError(f"{who} must be a number or have shape {shape}, got {values.shape}{hint}")
        raise ValueError(f"{who} must be a number, {shape[1:]} or {shape}, got shape {values.shape}{hint}")
    return np.broadcast_to(values, shape)


def instance(given: Any, kinds: type | tuple[type, ...], who: str, example: str) -> Any:
    """``given`` if it is of one of these ``kinds``.

    Raises:
        ValueError: it is not; the message has the ``example``.
    """
    if isinstance(given, kinds):
        return given
    if isinstance(given, type):
        raise ValueError(f"{who} must be an object such as {example}, got the class; write {given.__name__}(...)")
    raise ValueError(f"{who} must be such as {example}, got {type(given).__name__} {short(given)}")


def objects(given: Any, kind: type, who: str, example: str) -> list[Any]:
    """``given``, one object of a ``kind`` or several, as a list.

    Raises:
        ValueError: there is something else among them.
    """
    if isinstance(given, kind):
        return [given]
    if isinstance(given, str | bytes | type | Mapping) or not isinstance(given, Iterable):
        raise ValueError(f"{who} must be a list such as [{example}], got {short(given)}")
    return [instance(one, kind, f"{who}[{k}]", example) for k, one in enumerate(given)]


def whole_number(given: Any, least: int, who: str) -> int:
    """``given`` as an integer of at least ``least``.

    Raises:
        ValueError: it is none.
    """
    if isinstance(given, bool | np.bool_) or not isinstance(given, numbers.Integral) or given < least:
        raise ValueError(f"{who} must be a whole number, at least {least}, got {given!r}")
    return int(given)


def real_number(given: Any, who: str) -> float:
    """``given`` as a number, which may be infinite.

    Raises:
        ValueError: it is none.
    """
    if isinstance(given, bool | np.bool_) or not isinstance(given, numbers.Real) or math.isnan(given):
        raise ValueError(f"{who} must be a number, got {given!r}")
    return float(given)


def positive(given: Any, who: str, remedy: str) -> float:
    """``given`` as a number above 0 and finite.

    Raises:
        ValueError: it is none; the message has the ``remedy``.
    """
    if not (math.isfinite(real_number(given, who)) and given > 0.0):
        raise ValueError(f"{who} must be positive and finite, got {given}; {remedy}")
    return float(given)


def checked_box(periodic: Sequence[float] | None, dim: int) -> tuple[float, ...]:
    """Lengths of the periodic box [m], 0 where it is open.

    Raises:
        ValueError: not ``dim`` lengths.
    """
    if periodic is None:
        return (0.0,) * dim
    box = real_array(periodic, "periodic")
    if box.shape != (dim,) or (box < 0.0).any():
        raise ValueError(f"periodic must be {dim} lengths [m], 0 where the box is open, got {periodic}")
    return tuple(box.tolist())


def check_restorable(simulation: Any, arrays: Mapping[str, np.ndarray], counters: Mapping[str, float]) -> None:
    """ValueError unless names and shapes are those of ``evolving`` and ``counters`` of this ``simulation``."""
    shapes = {name: array.numpy().shape for name, array in simulation.evolving().items()}
    given = {name: array.shape for name, array in arrays.items()}
    wrong = sorted(name for name in shapes.keys() | given.keys() if shapes.get(name) != given.get(name))
    if wrong or counters.keys() != simulation.counters.keys():
        raise ValueError(
            f"restore: arrays must have names and shapes of this simulation, {wrong[0] if wrong else 'counters'} "
            f"differs: {given.get(wrong[0]) if wrong else set(counters)}; build the simulation as it was"
        )


def short(given: Any) -> str:
    shown = repr(given)
    return shown if len(shown) <= 60 else f"{shown[:57]}..."
