"""Options given wrongly: a keyword that a class does not take, a value of another kind; and what to write instead."""

import difflib
import functools
import inspect
import numbers
import types
import typing
from collections.abc import Iterable
from typing import Any

import numpy as np

from .checks import short

# How a type of Python is called in messages.
_WORDS = {float: "a number", int: "a whole number", bool: "True or False", str: "text", types.NoneType: "None"}
_ABSTRACT: dict[Any, type] = {float: numbers.Real, int: numbers.Integral}


def explain_mistakes(names: Iterable[str], where: dict[str, Any]) -> None:
    """Have the classes of these names, looked up in ``where``, say more of arguments that they do not take.

    A TypeError for an unknown keyword tells who takes it, so that ``Verlet(cfl=0.5)`` leads to ``TimeStep(cfl=...)``;
    a ValueError for a value of another kind than the annotation has tells what to write. Signatures stay as they are.
    """
    classes: list[Any] = [given for name in names if isinstance(given := where[name], type)]
    classes = [cls for cls in classes if not issubclass(cls, BaseException)]
    for cls in classes:
        if "__init__" in vars(cls) and not inspect.isabstract(cls):
            cls.__init__ = _explaining(cls, classes)


def _explaining(cls: type, others: list[Any]) -> Any:
    init: Any = vars(cls)["__init__"]
    init = getattr(init, "explained", init)  # by a package whose front door knows fewer classes
    signature = inspect.signature(init)
    taken = tuple(signature.parameters)[1:]

    def check(args: tuple[Any, ...], options: dict[str, Any]) -> None:
        for name, given in (dict(zip(taken, args, strict=False)) | options).items():
            _check_kind(f"{cls.__name__}: {name}", given, _kinds(init).get(name, ()))

    @functools.wraps(init)
    def explaining(self: Any, *args: Any, **options: Any) -> None:
        unknown = [name for name in options if name not in taken]
        if unknown:
            raise TypeError(_unknown(cls, taken, unknown[0], others))
        try:
            init(self, *args, **options)  # whose own messages say more
        except (TypeError, AttributeError) as error:
            check(args, options)
            if str(error).startswith(f"{cls.__name__}.__init__()"):
                error.args = (f"{error}. {_takes(cls, signature)}",)
            raise
        check(args, options)

    explaining.explained = init  # type: ignore[attr-defined]
    return explaining


def _unknown(cls: type, taken: tuple[str, ...], name: str, others: list[Any]) -> str:
    near = difflib.get_close_matches(name, taken, 1)
    takers = [f"{other.__name__}({name}=...)" for other in others if name in inspect.signature(other).parameters]
    if near:
        hint = f"; did you mean {near[0]}?"
    elif takers:
        hint = f"; {' and '.join(takers[:3])} {'does' if len(takers) == 1 else 'do'}"
    else:
        hint = ""
    return f"{cls.__name__} takes no {name!r}{hint}. {_takes(cls, inspect.signature(cls))}"


def _takes(cls: type, signature: inspect.Signature) -> str:
    """Words on the arguments of a class, in their order."""
    taken = {name: argument.kind for name, argument in signature.parameters.items() if name != "self"}
    if not taken:
        return f"{cls.__name__} has no options"
    by_name = ", all by name" if set(taken.values()) == {inspect.Parameter.KEYWORD_ONLY} else ""
    return f"{cls.__name__} takes {', '.join(taken)}{by_name}"


@functools.cache
def _kinds(init: Any) -> dict[str, tuple[type, ...]]:
    """The kinds that arguments may be of, of those whose annotation is a number, text or classes of the package."""
    found = {}
    for name, hint in typing.get_type_hints(init).items():
        members = typing.get_args(hint) if typing.get_origin(hint) in (typing.Union, types.UnionType) else (hint,)
        if all(member in _WORDS or _of_the_package(member) for member in members):
            found[name] = members
    return found


def _of_the_package(member: Any) -> bool:
    return isinstance(member, type) and member.__module__.startswith(f"{__package__}.")


def _check_kind(who: str, given: Any, kinds: tuple[type, ...]) -> None:
    """ValueError unless ``given`` is of one of the ``kinds``; truth values are no numbers."""
    if not kinds or any(_is_a(given, kind) for kind in kinds):
        return
    words = " or ".join(_WORDS[kind] if kind in _WORDS else f"such as {_example(kind)}" for kind in kinds)
    hint = ""
    if isinstance(given, type) and any(kind not in _WORDS and issubclass(given, kind) for kind in kinds):
        hint = f"; write {given.__name__}(...)"
    raise ValueError(f"{who} must be {words}, got {short(given)}{hint}")


def _is_a(given: Any, kind: type) -> bool:
    if isinstance(given, bool | np.bool_):
        return kind is bool
    if kind is float and isinstance(given, np.ndarray):
        return given.ndim == 0 and given.dtype.kind in "iuf"
    return isinstance(given, _ABSTRACT.get(kind, kind))


def _example(kind: Any) -> str:
    """The name of a class that can be made, the first below an abstract one."""
    while inspect.isabstract(kind) and kind.__subclasses__():
        kind = kind.__subclasses__()[0]
    return f"{kind.__name__}(...)"
