"""Any value in words and numbers that are the same in another process, functions with all that they depend on."""

import ast
import functools
import hashlib
import inspect
import sys
import textwrap
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import warp as wp

# What a module keeps by these types is a setting; other things are too many, and change by themselves.
_SETTINGS = (bool, int, float, complex, str, np.ndarray, np.generic, types.FunctionType, wp.Function)


class Describer:
    """Describes values; one object for each description, which knows what it is inside of.

    A function or object within itself is told by how many levels up it is.
    """

    def __init__(self) -> None:
        self._inside: list[int] = []

    def plain(self, value: Any) -> Any:
        """``value`` in dictionaries, lists, strings and numbers."""
        if isinstance(value, float) and value != value:
            return "not a number"  # which would differ from itself
        if value is None or isinstance(value, bool | int | float | str):
            return value
        if id(value) in self._inside:
            return {"within": len(self._inside) - self._inside.index(id(value))}
        self._inside.append(id(value))
        try:
            return self._described(value)
        finally:
            self._inside.pop()

    def _described(self, value: Any) -> Any:
        if isinstance(value, wp.array):
            value = value.numpy()
        if isinstance(value, np.ndarray | np.generic) and value.dtype != object:
            array = np.ascontiguousarray(value)
            if array.size == 1:
                return self.plain(array.item()) if array.dtype.kind in "biufU" else repr(array.item())
            return {"shape": list(array.shape), "sha256": _digest(array.tobytes())}
        if is_dataclass(value) and not isinstance(value, type):
            return {"type": type(value).__name__, **{f.name: self.plain(getattr(value, f.name)) for f in fields(value)}}
        if isinstance(value, Mapping):
            return {str(key): self.plain(item) for key, item in value.items()}
        if isinstance(value, list | tuple | range):
            return [self.plain(item) for item in value]
        if isinstance(value, set | frozenset):
            return {"set": sorted((self.plain(item) for item in value), key=repr)}
        if isinstance(value, bytes | bytearray | complex | np.dtype):
            return repr(value)
        if isinstance(value, wp.Function):
            return self._function(value.func)
        if isinstance(value, types.ModuleType):
            return {"module": value.__name__}
        if isinstance(value, type):
            return {"class": value.__qualname__, **_source(value)}
        if callable(value) and not hasattr(type(value), "__dataclass_fields__"):
            return self._callable(value)
        return self._object(value)

    def _callable(self, function: Callable[..., Any]) -> Any:
        if isinstance(function, functools.partial):
            inside = [self.plain(function.args), self.plain(function.keywords)]
            return {"partial": self.plain(function.func), "arguments": inside}
        if inspect.ismethod(function):
            return {"method": self.plain(function.__func__), "of": self.plain(function.__self__)}
        if inspect.isfunction(function):
            return self._function(function)
        if inspect.isbuiltin(function) or isinstance(function, np.ufunc):
            return {"function": getattr(function, "__qualname__", function.__name__)}
        call, held = vars(type(function)).get("__call__"), self._object(function)
        described = held if isinstance(held, dict) else {"type": held}
        return {**described, **({"call": self.plain(call)} if inspect.isfunction(call) else {})}

    def _function(self, function: Callable[..., Any]) -> Any:
        code, known = function.__code__, function.__globals__  # type: ignore[attr-defined]
        described: dict[str, Any] = {"function": function.__qualname__}
        if not _installed(known):  # of those that are, the environment of a run tells the version
            described |= _source(function)
        described |= self._named("defaults", dict(enumerate(function.__defaults__ or ())))  # type: ignore[attr-defined]
        described |= self._named("keywords", function.__kwdefaults__ or {})  # type: ignore[attr-defined]
        cells = zip(code.co_freevars, function.__closure__ or (), strict=True)
        described["enclosed"] = {name: self.plain(_content(cell)) for name, cell in cells}
        if not _installed(known):
            read = {name: known[name] for name in sorted(set(_names(code))) if name in known}
            read = {name: item for name, item in read.items() if _is_setting(item) and item is not function}
            described |= self._named("reads", read)
        return described

    def _named(self, name: str, content: Mapping[Any, Any]) -> dict[str, Any]:
        return {name: self.plain(content)} if content else {}

    def _object(self, value: Any) -> Any:
        """The type of any other object, and what it holds if it holds anything."""
        name = type(value).__name__
        module = type(value).__module__.partition(".")[0]
        if module in ("warp", "warp_eulsph"):  # what simulations are made of tells of memory, not of what is meant
            return name
        held = None if module in sys.stdlib_module_names else getattr(value, "__dict__", None)
        if held:
            return {"type": name, **self.plain(held)}
        try:
            _, made_of, *state = value.__reduce_ex__(2)[:3]
        except Exception:  # whatever cannot be taken apart, such as a lock, says so in its own way
            return name
        # What makes it is its class, first of all; the rest is what it holds
        content = [item for item in (made_of[1:] if made_of[:1] == (type(value),) else made_of, *state) if item]
        return {"type": name, "state": self.plain(content)} if content else name


def _is_setting(value: Any) -> bool:
    if isinstance(value, list | tuple):
        return all(_is_setting(item) for item in value)
    if isinstance(value, dict):
        return all(_is_setting(item) for item in value.values())
    return isinstance(value, _SETTINGS)


def _installed(known: Mapping[str, Any]) -> bool:
    """Whether a module's names are those of an installed package or of Python itself."""
    file, name = str(known.get("__file__") or ""), str(known.get("__name__") or "").partition(".")[0]
    if name == "__main__":
        return False
    return "site-packages" in file or "dist-packages" in file or name in ("warp_eulsph", *sys.stdlib_module_names)


def _names(code: types.CodeType) -> Iterator[str]:
    """Names that a function's code reads, those of functions within it too."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _names(constant)


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # not filled yet
        return None


def _source(thing: Any) -> dict[str, str]:
    """Digest of the source; of the compiled code too where that does not tell it: at a prompt, two on a line."""
    try:
        source = inspect.getsource(thing)
    except (OSError, TypeError):
        return {"sha256": _digest(_compiled(thing.__code__).encode())} if inspect.isfunction(thing) else {}
    found = {"sha256": _digest(source.encode())}
    if (
        inspect.isfunction(thing)
        and thing.__name__ == "<lambda>"
        and source.count("lambda") > 1
        and _lambdas(source) != 1
    ):
        found["code"] = _digest(_compiled(thing.__code__).encode())
    return found


def _lambdas(source: str) -> int:
    """Functions without a name in a piece of source; 0 where it does not stand alone."""
    try:
        tree = ast.parse(textwrap.dedent(source))
    except SyntaxError:
        return 0
    return sum(isinstance(node, ast.Lambda) for node in ast.walk(tree))


def _compiled(code: types.CodeType) -> str:
    """Code as text, the same in another process with the same Python."""
    constants = [_compiled(item) if isinstance(item, types.CodeType) else repr(item) for item in code.co_consts]
    return repr([code.co_code.hex(), code.co_names, code.co_varnames, constants])


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
