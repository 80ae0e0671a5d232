"""The snapshots of a run's directory, in order."""

import json
from collections.abc import Sequence
from os import PathLike
from pathlib import Path


def snapshot_files(path: str | PathLike) -> list[Path]:
    """The snapshots of a run, or the one snapshot that ``path`` is.

    Raises:
        FileNotFoundError: neither a directory with snapshots nor a snapshot.
    """
    place = Path(path)
    if place.is_file():
        return [place]
    listing = place / "run.vtkhdf.series"
    if listing.is_file():
        files = [place / entry["name"] for entry in json.loads(listing.read_text(encoding="utf-8"))["files"]]
    else:
        files = sorted((place / "snap").glob("*.vtkhdf"))
    if not files:
        raise FileNotFoundError(f"{path} is neither a run's directory with snapshots nor a snapshot")
    return files


def chosen(files: Sequence[Path], text: str) -> list[Path]:
    """Those that ``text`` names as Python does: ``-1``, ``0,5,10``, ``::2``, ``10:``.

    Raises:
        ValueError: not such a text, or no such snapshot.
    """
    picked: list[Path] = []
    for part in text.split(","):
        try:
            if ":" in part:
                picked += files[slice(*(int(bound) if bound.strip() else None for bound in part.split(":")))]
            else:
                picked.append(files[int(part)])
        except (ValueError, TypeError, IndexError):
            raise ValueError(f"frames must be such as -1, 0,5,10 or ::2 of {len(files)}, got {part!r}") from None
    if not picked:
        raise ValueError(f"frames {text!r} choose none of {len(files)}")
    return picked
