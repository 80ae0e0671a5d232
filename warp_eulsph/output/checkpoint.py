"""Checkpoints: everything that evolves in a run, in its own precision, under one digest.

A file is a line that names the format, a line of JSON (time, step, counters, names, types and shapes of the arrays, the
simulation's description and environment), the arrays' bytes one after the other, and the SHA-256 of all of that. No
bit of it lies outside the digest.
"""

import hashlib
import json
import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .atomic import replace_file
from .directory import numbered
from .recorded import Recorded
from .sealed import DamagedError

log = logging.getLogger(__name__)

FORMAT = b"warp_eulsph checkpoint 1\n"
KEPT = 2
_DIGEST = hashlib.sha256().digest_size


@dataclass(frozen=True)
class Checkpoint:
    """A run at the end of a step.

    Attributes:
        time: [s]. step: steps taken.
        counters: numbers beside the arrays (``counters`` of the simulation).
        arrays: copies of what evolves (``evolving()`` of the simulation), on the host.
        description: of the simulation (see ``describe``). environment: versions and device.
    """

    time: float
    step: int
    counters: dict[str, float]
    arrays: dict[str, np.ndarray]
    description: dict[str, Any]
    environment: dict[str, Any]


def take(simulation: Recorded, description: Mapping[str, Any], environment: Mapping[str, Any]) -> Checkpoint:
    """The present state, copied to the host; BrokenError where that is the middle of a step."""
    simulation.whole.check()
    arrays = {name: np.array(array.numpy()) for name, array in simulation.evolving().items()}
    counters = simulation.counters
    return Checkpoint(simulation.t, simulation.steps, counters, arrays, dict(description), dict(environment))


def encode(checkpoint: Checkpoint) -> list[bytes | memoryview]:
    """The file of a checkpoint, part by part; the arrays are not copied."""
    header = {
        "time": checkpoint.time,
        "step": checkpoint.step,
        "counters": checkpoint.counters,
        "arrays": [[name, array.dtype.str, array.shape] for name, array in checkpoint.arrays.items()],
        "description": checkpoint.description,
        "environment": checkpoint.environment,
    }
    flat = (np.ascontiguousarray(array).reshape(-1).view(np.uint8) for array in checkpoint.arrays.values())
    parts: list[bytes | memoryview] = [FORMAT, json.dumps(header).encode() + b"\n"]
    parts += [memoryview(array) for array in flat]  # type: ignore[arg-type]
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return [*parts, digest.digest()]


def decode(content: bytes) -> Checkpoint:
    """The checkpoint in a file.

    Raises:
        DamagedError: the digest or the format is not right.
    """
    if hashlib.sha256(memoryview(content)[:-_DIGEST]).digest() != content[-_DIGEST:]:
        raise DamagedError(f"its SHA-256 does not fit its {len(content)} bytes")
    if not content.startswith(FORMAT):
        raise DamagedError(f"it begins with {content[: len(FORMAT)]!r}, not with {FORMAT!r}; another version wrote it")
    try:
        end = content.index(b"\n", len(FORMAT)) + 1
        header = json.loads(content[len(FORMAT) : end])
        arrays = {}
        for name, dtype, shape in header["arrays"]:
            count = math.prod(shape)
            if np.dtype(dtype).kind not in "iuf" or not 0 <= count <= len(content) or min(shape, default=0) < 0:
                raise ValueError(f"array {name!r} of type {dtype} and shape {shape}")
            arrays[name] = np.frombuffer(content, dtype, count, end).reshape(shape)
            end += arrays[name].nbytes
        rest = {name: header[name] for name in ("time", "step", "counters", "description", "environment")}
        checkpoint = Checkpoint(arrays=arrays, **rest)
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise DamagedError(f"its digest fits, and its content is none of a checkpoint: {error}") from None
    if not isinstance(checkpoint.step, int) or not isinstance(checkpoint.time, float | int):
        raise DamagedError("its digest fits, and its step and time are no numbers")
    return checkpoint


class Checkpoints:
    """The checkpoints of a run: ``0000001200.ckpt`` for step 1200, the last two of them.

    Args:
        folder: made with the first checkpoint.
    """

    def __init__(self, folder: Path):
        self.folder = folder

    def paths(self) -> list[Path]:
        """The files, oldest first."""
        return numbered(self.folder, ".ckpt")

    def write(self, checkpoint: Checkpoint) -> Path:
        """Add one and drop what is older than the last two; its path.

        Raises:
            OSError: the disk refused; those written before are whole.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"{checkpoint.step:010d}.ckpt"
        replace_file(path, *encode(checkpoint))
        for old in self.paths()[:-KEPT]:
            old.unlink()
        return path

    def newest(self) -> Checkpoint | None:
        """The newest whole one; None if there are no files. Damaged ones are named in a warning and skipped.

        Raises:
            DamagedError: there are files, and none is whole.
        """
        damaged = []
        for path in reversed(self.paths()):
            try:
                checkpoint = decode(path.read_bytes())
            except (DamagedError, OSError) as error:
                damaged.append(f"{path}: {error}")
                log.warning("checkpoint %s is damaged: %s; trying the one before", path, error)
                continue
            if damaged:
                log.warning("using checkpoint %s of step %d, t = %.8g s", path, checkpoint.step, checkpoint.time)
            return checkpoint
        if damaged:
            raise DamagedError(f"no checkpoint is whole, the run must start anew: {'; '.join(damaged)}")
        return None
