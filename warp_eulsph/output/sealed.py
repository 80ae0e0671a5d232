"""JSON that says when it is not what was written: every file and every line ends in a digest of the rest."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

KEY = "digest"
# No file of JSON that a run writes comes near; what is larger is not read into memory to find out.
_LARGEST = 2**28
_DIGITS = 16


class DamagedError(ValueError):
    """A file of a run that is not what was written."""


def seal(content: Mapping[str, Any]) -> dict[str, Any]:
    """``content`` with its digest."""
    plain = {key: value for key, value in content.items() if key != KEY}
    return {**plain, KEY: _digest(plain)}


def sealed_line(content: Mapping[str, Any]) -> str:
    """A line of JSON with its digest."""
    return json.dumps(seal(content))


def unseal(text: str) -> tuple[dict[str, Any], bool]:
    """Content of sealed JSON, without its digest, and whether it had one; those of older versions had none.

    Raises:
        DamagedError: not a table in JSON, or not what was written.
    """
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DamagedError(f"not JSON: {error}") from None
    if not isinstance(content, dict):
        raise DamagedError(f"not a table of JSON: {text[:40]!r}")
    if KEY not in content:
        return content, False
    digest = content.pop(KEY)
    if digest != _digest(content):
        raise DamagedError("its digest does not fit its content")
    return content, True


def read_text(path: Path) -> str:
    """The text of a file of JSON; bytes that are no UTF-8 are replaced, so that digests do not fit.

    Raises:
        OSError: it cannot be read.
        DamagedError: not a file, or too large to be one of a run.
    """
    if not path.is_file():
        raise DamagedError(f"{path} is not a file")
    if path.stat().st_size > _LARGEST:
        raise DamagedError(f"{path} has {path.stat().st_size} bytes, too many for what a run writes there")
    return path.read_text(encoding="utf-8", errors="replace")


@dataclass
class Lines:
    """The lines of a file, one sealed table each.

    Attributes:
        whole: content of those that are what was written.
        damaged: number, from 1, of those that are not.
        torn: whether the last one was cut short, as by a kill; it was never confirmed and is none of both.
    """

    whole: list[dict[str, Any]] = field(default_factory=list)
    damaged: list[int] = field(default_factory=list)
    torn: bool = False


def read_lines(path: Path, needs: Iterable[str] = ("step",)) -> Lines:
    """The lines of a file, which may be absent; whole ones have all keys that they ``needs``.

    In a file that has digests a line without one is damaged.

    Raises:
        OSError: it cannot be read.
        DamagedError: not a file.
    """
    if not path.exists():
        return Lines()
    text, needed = read_text(path), set(needs)
    *lines, rest = text.split("\n")
    found, bare = Lines(torn=bool(rest)), []
    for number, line in enumerate(lines, 1):
        try:
            content, had_digest = unseal(line)
        except DamagedError:
            found.damaged.append(number)
            continue
        if not needed <= content.keys() or not isinstance(content.get("step", 0), int):
            found.damaged.append(number)
            continue
        if not had_digest:
            bare.append((number, len(found.whole)))
        found.whole.append(content)
    if bare and len(bare) < len(found.whole):
        found.damaged = sorted([*found.damaged, *(number for number, _ in bare)])
        places = {place for _, place in bare}
        found.whole = [line for place, line in enumerate(found.whole) if place not in places]
    return found


def _digest(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:_DIGITS]
