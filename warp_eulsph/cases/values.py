"""Values of case files: numbers that may be formulas of the parameters, formulas of place and time, paths."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, PlainSerializer, PlainValidator, ValidationInfo, WithJsonSchema

from .expressions import COORDINATES, Expression, device_function, parse


@dataclass
class Reading:
    """What validators know of the file that is read; pydantic's context.

    Attributes:
        parameters: numbers by name that formulas may use.
        definitions: formulas of place and time by name that formulas may use.
        directory: of the case file, which paths start from.
        trust: whether modules that the file names may be run.
        programs: files of those that lie beside the case file, noted as they are run.
        keys: id of a table as it was read -> the keys that it may have, noted for messages.
    """

    parameters: dict[str, float] = field(default_factory=dict)
    definitions: dict[str, Expression] = field(default_factory=dict)
    directory: Path = Path(".")
    trust: bool = False
    programs: list[Path] = field(default_factory=list)
    keys: dict[int, list[str]] = field(default_factory=dict)


def reading(info: ValidationInfo) -> Reading:
    """The context of a validator; an empty one outside ``parse_case``."""
    return info.context if isinstance(info.context, Reading) else Reading()


def number(text: str, parameters: dict[str, float]) -> float:
    """Value of a formula of the parameters.

    Raises:
        ValueError: not a formula, unknown names, or not finite.
    """
    value = float(parse(text, list(parameters))(parameters))
    if not math.isfinite(value):
        raise ValueError(f"must be finite, got {value} from {text!r}")
    return value


def _number(given: Any, info: ValidationInfo) -> Any:
    return number(given, reading(info).parameters) if isinstance(given, str) else given


def _whole(given: Any, info: ValidationInfo) -> Any:
    value = _number(given, info)
    return int(value) if isinstance(given, str) and value == round(value) else value


NUMBER_SCHEMA = {"anyOf": [{"type": "number"}, {"type": "string", "description": "formula of the parameters"}]}
#: A number, or a formula of the parameters.
Number = Annotated[float, BeforeValidator(_number), WithJsonSchema(NUMBER_SCHEMA)]
#: A whole number, or such a formula.
Whole = Annotated[int, BeforeValidator(_whole), WithJsonSchema(NUMBER_SCHEMA)]


@dataclass(frozen=True)
class Formula:
    """Numbers and formulas of place, and of time where there is one: one for all components, or one each.

    Attributes:
        given: as written in the file.
        parts: one expression per component.
        parameters: numbers by name.
    """

    given: Any
    parts: tuple[Expression, ...]
    parameters: dict[str, float]

    @property
    def names(self) -> frozenset[str]:
        """Variables in it, those of the definitions it uses too."""
        return frozenset().union(*(part.names for part in self.parts))

    def at(self, X: np.ndarray, t: float = 0.0) -> np.ndarray:
        """Values at positions X [m], (n, dim), and time ``t`` [s]: (n, number of parts)."""
        places = dict(zip(COORDINATES, X.T, strict=False))
        values = [part({**self.parameters, **places, "t": t}) for part in self.parts]
        return np.stack([np.broadcast_to(value, len(X)) for value in values], axis=1)

    def condition(self, space: Any, *, always_function: bool = False) -> Any:
        """What a boundary condition takes: numbers, or a function on the device where place or time occurs."""
        if not always_function and not self.names & {*COORDINATES, "t"}:
            values = [float(part(self.parameters)) for part in self.parts]
            return values[0] if len(values) == 1 else values
        return device_function(self.parts, self.parameters, space)


def _formula(*variables: str, truth: bool = False) -> Callable[[Any, ValidationInfo], Formula]:
    def validate(given: Any, info: ValidationInfo) -> Formula:
        if isinstance(given, Formula):
            return given
        parameters, definitions = reading(info).parameters, reading(info).definitions
        names = [*variables, *parameters]
        if truth:
            if not isinstance(given, str):
                raise ValueError(f"must be a comparison such as 'y < 0.1', got {given!r}")
            return Formula(given, (parse(given, names, truth=True, definitions=definitions),), parameters)
        parts = given if isinstance(given, list) else [given]
        if len(parts) not in (1, 2, 3):
            raise ValueError(f"must have 1, 2 or 3 components, got {len(parts)}")
        for part in parts:
            if isinstance(part, bool) or not isinstance(part, (int, float, str)):
                raise ValueError(f"must be a number, a formula or a list of them, got {part!r}")
        texts = [part if isinstance(part, str) else repr(part) for part in parts]
        return Formula(given, tuple(parse(text, names, definitions=definitions) for text in texts), parameters)

    return validate


def _given(value: Any) -> Any:
    return value.given if isinstance(value, Formula) else value


_SCALAR = {"type": ["number", "string"]}
_VECTOR_SCHEMA = {"anyOf": [_SCALAR, {"type": "array", "items": _SCALAR, "minItems": 1, "maxItems": 3}]}
_SHOWN = PlainSerializer(_given)


def _kind(schema: dict, *variables: str, truth: bool = False) -> Any:
    names = ", ".join(variables)
    described = {**schema, "description": f"formula of {names} and the parameters" + (", per component" * (not truth))}
    return Annotated[Any, PlainValidator(_formula(*variables, truth=truth)), _SHOWN, WithJsonSchema(described)]


#: A value at each particle at the start.
PlaceFormula = _kind(_VECTOR_SCHEMA, *COORDINATES)
#: A value at each particle at any time.
PlaceTimeFormula = _kind(_VECTOR_SCHEMA, *COORDINATES, "t")
#: Which particles, by their initial positions.
ZoneFormula = _kind({"type": "string"}, *COORDINATES, truth=True)


def _path(given: Any, info: ValidationInfo) -> Any:
    return str((reading(info).directory / given).absolute()) if isinstance(given, str) else given


#: A file, relative to the case file.
PathText = Annotated[str, BeforeValidator(_path)]
