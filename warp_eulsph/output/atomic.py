"""Files that are whole or absent."""

import os
from collections.abc import Callable
from pathlib import Path


def replace_file(path: Path, write: Callable[[Path], None]) -> None:
    """Let ``write`` make a temporary file beside ``path``, force it to disk, then put it in place in one move.

    Whatever fails, ``path`` holds either what it held before or all of the new content, and no temporary file stays.

    Raises:
        OSError: the file cannot be written, forced to disk or moved.
    """
    temporary = path.with_name(path.name + ".tmp")
    try:
        write(temporary)
        _synchronise(temporary)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    _synchronise(path.parent)  # the move itself lives in the directory


def _synchronise(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
