"""Python files of a user's own, run as modules."""

import functools
import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

# What a file's module is called, so that no other module has the name
PREFIX = "warp_eulsph_case_"


def program(path: Path) -> ModuleType:
    """The file as a module, run anew; those beside it can be imported by it."""
    folder = str(path.resolve().parent)
    if folder not in sys.path:
        sys.path.insert(0, folder)
    name = f"{PREFIX}{path.stem}"
    specification = importlib.util.spec_from_file_location(name, path)
    assert specification is not None and specification.loader is not None  # for a .py file there is one
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module  # Warp looks up the module of a function
    specification.loader.exec_module(module)
    return module


def member(reference: str, folder: Path) -> tuple[object, Path | None]:
    """What ``module:name`` names, and the file of the module if it lies in ``folder``.

    The module is ``module.py`` in ``folder``, or else one that is installed. Running it runs what it says.

    Raises:
        ValueError: no such module or name, or a module that fails; it says which.
    """
    where, _, name = reference.partition(":")
    file = folder / f"{where}.py"
    try:
        if file.is_file():
            found = _unchanged(file, file.read_bytes())
        else:
            found = importlib.import_module(where)
    except ModuleNotFoundError as error:
        raise ValueError(f"{reference}: {error}; a module lies beside the case file, or is installed") from error
    except Exception as error:
        raise ValueError(f"{reference}: {where} cannot be imported: {type(error).__name__}: {error}") from error
    if not hasattr(found, name):
        raise ValueError(f"{reference}: {where} has no {name!r}")
    return getattr(found, name), file if file.is_file() else None


@functools.cache
def _unchanged(file: Path, content: bytes) -> ModuleType:
    """The module of a file, the same one as long as its content is: its kernels are compiled once."""
    return program(file)
