"""HDF5 files read with caution: nothing outside the file is followed, no size is believed, digests are compared.

Every dataset has the SHA-256 of its values beside it, and the file one of its names, shapes, units and those digests.
Files of older versions have none and are read as they are.
"""

import contextlib
import hashlib
import os
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .sealed import DamagedError

DIGEST = "sha256"


@contextlib.contextmanager
def opened(path: str | PathLike) -> Iterator[Any]:
    """The file, open for reading.

    Raises:
        OSError: no such file, or not HDF5.
        DamagedError: HDF5 that the library stumbles over.
    """
    import h5py

    if Path(path).is_dir():
        raise IsADirectoryError(f"{path} is a folder, not an HDF5 file")
    try:
        with h5py.File(path, "r") as file:
            yield file
    except (OSError, ValueError, KeyError):
        raise
    except Exception as error:  # the library raises whatever its parts do
        raise DamagedError(f"{path}: {type(error).__name__}: {error}") from error


def names(group: Any) -> list[str]:
    """Names in a group."""
    return list(group)


def member(group: Any, name: str) -> Any:
    """A dataset or group of the file itself, not one that it links to elsewhere.

    Raises:
        DamagedError: it is not there, a link, stored elsewhere, or larger than the file.
    """
    import h5py

    where = f"{group.file.filename}: {name}"
    found = group
    for part in name.split("/"):
        if not isinstance(found, h5py.Group) or part not in found:
            raise DamagedError(f"{where} is missing")
        if not isinstance(found.get(part, getlink=True), h5py.HardLink):
            raise DamagedError(f"{where} is a link, which no run writes and nobody follows")
        found = found[part]
    if isinstance(found, h5py.Dataset):
        if found.is_virtual or found.external:
            raise DamagedError(f"{where} is kept in another file, which no run writes and nobody follows")
        size = os.path.getsize(group.file.filename)
        if found.dtype.kind not in "iuf" or found.nbytes > size:
            raise DamagedError(f"{where} says it has {found.nbytes} bytes of {found.dtype}, in a file of {size}")
    return found


def read(dataset: Any) -> np.ndarray:
    """All of a dataset that ``member`` found.

    Raises:
        DamagedError: its digest does not fit.
    """
    values = dataset[()]
    digest = dataset.attrs.get(DIGEST)
    if digest is not None and digest != digest_of(values):
        raise DamagedError(f"{dataset.file.filename}: {dataset.name} is not what was written")
    return values


def seal(dataset: Any, values: np.ndarray) -> None:
    """Write the digest of a dataset's values beside it."""
    dataset.attrs[DIGEST] = digest_of(values)


def digest_of(values: np.ndarray) -> str:
    """SHA-256 of an array's bytes, in their order."""
    return hashlib.sha256(np.ascontiguousarray(values).reshape(-1).view(np.uint8).data).hexdigest()


def digest_of_layout(file: Any, datasets: dict[str, Any]) -> str:
    """SHA-256 of a file's own attributes, and of names, shapes, types and attributes of its ``datasets``."""
    own = {key: value for key, value in file.attrs.items() if key != DIGEST}
    told = [_attributes(own)]
    told += [[name, d.shape, d.dtype.str, _attributes(d.attrs)] for name, d in sorted(datasets.items())]
    return hashlib.sha256(repr(told).encode()).hexdigest()


def check_layout(file: Any, datasets: dict[str, Any]) -> None:
    """Compare the layout with its digest, if the file has one.

    Raises:
        DamagedError: it does not fit.
    """
    digest = file.attrs.get(DIGEST)
    if digest is not None and digest != digest_of_layout(file, datasets):
        raise DamagedError(f"{file.filename}: names, shapes, units or digests are not what was written")


def _attributes(attributes: Any) -> list[Any]:
    return [[key, np.asarray(attributes[key]).tolist()] for key in sorted(attributes)]
