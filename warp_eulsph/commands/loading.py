"""Cases as the command line names them: ``case.toml``, ``case.py``, ``example:NAME``."""

import ast
import difflib
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..output import Recording
from ..output.recorded import Recorded
from ..programs import program

EXAMPLE = "example:"


@dataclass(frozen=True)
class LoadedCase:
    """A case that can be run.

    Attributes:
        name: for a directory.
        build: what is run, at its start.
        until: end time [s].
        recording: what its run keeps.
        origin: where it came from, for ``run.json``: source, overrides, all its settings.
        files: what builds it again, for the directory of its run: text by name.
    """

    name: str
    build: Callable[[], Recorded]
    until: float
    recording: Callable[[Any], Recording]
    origin: dict[str, Any]
    files: dict[str, str]


def load_case(source: str, overrides: Sequence[str] = (), device: str | None = None, trust: bool = False) -> LoadedCase:
    """The case that ``source`` names.

    Args:
        source: a ``.toml`` file (see ``warp_eulsph.cases``), a ``.py`` file (see docs/runs.md), or ``example:NAME``.
        overrides: ``key=value`` strings.
        device: Warp device, instead of the case's own.
        trust: a TOML file may name materials and conditions of the user's own, whose modules are run.

    Raises:
        ValueError: no such file or example, or one that is wrong; it says what.
    """
    path = example_path(source.removeprefix(EXAMPLE)) if source.startswith(EXAMPLE) else Path(source)
    if not path.is_file():
        hint = f"; the example of that name is {EXAMPLE}{path.stem}" if path.stem in examples() else ""
        raise ValueError(f"no case file {path}{hint}")
    load = {".toml": _load_toml, ".py": _load_python}.get(path.suffix)
    if load is None:
        raise ValueError(f"a case must be a .toml file, a .py file or {EXAMPLE}NAME, got {source!r}")
    build, until, recording, settings, files = load(path, overrides, device, trust)
    origin = {
        "source": source if source.startswith(EXAMPLE) else str(path.resolve()),
        "overrides": list(overrides),
        "device": device,
        "settings": settings,
    }
    return LoadedCase(path.stem, build, until, recording, origin, files)


def examples() -> dict[str, Path]:
    """Case files of the examples by name: those installed with the package, or those beside it in a clone."""
    package = Path(__file__).parents[1]
    for folder in (package / "examples", package.parent / "examples" / "cases"):
        if folder.is_dir():
            return {path.stem: path for path in sorted(folder.glob("*.toml"))}
    return {}


def example_path(name: str) -> Path:
    """The case file of an example.

    Raises:
        ValueError: no such example; it names those that there are.
    """
    known = examples()
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise ValueError(f"unknown example {name!r}; {hint}examples are {', '.join(known) or 'not installed'}")
    return known[name]


def _load_toml(path: Path, overrides: Sequence[str], device: str | None, trust: bool) -> tuple[Any, ...]:
    import tomli_w

    from ..cases import read_case

    case = read_case(path, [*overrides, *([f"device={device}"] if device else [])], trust=trust)
    described = case.describe()
    text = f"# {path.name} with its defaults and settings, as it was run. SI units.\n{tomli_w.dumps(described)}"
    files = {"case.toml": text, **{file.name: file.read_text(encoding="utf-8") for file in case.programs}}
    return case.build, case.until, case.recording, described, files


def _load_python(path: Path, overrides: Sequence[str], device: str | None, trust: bool) -> tuple[Any, ...]:
    module, text = program(path), path.read_text(encoding="utf-8")
    case: Any = getattr(module, "CASE", None)
    if hasattr(case, "build"):
        if overrides:
            raise ValueError(f"{path} defines CASE, which takes no settings, got {list(overrides)}")
        return _on(device, case.build), case.until, case.recording, case.describe(), {"case.py": text}
    settings = dict(_setting(override) for override in overrides)
    build, until = getattr(module, "build", None), getattr(module, "UNTIL", None)
    if not callable(build) or not isinstance(until, int | float):
        raise ValueError(
            f"{path} must define build(**settings) -> Simulation and UNTIL, the end time in seconds, or a CASE"
        )
    known = inspect.signature(build).parameters
    if not any(parameter.kind is parameter.VAR_KEYWORD for parameter in known.values()):
        wrong = [name for name in settings if name not in known]
        if wrong:
            raise ValueError(f"{path}: build has no setting {wrong[0]!r}; it has {list(known) or 'none'}")

    given = getattr(module, "recording", lambda simulation: Recording())
    return _on(device, lambda: build(**settings)), float(until), given, settings, {"case.py": text}


def _on(device: str | None, build: Callable[[], Recorded]) -> Callable[[], Recorded]:
    """``build`` where ``device`` is Warp's default device."""
    if device is None:
        return build

    def made() -> Recorded:
        import warp as wp

        with wp.ScopedDevice(device):
            return build()

    return made


def _setting(override: str) -> tuple[str, Any]:
    name, equals, text = override.partition("=")
    if not equals or not name.isidentifier():
        raise ValueError(f"a setting must be key=value, got {override!r}")
    try:
        return name, ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return name, text
