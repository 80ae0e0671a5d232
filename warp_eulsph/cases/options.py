"""Tables of case files made from the classes and functions of the package: what those take, a case file takes.

A material, boundary, scheme or shape is a table whose ``kind`` is the name of the class or function and whose other
keys are its arguments. Nothing is listed here but how a type of Python is written in TOML, so that a new material is in
case files by existing.
"""

import dataclasses
import functools
import importlib
import inspect
import pkgutil
import re
import types
import typing
from collections.abc import Callable, Sequence
from os import PathLike
from typing import Annotated, Any, ClassVar, Literal, Union

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    Tag,
    ValidationInfo,
    create_model,
    model_validator,
)
from pydantic_core import core_schema

from ..geometry import Patch
from ..programs import member
from .values import Formula, Number, PathText, PlaceTimeFormula, Reading, Whole, ZoneFormula, reading

# How a class of the user's own is named: its module and itself
OWN_KIND = r"[A-Za-z_]\w*(\.\w+)*:[A-Za-z_]\w*"


class Table(BaseModel):
    """A table of a case file: no unknown keys, no conversions, no infinities."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _note_keys(cls, given: Any, info: ValidationInfo) -> Any:
        if isinstance(given, dict):
            reading(info).keys[id(given)] = list(cls.model_fields)
        return given


class Options(Table):
    """A class or function and its arguments."""

    target: ClassVar[Callable[..., Any]]

    def make(self, space: Any = None) -> Any:
        """The object, or what the function returns; ``space`` is needed where formulas of place and time occur."""
        return self.target(**self.arguments(space))

    def arguments(self, space: Any = None) -> dict[str, Any]:
        """The arguments as the class or function takes them."""
        return {name: made(value, space, name) for name, value in self if name != "kind"}

    @model_validator(mode="after")
    def _check(self) -> "Options":
        """The class's own checks, which stand beside all others; formulas and conditions come later."""
        if isinstance(self.target, type) and not self._later():
            self.make()
        return self

    def _later(self) -> bool:
        """Whether it has formulas, or conditions, which come later, itself or in a table of it."""
        return any(
            name == "boundary" or isinstance(value, Formula) or (isinstance(value, Options) and value._later())
            for name, value in self
        )


def made(value: Any, space: Any, name: str) -> Any:
    """A value of a case file as the argument ``name`` takes it."""
    if isinstance(value, Options):
        return value.make(space)
    if isinstance(value, Formula):
        if name == "region":
            return lambda X: value.at(X)[:, 0].astype(bool)
        return value.condition(space, always_function=name == "displacement")
    return value


class Nothing(Options):
    """No such option: ``"None"``."""

    kind: Literal["None"] = "None"
    target = staticmethod(lambda: None)


@functools.cache
def table_of(
    target: Callable[..., Any], sole: bool = False, kind_name: str | None = None, without: tuple[str, ...] = ()
) -> type[Options]:
    """The table for a class or function; ``sole`` when nothing else can stand in its place, so that it needs no kind.

    ``kind_name`` is what the kind is if not the target's name; those of its arguments in ``without``, which have
    defaults, are left out.

    Raises:
        TypeError: an argument that cannot be written in TOML.
    """
    hints = typing.get_type_hints(target)
    described = descriptions(target)
    fields: dict[str, Any] = {}
    for parameter in _parameters(target):
        name, default = parameter.name, parameter.default
        if name in without:
            continue
        kind = _written(name, hints.get(name, Any))
        if default is inspect.Parameter.empty:
            fields[name] = (kind, Field(description=described.get(name)))
        else:
            given: Any = "None" if default is None and _may_be_nothing(kind) else _given(default)
            fields[name] = (kind, Field(given, validate_default=given is not None, description=described.get(name)))
    kind_name = kind_name or target.__name__
    fields = {"kind": (Literal[kind_name], kind_name if sole else ...), **fields}  # type: ignore[valid-type]
    name = f"{target.__name__}Table" if without else target.__name__
    model = create_model(name, __base__=Options, __doc__=_summary(target), **fields)
    model.target = target if isinstance(target, type) else staticmethod(target)
    return model


def _parameters(target: Callable[..., Any]) -> list[inspect.Parameter]:
    if isinstance(target, type) and not dataclasses.is_dataclass(target):
        return []  # a class without options, as weights are
    return list(inspect.signature(target).parameters.values())


def _given(default: Any) -> Any:
    """A default as a file would give it, or None where a file can only leave it out."""
    if default is None or isinstance(default, (bool, int, float, str)):
        return default
    if isinstance(default, tuple):
        return list(default)
    table: dict[str, Any] = {"kind": type(default).__name__}
    for parameter in _parameters(type(default)):
        value = getattr(default, parameter.name)
        if value != parameter.default:  # what is None here switches off what the class itself would have
            table[parameter.name] = "None" if value is None else _given(value)
    return table


def _may_be_nothing(kind: Any) -> bool:
    return any(isinstance(note, _Name) and "None" in note.names for note in getattr(kind, "__metadata__", ()))


def _written(name: str, hint: Any) -> Any:
    """How an argument is written in TOML."""
    if name == "region":
        return Zone | None
    if name in ("value", "displacement"):
        return PlaceTimeFormula
    if name == "boundary":
        return Whole  # which of the case's conditions, from 0
    members = typing.get_args(hint) if typing.get_origin(hint) in (Union, types.UnionType) else (hint,)
    if PathLike in members:
        return PathText
    optional = types.NoneType in members
    members = tuple(member for member in members if member is not types.NoneType)
    if all(_of_the_package(member) for member in members):
        return choice(*members, optional=optional)
    if len(members) == 1:
        return _plain(name, members[0]) | None if optional else _plain(name, members[0])
    raise TypeError(f"{name}: {hint} cannot be written in a case file")


def _of_the_package(hint: Any) -> bool:
    return isinstance(hint, type) and hint.__module__.startswith("warp_eulsph.")


def _plain(name: str, hint: Any) -> Any:
    """How a number, word or list of them is written."""
    plain = {float: Number, int: Whole, bool: bool, str: str}
    if hint in plain:
        return plain[hint]
    if typing.get_origin(hint) is typing.get_origin(Sequence[int]) and typing.get_args(hint)[0] in plain:
        return list[plain[typing.get_args(hint)[0]]]  # type: ignore[misc]
    if (
        typing.get_origin(hint) is typing.get_origin(Sequence[int])
        and typing.get_origin(typing.get_args(hint)[0]) is tuple
    ):
        members = typing.get_args(typing.get_args(hint)[0])
        if len(set(members)) == 1 and members[0] in plain:
            return list[Annotated[list[plain[members[0]]], Field(min_length=len(members), max_length=len(members))]]  # type: ignore
    raise TypeError(f"{name}: {hint} cannot be written in a case file")


@functools.cache
def choice(*bases: type, optional: bool = False) -> Any:
    """One of the concrete classes below ``bases``: a table with a kind, or the bare name where all has defaults."""
    targets = [target for base in bases for target in writable(base)]
    return one_of(*targets, optional=optional)


@functools.cache
def open_choice(base: type) -> Any:
    """One of the concrete classes below ``base``, or of the user's own, by ``kind = "module:Class"``."""
    return Annotated[choice(base), _Own(base)]  # type: ignore[arg-type]


@functools.cache
def one_of(*targets: Callable[..., Any], optional: bool = False) -> Any:
    """One of these classes or functions."""
    if len(targets) == 1 and not optional:
        return Annotated[table_of(targets[0], sole=True), _Name((targets[0].__name__,))]
    tables = [table_of(target, sole=len(targets) == 1) for target in targets] + ([Nothing] if optional else [])
    names = tuple(target.__name__ for target in targets) + (("None",) if optional else ())
    sole = targets[0].__name__ if len(targets) == 1 else None
    return Annotated[Union[tuple(tables)], Field(discriminator="kind"), _Name(names, sole)]  # noqa: UP007


@dataclasses.dataclass(frozen=True)
class _Name:
    """Lets a bare name stand for a table with that kind; ``sole`` is the kind of a table without one."""

    names: tuple[str, ...]
    sole: str | None = None

    def _expand(self, given: Any) -> Any:
        if isinstance(given, str):
            return {"kind": given}
        if self.sole is not None and isinstance(given, dict) and "kind" not in given:
            given["kind"] = self.sole  # in the table itself, which messages are looked up by
        return given

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_before_validator_function(self._expand, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> Any:
        return {"anyOf": [{"enum": list(self.names)}, handler(schema)]}


@dataclasses.dataclass(frozen=True)
class _Own:
    """Lets a class of the user's own below ``base`` stand there, by its module and name, in files that are trusted."""

    base: type

    def _validate(self, given: Any, handler: Callable[[Any], Any], info: ValidationInfo) -> Any:
        kind = given.get("kind") if isinstance(given, dict) else given
        if isinstance(given, Options):
            return given
        if not (isinstance(kind, str) and re.fullmatch(OWN_KIND, kind)):
            return handler(given)
        table = self._table(kind, reading(info))
        return table.model_validate(given if isinstance(given, dict) else {"kind": kind}, context=info.context)

    def _table(self, kind: str, known: Reading) -> type[Options]:
        if not known.trust:
            raise ValueError(
                f"{kind!r} is a program, and a case file runs none unless it is trusted; look at it, and say --trust "
                "(in Python trust=True) if it is yours"
            )
        target, file = member(kind, known.directory)
        if not (isinstance(target, type) and issubclass(target, self.base)) or inspect.isabstract(target):
            raise ValueError(f"{kind!r} must be a whole class below {self.base.__name__}, got {target!r}")
        if file is not None:
            known.programs.append(file)
        try:
            return table_of(target, kind_name=kind)  # type: ignore[arg-type]
        except TypeError as error:
            raise ValueError(f"{kind!r}: {error}") from None

    def _serialize(self, value: Any, handler: Callable[[Any], Any], info: Any) -> Any:
        own = isinstance(value, Options) and ":" in getattr(value, "kind", "")
        return value.model_dump(mode=info.mode, exclude_none=info.exclude_none) if own else handler(value)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        inner = handler(source)
        shown = core_schema.wrap_serializer_function_ser_schema(self._serialize, schema=inner, info_arg=True)
        return core_schema.with_info_wrap_validator_function(self._validate, inner, serialization=shown)

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> Any:
        kind = {"type": "string", "pattern": f"^{OWN_KIND}$", "description": f"{self.base.__name__} of your own"}
        table = {"type": "object", "properties": {"kind": kind}, "required": ["kind"]}
        return {"anyOf": [handler(schema), kind, table]}


def concrete(base: type) -> list[type]:
    """The classes of the package below ``base`` that can be made, by name; ``base`` itself when it has none.

    They lie in its own file, or one to a file beside it: those files are imported then.
    """
    direct: list[type] = base.__subclasses__()
    if inspect.isabstract(base) and all(cls.__module__ != base.__module__ for cls in direct):
        package = importlib.import_module(base.__module__.rpartition(".")[0])
        for module in pkgutil.iter_modules(package.__path__):
            importlib.import_module(f"{package.__name__}.{module.name}")
    below, todo = set(), [base]
    while todo:
        cls = todo.pop()
        todo += cls.__subclasses__()
        # Those of the tests and of a user's own script are not what a case file can name.
        if cls is not base and _of_the_package(cls):
            below.add(cls)
    found = [cls for cls in below if not inspect.isabstract(cls)] or [base]
    return sorted(found, key=lambda cls: cls.__name__)


def writable(base: type) -> list[type]:
    """Those of ``concrete`` whose arguments can all be written in a case file."""

    def can(cls: type) -> bool:
        try:
            table_of(cls)
        except TypeError:
            return False
        return True

    return [cls for cls in concrete(base) if can(cls)]


def descriptions(target: Callable[..., Any]) -> dict[str, str]:
    """What the docstrings say of the arguments, with units; those of base classes where a class says nothing."""
    found: dict[str, str] = {}
    for source in target.__mro__ if isinstance(target, type) else [target]:
        block = re.search(r"Args:\n(.*?)(?:\n\n|\Z)", inspect.cleandoc(source.__doc__ or ""), re.DOTALL)
        for name, text in re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", block[1] if block else "", re.MULTILINE):
            found.setdefault(name, re.sub(r"\s+", " ", text))
    return found


def _summary(target: Callable[..., Any]) -> str:
    return re.sub(r"\s+", " ", inspect.cleandoc(target.__doc__ or "").split("\n\n")[0])


def _zone_kind(given: Any) -> str:
    return "patch" if isinstance(given, (dict, Options)) else "formula"


#: Which particles: a comparison of their initial positions, or near a patch of a mesh.
Zone = Annotated[  # type: ignore[valid-type]
    Annotated[ZoneFormula, Tag("formula")] | Annotated[table_of(Patch, sole=True), Tag("patch")],  # type: ignore
    Discriminator(_zone_kind),
]
