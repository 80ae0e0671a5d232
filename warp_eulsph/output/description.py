"""What a simulation is, in numbers and names: what a resumed run is compared with."""

from collections.abc import Mapping
from typing import Any

from ..body import Body
from ..building import Options, options_of_each
from .describer import Describer
from .recorded import Recorded, RecordedSolids, RecordedTransport, solids, transport

# What a body is told to have only where it has it.
SELDOM = (*Options._fields, "bonded")


def describe(simulation: Recorded) -> dict[str, Any]:
    """All options, bodies and conditions of a simulation, as JSON takes them.

    Arrays are told by shape and SHA-256, functions by name and source, and by all that they get from elsewhere:
    defaults of arguments, the object they are a method of, what they enclose and read of their module (see
    ``Describer``). Two simulations of equal description take the same steps, unless a function reads files, or what
    other modules keep.
    """
    configuration = simulation.configuration
    return {
        "dimension": simulation.space.dim,
        "dtype": simulation.space.real.__name__,
        "weight": plain(configuration.weight),
        "periodic": [float(length) for length in configuration.lists.box],
        **(_solids(simulation) if solids(simulation) else {}),
        **(_transport(simulation) if transport(simulation) else {}),
    }


def _transport(simulation: RecordedTransport) -> dict[str, Any]:
    law, particles = simulation.law, simulation.particles
    return {
        "scheme": plain(law.scheme),
        "flux": plain(law.flux),
        "time_step": simulation.time_step,
        "exact": plain(simulation.exact),
        "particles": {
            "x": plain(simulation.x),
            **{name: plain(getattr(particles, name).numpy()) for name in ("V0", "h")},
            "start": plain(law.start),
            "held": plain(law.held),
        },
    }


def _solids(simulation: RecordedSolids) -> dict[str, Any]:
    stepper = simulation.stepper
    conditions = zip(simulation.boundaries, simulation.conditions, strict=True)
    exchanges = zip(simulation.interactions, simulation.bound_interactions, strict=True)
    interactions = {
        str(i): {**plain(interaction), "particles": plain(bound.indices)}
        for i, (interaction, bound) in enumerate(exchanges)
    }
    options = options_of_each(simulation.bodies, simulation.options)
    first = options[simulation.bodies[0].name]
    return {
        **({"interactions": interactions} if interactions else {}),
        "scheme": plain(stepper.options),
        "reference": plain(simulation.reference),
        "arrangement": plain(simulation.arrangement),
        "time_step": plain(simulation.clock.option),
        "dilation": simulation.dilation,
        "sort": simulation.sorting.on,
        **({"independent": True} if simulation.clock.independent else {}),
        "bodies": {body.name: _body(body, options[body.name], first) for body in simulation.bodies},
        "boundaries": {
            str(i): {**plain(boundary), "particles": plain(condition.indices)}
            for i, (boundary, condition) in enumerate(conditions)
        },
    }


def _body(body: Body, own: Options, first: Options) -> dict[str, Any]:
    """A body, with those options that it has of its own or that its matter is given otherwise than the first one's."""
    described: dict[str, Any] = plain(body)
    for name in ("scheme", "weight", "dilation"):
        if getattr(body, name) is None and getattr(own, name) != getattr(first, name):
            described[name] = plain(getattr(own, name))
    return {name: value for name, value in described.items() if name not in SELDOM or value is not None}


def plain(value: Any) -> Any:
    """``value`` in dictionaries, lists, strings and numbers."""
    return Describer().plain(value)


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
