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
    """What is said of a run: (name, text)."""
    from ..output.checkpoint import Checkpoints

    simulation, status = found.description.get("simulation", {}), found.status
    shown = [("directory", str(found.directory.path))]
    source = found.description.get("case", {}).get("source")
    if source is not None:
        shown.append(("case", " ".join([source, *found.description["case"]["overrides"]])))
    if simulation:
        shown += _said(simulation)
    if status:
        reason = f": {status['reason']}" if status["reason"] else ""
        shown.append(("state", f"{found.state}{reason}"))
        shown.append(("end", f"t = {status['until']:.8g} s"))
    if len(found):
        first, last = found[0], found[-1]
        shown.append(("snapshots", f"{len(found)} of {last.N} particles, t = {first.time:.8g} to {last.time:.8g} s"))
        shown.append(("fields", ", ".join(found.fields)))
    log = found.log
    if log:
        figures = [f"{name} {log[key][-1]:.6g}{unit}" for key, name, unit in LOGGED if key in log]
        shown.append(("log", f"step {log['step'][-1]}, t = {log['t'][-1]:.8g} s, {', '.join(figures)}"))
    if found.probe_names:
        shown.append(("probes", ", ".join(found.probe_names)))
    names = [path.stem.lstrip("0") or "0" for path in Checkpoints(found.directory.checkpoints).paths()]
    if names:
        shown.append(("checkpoints", f"steps {', '.join(names)}"))
    return shown
