"""``warp-eulsph info``: what a run is and how far it came."""

import argparse
import sys
from typing import Any


def add(commands: argparse._SubParsersAction) -> None:
    """Describe the subcommand."""
    parser = commands.add_parser(
        "info",
        help="say what a run is and how far it came",
        description="Say what a run is and how far it came. Exit status: 0 said, 2 no run there.",
    )
    parser.add_argument("directory", metavar="DIR", help="directory of the run")
    parser.add_argument("--json", action="store_true", help="print all that run.json, env.json and status.json hold")
    parser.set_defaults(run_command=run)


def run(arguments: argparse.Namespace) -> int:
    """Print; 0, or 2 where no run is."""
    import json

    from ..output import Run

    try:
        found = Run(arguments.directory)
        if arguments.json:
            print(json.dumps(found.description | found.environment | {"status": found.status}, indent=1))
        else:
            print("\n".join(f"{name + ':':13} {text}" for name, text in lines(found)))
    except (ValueError, OSError) as error:
        print(f"warp-eulsph: {error}", file=sys.stderr)
        return 2
    return 0


#: Columns of the log that are shown: key, name, unit.
LOGGED = (
    ("total", "energy", " J"),
    ("least", "least value", ""),
    ("largest", "largest", ""),
    ("error", "L2 error", ""),
)


def _said(simulation: dict[str, Any]) -> list[tuple[str, str]]:
    """What is run: bodies and scheme, or what is carried along."""
    kind, scheme = f"{simulation['dimension']}-D, {simulation['dtype']}", simulation["scheme"]["type"]
    if "flux" in simulation:
        flux = simulation["flux"]
        law = f"velocity {flux['velocity']} m/s" if "velocity" in flux else str(flux.get("function"))
        return [("transport", f"{law}, {kind}"), ("scheme", scheme)]
    bodies = [f"{name} ({body['material']['type']})" for name, body in simulation["bodies"].items()]
    return [
        ("bodies", f"{', '.join(bodies)}, {kind}"),
        ("scheme", f"{scheme}, reference {simulation['reference']['type']}"),
    ]


def lines(found: Any) -> list[tuple[str, str]]:
    """What is said of a run: (name, text); of what is damaged, that it is."""
    shown = [("directory", str(found.directory.path))]
    for name, part in (
        ("run.json", _described),
        ("status.json", _state),
        ("snapshots", _snapshots),
        ("log.jsonl", _logged),
        ("probes", _kept),
    ):
        try:
            shown += part(found)
        except (ValueError, OSError, KeyError, TypeError, AttributeError) as error:
            shown.append((name, f"cannot be read, {error}; warp-eulsph check tells more"))
    return shown


def _described(found: Any) -> list[tuple[str, str]]:
    simulation, case = found.description.get("simulation", {}), found.description.get("case", {})
    source = case.get("source")
    shown = [] if source is None else [("case", " ".join([source, *case["overrides"]]))]
    return shown + (_said(simulation) if simulation else [])


def _state(found: Any) -> list[tuple[str, str]]:
    status = found.status
    if not status:
        return []
    reason = f": {status['reason']}" if status["reason"] else ""
    return [("state", f"{found.state}{reason}"), ("end", f"t = {status['until']:.8g} s")]


def _snapshots(found: Any) -> list[tuple[str, str]]:
    if not len(found):
        return []
    first, last = found[0], found[-1]
    counted = f"{len(found)} of {last.N} particles, t = {first.time:.8g} to {last.time:.8g} s"
    return [("snapshots", counted), ("fields", ", ".join(found.fields))]


def _logged(found: Any) -> list[tuple[str, str]]:
    log = found.log
    if not log:
        return []
    figures = [f"{name} {log[key][-1]:.6g}{unit}" for key, name, unit in LOGGED if key in log]
    return [("log", f"step {log['step'][-1]}, t = {log['t'][-1]:.8g} s, {', '.join(figures)}")]


def _kept(found: Any) -> list[tuple[str, str]]:
    from ..output.checkpoint import Checkpoints

    shown = [("probes", ", ".join(found.probe_names))] if found.probe_names else []
    names = [path.stem.lstrip("0") or "0" for path in Checkpoints(found.directory.checkpoints).paths()]
    return [*shown, ("checkpoints", f"steps {', '.join(names)}")] if names else shown
