"""What a simulation is, in numbers and names: what a resumed run is compared with."""

import functools
import hashlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import warp as wp

from ..simulation import Simulation
from ..transport import Transport
from .fields import Recorded


def describe(simulation: Recorded) -> dict[str, Any]:
    """All options, bodies and conditions of a simulation, as JSON takes them.

    Arrays are told by shape and SHA-256, functions by name, source and the values they enclose. Two simulations of
    equal description take the same steps, as long as no function reads what it does not enclose.
    """
    configuration = simulation.configuration
    return {
        "dimension": simulation.space.dim,
        "dtype": simulation.space.real.__name__,
        "weight": plain(configuration.weight),
        "periodic": [float(length) for length in configuration.lists.box],
        **(_solids(simulation) if isinstance(simulation, Simulation) else _transport(simulation)),
    }


def _transport(transport: Transport) -> dict[str, Any]:
    law, particles = transport.law, transport.particles
    return {
        "scheme": plain(law.scheme),
        "flux": plain(law.flux),
        "time_step": transport.time_step,
        "exact": plain(transport.exact),
        "particles": {
            "x": plain(transport.x),
            **{name: plain(getattr(particles, name).numpy()) for name in ("V0", "h")},
            "start": plain(law.start),
            "held": plain(law.held),
        },
    }


def _solids(simulation: Simulation) -> dict[str, Any]:
    stepper = simulation.stepper
    conditions = zip(simulation.boundaries, simulation.conditions, strict=True)
    return {
        "scheme": plain(stepper.options),
        "reference": plain(simulation.reference),
        "arrangement": plain(simulation.arrangement),
        "time_step": plain(simulation.clock.option),
        "dilation": simulation.dilation,
        "sort": simulation.sorting.on,
        "bodies": {body.name: plain(body) for body in simulation.bodies},
        "boundaries": {
            str(i): {**plain(boundary), "particles": plain(condition.indices)}
            for i, (boundary, condition) in enumerate(conditions)
        },
    }


def plain(value: Any) -> Any:
    """``value`` in dictionaries, lists, strings and numbers."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.ndarray | np.generic):
        array = np.ascontiguousarray(value)
        if array.size == 1:
            return array.item()
        return {"shape": list(array.shape), "sha256": hashlib.sha256(array.tobytes()).hexdigest()}
    if is_dataclass(value) and not isinstance(value, type):
        return {"type": type(value).__name__, **{f.name: plain(getattr(value, f.name)) for f in fields(value)}}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | range):
        return [plain(item) for item in value]
    if isinstance(value, wp.Function):
        return _function(value.func)
    if callable(value):
        return _function(value)
    return f"{type(value).__name__}"


def _function(function: Callable[..., Any], deep: bool = True) -> Any:
    if isinstance(function, functools.partial):
        inside = [plain(function.args), plain(function.keywords)]
        return {"partial": _function(function.func), "arguments": inside}
    if not inspect.isfunction(function):
        return {"type": type(function).__name__, **plain(getattr(function, "__dict__", {}))}
    try:
        source = inspect.getsource(function)
    except OSError:  # typed at a prompt: the compiled code is all there is
        source = function.__code__.co_code.hex() + repr(function.__code__.co_consts)
    described = {"function": function.__qualname__, "sha256": hashlib.sha256(source.encode()).hexdigest()}
    if not deep:
        return described
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    enclosed = {name: cell.cell_contents for name, cell in cells}
    return {**described, "enclosed": {name: _enclosed(item) for name, item in enclosed.items()}}


def _enclosed(value: Any) -> Any:
    """What a function encloses; of another function not what that one encloses, which may be the first."""
    function = value.func if isinstance(value, wp.Function) else value
    return _function(function, deep=False) if inspect.isfunction(function) else plain(value)


def differences(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """What changed, one line each: ``bodies.column.material.young: 17000000.0, now 18000000.0``."""
    old, new = dict(_leaves(before)), dict(_leaves(after))
    lines = []
    for name in dict.fromkeys([*old, *new]):
        if name not in new:
            lines.append(f"{name}: {old[name]}, now absent")
        elif name not in old:
            lines.append(f"{name}: absent, now {new[name]}")
        elif old[name] != new[name]:
            lines.append(f"{name}: {old[name]}, now {new[name]}")
    return lines


def _leaves(value: Any, path: str = "") -> Any:
    if isinstance(value, Mapping) and value:
        for key, item in value.items():
            yield from _leaves(item, f"{path}.{key}" if path else str(key))
    elif isinstance(value, list) and value and any(isinstance(item, Mapping | list) for item in value):
        for i, item in enumerate(value):
            yield from _leaves(item, f"{path}[{i}]")
    else:
        yield path, value
