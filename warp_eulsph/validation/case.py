"""What a validation case is, and where the cases are found."""

import importlib
import pkgutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from .report import Figure


@dataclass(frozen=True)
class Case:
    """One problem with a reference.

    Args:
        name: as typed on the command line; that of its module.
        title: what is solved, in one line.
        source: where the reference comes from.
        run: the figures, each with its band and reference, from ``run(quick)``; ``quick`` takes a coarse resolution
            and the bands that belong to it, within half a minute.
    """

    name: str
    title: str
    source: str
    run: Callable[[bool], Sequence[Figure]]


def names() -> list[str]:
    """Names of all cases: the modules of ``warp_eulsph/validation/cases/``, one case each, of the same name."""
    package = importlib.import_module(".cases", __package__)
    return sorted(module.name for module in pkgutil.iter_modules(package.__path__))


def load(name: str) -> Case:
    """The case of that name, without importing the others."""
    return importlib.import_module(f".cases.{name}", __package__).CASE


def load_all() -> dict[str, Case]:
    """All cases by name."""
    return {name: load(name) for name in names()}
