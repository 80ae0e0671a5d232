"""Files that are whole or absent, and lists that lose at most a line they never confirmed.

Everything that a run writes goes through here, so that one test can fail every write, fsync and rename there is.
"""

import os
from pathlib import Path


def replace_file(path: Path, *parts: bytes | memoryview) -> None:
    """Write ``parts`` one after the other to a file beside ``path``, force it to disk, and move it into place.

    Whatever fails, ``path`` holds either what it held before or all of the new content, and no temporary file stays.

    Raises:
        OSError: the file cannot be written, forced to disk or moved.
    """
    temporary = path.with_name(path.name + ".tmp")
    try:
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
        try:
            for part in parts:
                _write_all(descriptor, part)
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    synchronise(path.parent)  # the move itself lives in the directory


def append_line(path: Path, line: str) -> None:
    """Append ``line`` and force it to disk; a failure leaves the file as it was.

    Raises:
        OSError: the disk refused.
    """
    fresh = not path.exists()
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
    try:
        size = os.fstat(descriptor).st_size
        try:
            _write_all(descriptor, (line + "\n").encode())
            os.fsync(descriptor)
        except OSError:
            os.ftruncate(descriptor, size)
            raise
    finally:
        os.close(descriptor)
    if fresh:
        synchronise(path.parent)


def move(source: Path, destination: Path) -> None:
    """Move a file within a file system, its folder made where it is missing; the destination must not be there.

    Raises:
        OSError: the move was refused; the file is where it was.
    """
    destination.parent.mkdir(parents=True, exist_ok=True)
    os.replace(source, destination)
    synchronise(destination.parent)
    synchronise(source.parent)


def synchronise(path: Path) -> None:
    """Force a file, or the names in a folder, to disk."""
    if os.name == "nt" and path.is_dir():
        return  # Windows opens no folders; NTFS journals names by itself
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _write_all(descriptor: int, content: bytes | memoryview) -> None:
    view = memoryview(content)
    while view:
        view = view[os.write(descriptor, view) :]
