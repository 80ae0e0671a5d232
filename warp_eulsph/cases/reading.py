"""Case files read: TOML, overrides, and every mistake of a file named at once."""

import copy
import keyword
import tomllib
import unicodedata
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from .case import Case
from .expressions import COORDINATES, FUNCTIONS, Expression, nearest, parse
from .transport import TransportCase
from .values import Reading, number

# What stands at the top of a case file: an override of one word that is not among these may be a parameter's
ENTRIES = {*Case.model_fields, *TransportCase.model_fields}


class CaseError(ValueError):
    """A case that cannot be read.

    Attributes:
        problems: one line each, path first.
    """

    def __init__(self, source: str, problems: Sequence[str]):
        self.problems = list(problems)
        super().__init__("\n".join([f"{source}: {len(self.problems)} problem{'s' * (len(problems) > 1)}", *problems]))


def read_case(path: str | PathLike, overrides: Sequence[str] = (), *, trust: bool = False) -> Case | TransportCase:
    """The case of a TOML file: of solids, or of a transported quantity where it has a table ``transport``.

    Args:
        path: the file; paths in it start from its directory.
        overrides: ``key.path=value`` strings that replace or add entries, values written as in TOML (or bare text):
            ``reference=Never``, ``boundary.0.region=y < 0.2``, ``parameters.n=16`` or in short ``n=16``.
        trust: materials and conditions may be classes of the user's own, ``kind = "module:Class"``, whose modules are
            run; otherwise nothing that a file says can run code.

    Raises:
        CaseError: no such file, not TOML, or any entry that is wrong; it names all of them.
    """
    source = str(path)
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise CaseError(source, [f"cannot be read: {error}"]) from None
    data = _load(text, source)
    problems = [problem for override in overrides if (problem := _override(data, override))]
    if problems:
        raise CaseError(source, problems)
    return parse_case(data, directory=Path(path).parent, source=source, trust=trust)


def parse_case(
    data: dict[str, Any], *, directory: str | PathLike = ".", source: str = "case", trust: bool = False
) -> Case | TransportCase:
    """The case of a table such as TOML gives, or ``describe`` of a case.

    Args:
        data: the table; it is left as it is.
        directory: where paths in it start from.
        source: named in errors.
        trust: see ``read_case``.

    Raises:
        CaseError: entries that are wrong; it names all of them.
    """
    data = copy.deepcopy(data)
    parameters, problems = _parameters(data.get("parameters"))
    definitions, wrong = _definitions(data.get("definitions"), parameters)
    problems += wrong
    context = Reading(parameters, definitions, Path(directory), trust)
    if isinstance(data.get("parameters"), dict):
        data["parameters"] = dict(parameters)
    try:
        case = (TransportCase if "transport" in data else Case).model_validate(data, context=context)
    except ValidationError as error:
        problems += _explained(error, data, context)
    if problems:
        raise CaseError(source, problems)
    case._programs = tuple(dict.fromkeys(context.programs))
    return case


def json_schema() -> dict[str, Any]:
    """The schema of case files as JSON Schema, for editors."""
    schema = TypeAdapter(Case | TransportCase).json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _load(text: str, source: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise CaseError(source, [f"not TOML: {error}"]) from None
    except (ValueError, RecursionError) as error:  # numbers of thousands of digits, thousands of brackets
        raise CaseError(source, [f"not TOML: {type(error).__name__}: {error}"]) from None


def _override(data: dict[str, Any], override: str) -> str | None:
    """Write one override into the data; what is wrong with it otherwise."""
    path, equals, text = override.partition("=")
    keys = [key.strip() for key in path.split(".")]
    if not equals or not all(keys):
        return f"override {override!r}: must be key.path=value, as in parameters.n=16"
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        value = text.strip()
    parameters = data.get("parameters")
    if len(keys) == 1 and isinstance(parameters, dict) and keys[0] in parameters and keys[0] not in ENTRIES:
        keys.insert(0, "parameters")
    place: Any = data
    for depth, key in enumerate(keys):
        if isinstance(place, list):
            if not (key.isdecimal() and int(key) < len(place)):
                return f"override {override!r}: {key!r} must be one of the {len(place)} entries of the list, from 0"
            key = int(key)  # type: ignore[assignment]
        elif not isinstance(place, dict):
            return f"override {override!r}: {'.'.join(keys[:depth])} is {place!r} and has no {key!r}; replace it whole"
        if depth == len(keys) - 1:
            place[key] = value
        else:
            place = place.setdefault(key, {}) if isinstance(place, dict) else place[key]  # type: ignore[call-overload]
    return None


def _parameters(given: Any) -> tuple[dict[str, float], list[str]]:
    """The parameters that make sense, in their order, and what is wrong with the others."""
    parameters: dict[str, float] = {}
    problems: list[str] = []
    for name, value in given.items() if isinstance(given, dict) else ():
        path = f"parameters.{name}"
        if not _can_be_named(name):
            problems.append(f"{path}: {_misnamed(name)}")
        elif isinstance(value, str):
            try:
                parameters[name] = number(value, parameters)
            except ValueError as error:
                problems.append(f"{path}: {error}")
        elif isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < 1e300:
            problems.append(f"{path}: must be a finite number or a formula of the parameters above it, got {value!r}")
        else:
            parameters[name] = float(value)
        if name.isidentifier() and name not in COORDINATES:
            parameters.setdefault(name, 1.0)  # so that formulas with a wrong one are not wrong too
    return parameters, problems


def _definitions(given: Any, parameters: dict[str, float]) -> tuple[dict[str, Expression], list[str]]:
    """The definitions that make sense, in their order, and what is wrong with the others."""
    definitions: dict[str, Expression] = {}
    problems: list[str] = []
    for name, value in given.items() if isinstance(given, dict) else ():
        path = f"definitions.{name}"
        try:
            if not _can_be_named(name):
                raise ValueError(_misnamed(name))
            if name in parameters:
                raise ValueError("is the name of a parameter, too")
            if not isinstance(value, str):
                raise ValueError(f"must be a formula as text, got {value!r}; numbers are parameters")
            definitions[name] = parse(value, [*COORDINATES, "t", *parameters], definitions=definitions)
        except ValueError as error:
            problems.append(f"{path}: {error}")
            definitions.setdefault(name, parse("1", []))  # so that formulas with a wrong one are not wrong too
    return definitions, problems


_NAMES = "must be named by letters, digits and _, and not like a coordinate or function"


def _misnamed(name: str) -> str:
    plain = unicodedata.normalize("NFKC", name)
    return _NAMES if plain == name else f"{_NAMES}; its letters mean {plain!r}, write that"


def _can_be_named(name: str) -> bool:
    return (
        unicodedata.normalize("NFKC", name) == name  # as formulas are read: other letters would mean these
        and name.isidentifier()
        and not keyword.iskeyword(name)
        and name not in (*COORDINATES, "t", "pi", *FUNCTIONS)
    )


def _explained(error: ValidationError, data: Any, context: Reading) -> list[str]:
    """One line per mistake: where in the file, and what."""
    lines: list[str] = []
    for item in error.errors(include_url=False):
        path, table = _place(item["loc"], data, item["type"])
        text = _message(item, table, data, context)
        lines += [f"{path}: {text}"] if path else text.splitlines()
    return lines


def _place(location: tuple[Any, ...], data: Any, kind: str) -> tuple[str, Any]:
    """Path in the file and the table that holds its last key; pydantic's own names of alternatives are left out."""
    parts: list[str] = []
    here: Any = data
    table: Any = data
    for k, key in enumerate(location):
        inside = (isinstance(here, dict) and key in here) or (
            isinstance(here, list) and isinstance(key, int) and key < len(here)
        )
        if inside:
            table, here = here, here[key]
            parts.append(str(key))
        elif kind == "missing" and k == len(location) - 1:
            table = here
            parts.append(str(key))
    return ".".join(parts), table


def _message(item: Any, table: Any, data: Any, context: Reading) -> str:
    kind, given, extra = item["type"], item.get("input"), item.get("ctx", {})
    name = item["loc"][-1] if item["loc"] else ""
    if kind == "extra_forbidden":
        known = context.keys.get(id(table), [])
        if len(item["loc"]) > 1 and name in context.keys.get(id(data), []):
            return f"unknown key; it is one of the case: write it above the first [table]; known here are {known}"
        return f"unknown key{nearest(name, known)}; known are {known}"
    if kind == "missing":
        return "is missing"
    if kind == "union_tag_invalid":
        known = _listed(extra["expected_tags"])
        return f"unknown kind {extra['tag']!r}{nearest(extra['tag'], known)}; known are {known}"
    if kind == "union_tag_not_found":
        return f"must be a table with a kind, or the name of one, got {_short(given)}"
    if kind == "value_error":
        return str(extra["error"])
    return f"{item['msg'][0].lower()}{item['msg'][1:]}, got {_short(given)}"


def _listed(tags: str) -> list[str]:
    """The names in pydantic's list of tags."""
    return [tag.strip(" '") for tag in tags.split(",")]


def _short(given: Any) -> str:
    shown = repr(given)
    return shown if len(shown) <= 60 else f"{shown[:57]}..."
