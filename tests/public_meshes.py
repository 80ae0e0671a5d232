"""Reads every mesh file of a folder and says what became of it: ``python tests/public_meshes.py FOLDER``.

Meshes of others are many and of every kind, and not ours to keep here. Each file is made a body in 3-D, or in 2-D if it
is flat, in a process of its own with a time limit. What is refused is read again with the repair that the message
names. Exit status 1 where a file is a traceback, hangs, or is refused without a word of what to do.
"""

import argparse
import collections
import concurrent.futures
import os
import re
import subprocess
import sys
from pathlib import Path

SECONDS = 300
# What a message must have that is of help: a repair, a tool, or what the file would have to hold.
WAYS_OUT = re.compile(r"repair=|weld=|mesh tool|in a plane|must have|must lie|bodies in 3-D are|convert|two spacings")


def attempt(path: str) -> str:
    """One line on what became of the file: what the call was, particles and volume, or the message."""
    from warp_eulsph.geometry import Repair, mesh, outline

    repairs = {"": None, "close": Repair(close=True), "turn": Repair(turn=True)}
    repairs |= {"turn and close": Repair(turn=True, close=True), "take": Repair(turn=True, take=True)}
    message = ""
    for words, repair in repairs.items():
        if repair is not None and "repair=" not in message:
            break
        try:
            x, volume = filled(lambda s, r=repair: mesh(path, s, **({} if r is None else {"repair": r})), path)
            return f"read{' with ' + words if words else ''}: {len(x)} particles, {volume.sum():.6g} m^3"
        except ValueError as error:
            message = message if "Repair" in message and "Repair" not in str(error) else str(error)
    try:
        x, volume = filled(lambda s: outline(path, s), path)
        return f"read as an outline: {len(x)} particles, {volume.sum():.6g} m^2"
    except ValueError as error:
        if "constant z" not in str(error) and "not a mesh" not in str(error):
            message = str(error)
    return f"refused{'' if WAYS_OUT.search(message) else ' WITHOUT A WAY OUT'}: {message}"


def filled(make, path):
    """What ``make`` gives at the first spacing of an eighth to a sixtieth of the size that is not too coarse."""
    import numpy as np

    from warp_eulsph.geometry.mesh_file import read_mesh

    file = read_mesh(path)
    used = np.unique(np.concatenate([cells.ravel() for cells in file.cells.values()]))
    size = float(np.ptp(file.points[used], axis=0).max())
    for across in (8, 20, 60):
        try:
            return make(size / across)
        except ValueError as error:
            if across == 60 or not re.search("too coarse|at least one cell", str(error)):
                raise
    raise AssertionError


def apart(path: Path) -> tuple[str, str]:
    """``attempt`` in a process of its own."""
    command = [sys.executable, __file__, "--one", str(path)]
    try:
        ran = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS)
    except subprocess.TimeoutExpired:
        return path.name, f"HANGS: {SECONDS} s"
    last = (ran.stdout.strip().splitlines() or [""])[-1]
    return path.name, last if ran.returncode == 0 else f"TRACEBACK: {(ran.stderr.strip().splitlines() or ['?'])[-1]}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="a folder of mesh files")
    parser.add_argument("--one", action="store_true", help="the argument is one file, read in this process")
    arguments = parser.parse_args()
    if arguments.one:
        print(attempt(str(arguments.folder)))
        return 0
    paths = sorted(path for path in arguments.folder.iterdir() if path.is_file())
    counts: collections.Counter[str] = collections.Counter()
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for name, line in pool.map(apart, paths):
            counts[line.split(":")[0]] += 1
            print(f"{name:50} {line.replace(str(arguments.folder), '')}", flush=True)
    print(f"\n{len(paths)} files")
    for outcome, count in counts.most_common():
        print(f"{count:5} {outcome}")
    return int(any(outcome.isupper() or "WITHOUT" in outcome for outcome in counts))


if __name__ == "__main__":
    sys.exit(main())
