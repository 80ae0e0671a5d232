"""Files that are whole or absent, and lists that lose at most a line they never confirmed.

Everything that a run writes goes through here, so that one test can fail every write, fsync and rename there is.
"""

import errno
import os
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path

# What files are called until they are whole; nobody else's are, and a name that is taken is never opened.
_TEMPORARY = ".warp_eulsph.tmp"


def temporary_beside(path: Path) -> Path:
    """A name for a file that will be moved to ``path``; nothing is there."""
    return path.with_name(f".{secrets.token_hex(8)}{_TEMPORARY}")


def left_behind(folder: Path) -> Iterator[Path]:
    """Temporary files that a killed run left in a folder, which is no link."""
    if folder.is_dir() and not folder.is_symlink():
        yield from (path for path in folder.glob(f".*{_TEMPORARY}") if path.is_file() and not path.is_symlink())


def replace_file(path: Path, *parts: bytes | memoryview) -> None:
    """Write ``parts`` one after the other to a file beside ``path``, force it to disk, and move it into place.

    Whatever fails, ``path`` holds either what it held before or all of the new content, and no temporary file stays.

    Raises:
        OSError: the file cannot be written, forced to disk or moved.
    """
    temporary = temporary_beside(path)
    try:
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
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
    """Move a file or folder, its new folder made where it is missing; the destination must not be there.

    Where both are on different disks it is copied, forced to disk, and removed only then.

    Raises:
        OSError: the move was refused; the file is where it was.
    """
    destination.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.replace(source, destination)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        _copy(source, destination)
        if source.is_dir() and not source.is_symlink():
            shutil.rmtree(source)
        else:
            source.unlink()
    synchronise(destination.parent)
    synchronise(source.parent)


def _copy(source: Path, destination: Path) -> None:
    """Copy to another disk, whole or not at all."""
    temporary = temporary_beside(destination)
    try:
        if source.is_dir() and not source.is_symlink():
            shutil.copytree(source, temporary, symlinks=True)
            for path in [*temporary.rglob("*"), temporary]:
                if not path.is_symlink():
                    synchronise(path)
        else:
            shutil.copy2(source, temporary, follow_symlinks=False)
            if not temporary.is_symlink():
                synchronise(temporary)
        os.replace(temporary, destination)
    finally:
        if temporary.is_dir() and not temporary.is_symlink():
            shutil.rmtree(temporary)
        else:
            temporary.unlink(missing_ok=True)


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
