"""What a validation case is, and where the cases are found."""

import importlib
import pkgutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ..output import Figure


@dataclass(frozen=True)
class Case:
    """One problem with a reference.

    Args:
        name: as typed on the command line.
        title: what is solved, in one line.
        source: where the reference comes from.
        run: the figures, each with its band and reference, from ``run(quick)``; ``quick`` takes a coarse resolution
            and the bands that belong to it, within half a minute.
    """

    name: str
    title: str
    source: str
    run: Callable[[bool], Sequence[Figure]]


def cases() -> dict[str, Case]:
    """All cases by name: the modules of ``warp_eulsph/validation/cases/``."""
    package = importlib.import_module(".cases", __package__)
    modules = sorted(module.name for module in pkgutil.iter_modules(package.__path__))
    found = [importlib.import_module(f"{package.__name__}.{name}").CASE for name in modules]
    return {case.name: case for case in found}
