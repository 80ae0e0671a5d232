"""Small formulas of case files: numbers, names, arithmetic, comparisons, a few functions; nothing else is evaluated.

A formula is parsed by Python's own parser and its tree is walked node by node, so that nothing in a case file can run
code. The same tree gives numbers on the host (numpy) and a ``wp.func`` on the device.
"""

import ast
import difflib
import functools
import linecache
import re
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..space import Space

LONGEST = 1000  # characters
_WITH_UNIT = re.compile(r"[-+]?[\d.]+(e[-+]?\d+)?\s*[a-z%°][\w/^*-]*", re.IGNORECASE)


@dataclass(frozen=True)
class Function:
    """A function of formulas: fewest and most arguments (None: any number), on the host, and as Warp's source."""

    fewest: int
    most: int | None
    host: Callable[..., Any]
    device: Callable[..., str]


def _plain(name: str, host: Any, arguments: int = 1) -> Function:
    return Function(arguments, arguments, host, lambda *a: f"wp.{name}({', '.join(a)})")


def _pairwise(name: str, host: Any) -> Function:
    def device(*a: str) -> str:
        return a[0] if len(a) == 1 else f"wp.{name}({a[0]}, {device(*a[1:])})"

    return Function(2, None, lambda *a: host.reduce(np.broadcast_arrays(*a)), device)


def _smoothstep(s: Any) -> Any:
    s = np.clip(s, 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)


FUNCTIONS = {
    **{name: _plain(name, getattr(np, name)) for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh")},
    **{name: _plain(name, getattr(np, name)) for name in ("exp", "log", "sqrt", "floor", "ceil", "abs")},
    "sign": Function(1, 1, np.sign, lambda s: f"sign({s})"),  # 0 at 0, unlike Warp's
    "asin": _plain("asin", np.arcsin),
    "acos": _plain("acos", np.arccos),
    "atan": _plain("atan", np.arctan),
    "atan2": _plain("atan2", np.arctan2, 2),
    "clip": _plain("clamp", np.clip, 3),
    "hypot": Function(2, 2, np.hypot, lambda a, b: f"hypot({a}, {b})"),
    "min": _pairwise("min", np.minimum),
    "max": _pairwise("max", np.maximum),
    # 0 below 0, 1 above 1, smooth between: s² (3 − 2 s)
    "smoothstep": Function(1, 1, _smoothstep, lambda s: f"smoothstep({s})"),
}
OPERATORS: dict[type, tuple[str, Any]] = {
    ast.Add: ("+", np.add),
    ast.Sub: ("-", np.subtract),
    ast.Mult: ("*", np.multiply),
    ast.Div: ("/", np.divide),
    ast.Pow: ("**", np.power),
    ast.Lt: ("<", np.less),
    ast.LtE: ("<=", np.less_equal),
    ast.Gt: (">", np.greater),
    ast.GtE: (">=", np.greater_equal),
    ast.And: ("and", np.logical_and),
    ast.Or: ("or", np.logical_or),
}
COORDINATES = ("x", "y", "z")


@dataclass(frozen=True)
class Expression:
    """A checked formula.

    Attributes:
        text: as written.
        tree: its parsed form.
        names: variables in it, those of the definitions it uses too.
        definitions: the formulas that it uses by name, each before those that use it.
    """

    text: str
    tree: ast.expr
    names: frozenset[str]
    definitions: tuple[tuple[str, "Expression"], ...] = ()

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """Its value on the host; ``values`` are numbers or arrays by name."""
        known = dict(values)
        with np.errstate(all="ignore"):
            for name, definition in self.definitions:
                known[name] = _evaluate(definition.tree, known)
            return _evaluate(self.tree, known)


def parse(
    text: str, names: Sequence[str], *, truth: bool = False, definitions: Mapping[str, Expression] = {}
) -> Expression:
    """Check a formula.

    Args:
        text: the formula.
        names: variables it may use.
        truth: it must say yes or no, as a region does, instead of giving a number.
        definitions: formulas that it may use by name, those of other variables than ``names`` aside.

    Raises:
        ValueError: not a formula, an unknown name or function, or a number where a truth is asked for.
    """
    if unicodedata.normalize("NFKC", text) != text:
        plain = unicodedata.normalize("NFKC", text)
        raise ValueError(f"must be in plain letters, got {text!r}; write {plain!r} if that is meant")
    if len(text) > LONGEST:
        raise ValueError(f"a formula must have at most {LONGEST} characters, got {len(text)}")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
        found: set[str] = set()
        usable = {name: d for name, d in definitions.items() if d.names <= {*names, "pi"}}
        for node in ast.walk(tree):
            if isinstance(node, ast.Name) and node.id in definitions.keys() - usable.keys():
                strange = sorted(definitions[node.id].names - {*names, "pi"})
                raise ValueError(f"{node.id!r} depends on {strange}, which formulas in this place must not")
        is_truth = _check(tree, (*names, *usable), found)
    except (SyntaxError, RecursionError, MemoryError) as error:
        reason = error.msg if isinstance(error, SyntaxError) else "too deeply nested"
        hint = "; numbers are in SI units and have none written" if _WITH_UNIT.fullmatch(text) else ""
        raise ValueError(f"not a formula: {text!r} ({reason}){hint}") from None
    if is_truth != truth:
        wanted, got = ("a comparison such as 'y < 0.1'", "a number") if truth else ("a number", "a comparison")
        raise ValueError(f"must be {wanted}, got {got}: {text!r}")
    # Those that it uses, and that those use; in their own order, in which none comes before what it uses.
    used = {name for name in found if name in usable}
    used |= {inner for name in used for inner, _ in usable[name].definitions}
    names_in = found.union(*(usable[name].names for name in used)) - used
    return Expression(text, tree, frozenset(names_in), tuple((name, usable[name]) for name in usable if name in used))


def _check(node: ast.AST, names: tuple[str, ...], found: set[str]) -> bool:
    """Whether the node is a truth rather than a number; ValueError on what formulas do not have."""

    def need(child: ast.AST, truth: bool) -> None:
        if _check(child, names, found) != truth:
            raise ValueError(f"{'a comparison' if truth else 'a number'} is needed in place of {ast.unparse(child)!r}")

    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            if not abs(value) < 1e300:
                raise ValueError(f"numbers must be finite, got {ast.unparse(node)[:40]}")
            return False
        case ast.Name(id=name):
            if name not in (*names, "pi"):
                raise ValueError(f"unknown name {name!r}{nearest(name, [*names, 'pi'])}; known are {[*names, 'pi']}")
            found.add(name)
            return False
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            need(operand, False)
            return False
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            need(operand, True)
            return True
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            need(left, False)
            need(right, False)
            return False
        case ast.Compare(left=left, ops=ops, comparators=right) if all(type(op) in OPERATORS for op in ops):
            for child in (left, *right):
                need(child, False)
            return True
        case ast.BoolOp(values=values):
            for child in values:
                need(child, True)
            return True
        case ast.IfExp(test=test, body=body, orelse=orelse):
            need(test, True)
            need(body, False)
            need(orelse, False)
            return False
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            _check_call(name, arguments)
            for child in arguments:
                need(child, False)
            return False
    raise ValueError(
        f"formulas have numbers, names, + - * / **, < <= > >=, and, or, not, 'a if test else b' and functions, "
        f"got {ast.unparse(node)[:40]!r}"
    )


def _check_call(name: str, arguments: Sequence[ast.AST]) -> None:
    function = FUNCTIONS.get(name)
    if function is None:
        raise ValueError(f"unknown function {name!r}{nearest(name, FUNCTIONS)}; known are {sorted(FUNCTIONS)}")
    if len(arguments) < function.fewest or len(arguments) > (function.most or len(arguments)):
        raise ValueError(f"{name} takes {function.fewest}{'' if function.most else ' or more'}, got {len(arguments)}")


def _evaluate(node: ast.AST, values: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=value):
            return float(value)  # type: ignore[arg-type]
        case ast.Name(id=name):
            return np.pi if name == "pi" else values[name]
        case ast.UnaryOp(op=op, operand=operand):
            value = _evaluate(operand, values)
            return np.logical_not(value) if isinstance(op, ast.Not) else -value if isinstance(op, ast.USub) else value
        case ast.BinOp(left=left, op=op, right=right):
            return OPERATORS[type(op)][1](_evaluate(left, values), _evaluate(right, values))
        case ast.Compare(left=left, ops=ops, comparators=right):
            sides = [_evaluate(child, values) for child in (left, *right)]
            parts = [OPERATORS[type(op)][1](a, b) for op, a, b in zip(ops, sides, sides[1:], strict=False)]
            return np.logical_and.reduce(np.broadcast_arrays(*parts))
        case ast.BoolOp(op=op, values=children):
            return OPERATORS[type(op)][1].reduce(np.broadcast_arrays(*(_evaluate(c, values) for c in children)))
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return np.where(*(_evaluate(child, values) for child in (test, body, orelse)))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return FUNCTIONS[name].host(*(_evaluate(child, values) for child in arguments))
    raise AssertionError(ast.dump(node))


def _source(node: ast.AST, values: Mapping[str, Any], lines: list[str]) -> str:
    """Warp's source of a node; ``values`` are numbers, and the local variables of definitions, by name.

    What it needs twice it adds to ``lines`` that come first: source in proportion to the formula, however it is nested.
    """
    match node:
        case ast.Constant(value=value):
            return f"real({float(value)!r})"  # type: ignore[arg-type]
        case ast.Name(id=name):
            if name in COORDINATES:
                return f"x[{COORDINATES.index(name)}]"
            value = np.pi if name == "pi" else "t" if name == "t" else values[name]
            return value if isinstance(value, str) else f"real({float(value)!r})"
        case ast.UnaryOp(op=op, operand=operand):
            sign = "not " if isinstance(op, ast.Not) else "-" if isinstance(op, ast.USub) else "+"
            return f"({sign}{_source(operand, values, lines)})"
        case ast.BinOp(left=left, op=op, right=right):
            a, b = _source(left, values, lines), _source(right, values, lines)
            return f"wp.pow({a}, {b})" if isinstance(op, ast.Pow) else f"({a} {OPERATORS[type(op)][0]} {b})"
        case ast.Compare(left=left, ops=ops, comparators=right):
            sides = [_source(child, values, lines) for child in (left, *right)]
            for k in range(1, len(sides) - 1):  # those in the middle of a chain are compared on both sides
                sides[k] = _named(sides[k], lines)
            pairs = zip(ops, sides, sides[1:], strict=False)
            return "(" + " and ".join(f"({a} {OPERATORS[type(op)][0]} {b})" for op, a, b in pairs) + ")"
        case ast.BoolOp(op=op, values=children):
            return "(" + f" {OPERATORS[type(op)][0]} ".join(_source(child, values, lines) for child in children) + ")"
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return f"wp.where({', '.join(_source(child, values, lines) for child in (test, body, orelse))})"
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return FUNCTIONS[name].device(*(_source(child, values, lines) for child in arguments))
    raise AssertionError(ast.dump(node))


def _named(source: str, lines: list[str]) -> str:
    """A local variable that holds what ``source`` gives."""
    name = f"d{len(lines)}"
    lines.append(f"{name} = {source}")
    return name


def device_function(expressions: Sequence[Expression], values: Mapping[str, float], space: Space) -> Any:
    """``wp.func`` (x, t) -> row of the formulas, in the precision of ``space``; ``values`` are constants by name."""
    known: dict[str, Any] = dict(values)
    lines: list[str] = []
    for expression in expressions:
        for name, definition in expression.definitions:
            if name not in known:
                known[name] = _named(_source(definition.tree, known, lines), lines)
    parts = [_source(expression.tree, known, lines) for expression in expressions]
    return _compiled(tuple(lines), tuple(parts), space)


@functools.cache
def _compiled(lines: tuple[str, ...], parts: tuple[str, ...], space: Space) -> Any:
    """``wp.func`` of Warp's source: lines that come first, and each component.

    Cached, because a new function is a new kernel.
    """
    real = space.real

    @wp.func
    def smoothstep(s: real) -> real:
        u = wp.clamp(s, real(0.0), real(1.0))
        return u * u * (real(3.0) - real(2.0) * u)

    @wp.func
    def sign(s: real) -> real:
        return wp.where(s == real(0.0), real(0.0), wp.sign(s))

    @wp.func
    def hypot(a: real, b: real) -> real:
        return wp.sqrt(a * a + b * b)

    body = "".join(f"    {line}\n" for line in (*lines, f"return row({', '.join(parts)})"))
    source = f"def formula(x: vec, t: real):\n{body}"
    # Warp reads the source of a function by its file: this one is only in the cache of files.
    file = f"<formula {source!r} {space!r}>"
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
    scope: dict[str, Any] = {"wp": wp, "smoothstep": smoothstep, "sign": sign, "hypot": hypot}
    scope |= {"real": real, "vec": space.vec, "row": space.row(len(parts))}
    exec(compile(source, file, "exec"), scope)
    return wp.func(scope["formula"])


def nearest(name: str, known: Any) -> str:
    """``; did you mean ...?`` for the known name most like ``name``, or nothing."""
    close = difflib.get_close_matches(name, [str(k) for k in known], n=1)
    return f"; did you mean {close[0]!r}?" if close else ""
