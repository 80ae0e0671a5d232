"""Kills, failing disks and flipped bits: nothing confirmed is lost, nothing damaged is used, no trace is left."""

import errno
import os
import random
import shutil
import subprocess
import sys

import numpy as np
import pytest
from kept_runs import contents, killed_until_done, plate, recording, run

from warp_eulsph.output import DamagedError, read_snapshot, record
from warp_eulsph.output.checkpoint import decode
from warp_eulsph.output.manifest import Manifest

LONG, SHORT = 6e-3, 4e-4
KILLS = 30


def begin(directory, until):
    """Start or resume a run with checkpoints every few steps."""
    simulation = plate()
    record(simulation, directory, until, recording(simulation, checkpoint=0.02), resume=True)


@pytest.mark.of_the_cpu
@pytest.mark.skipif(sys.platform == "win32", reason="no fork")
def test_thirty_kills_at_random_moments_lose_nothing(tmp_path):
    begin(tmp_path / "whole", LONG)
    expected = contents(tmp_path / "whole")
    rng, kills, runs = random.Random(1), 0, 0
    while kills < KILLS:
        runs += 1
        directory, confirmed = tmp_path / f"run {runs}", {}

        def look(directory=directory, confirmed=confirmed):
            manifest = Manifest(directory)
            manifest.read()
            confirmed |= {entry.name: entry.sha256 for entry in manifest.entries}
            for path in (directory / "snap").glob("*.vtkhdf"):
                assert read_snapshot(path).step == int(path.stem)  # whole, confirmed or not

        kills += killed_until_done(lambda directory=directory: begin(directory, LONG), KILLS - kills, rng, look)
        assert contents(directory) == expected
        manifest = Manifest(directory)
        manifest.read()
        assert confirmed.items() <= {entry.name: entry.sha256 for entry in manifest.entries}.items()


class Disk:
    """Stands between the package and the disk; ``fail`` decides whether a call fails, by its kind and number."""

    def __init__(self, monkeypatch, fail):
        self.calls = {"write": 0, "fsync": 0, "replace": 0}
        self.real = {kind: getattr(os, kind) for kind in self.calls}
        self.fail = fail
        for kind in self.calls:
            monkeypatch.setattr(os, kind, lambda *arguments, kind=kind: self.call(kind, *arguments))

    def call(self, kind, *arguments):
        self.calls[kind] += 1
        if self.fail(kind, self.calls[kind]):
            if kind == "write":  # half of it arrives
                self.real[kind](arguments[0], bytes(arguments[1])[: len(arguments[1]) // 2])
            raise OSError(errno.EIO, "Input/output error")
        return None if kind == "fsync" else self.real[kind](*arguments)


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """Contents of a short run without failures."""
    directory = tmp_path_factory.mktemp("short")
    run(directory, until=SHORT)
    return contents(directory)


def test_every_failing_write_fsync_and_rename(short, tmp_path, monkeypatch):
    """Fail the n-th call of each kind, for every n there is: a clean error, and a resume that leaves no trace."""
    with monkeypatch.context() as patch:
        disk = Disk(patch, lambda kind, n: False)
        run(tmp_path / "count", until=SHORT)
    assert min(disk.calls.values()) > 10
    raised = 0
    for kind, calls in disk.calls.items():
        for n in range(1, calls + 1):
            directory = tmp_path / f"{kind} {n}"
            with monkeypatch.context() as patch:
                Disk(patch, lambda k, i, kind=kind, n=n: (k, i) == (kind, n))
                try:
                    run(directory, until=SHORT)
                except OSError as error:
                    assert error.errno == errno.EIO
                    raised += 1
                Disk(patch, lambda kind, n: False)
                run(directory, until=SHORT, resume=True)
            assert contents(directory) == short, f"{kind} number {n}"
    # Only the note on how the run goes may fail unheard: two files, each a write, two fsyncs and a rename.
    assert raised >= sum(disk.calls.values()) - 8


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_full_disk_is_one_clean_error(short, tmp_path, monkeypatch, share):
    """Space for a share of the run, and none for anything until there is more."""
    run(tmp_path / "all", until=SHORT)
    space = share * sum(path.stat().st_size for path in (tmp_path / "all").rglob("*") if path.is_file())
    real, written = os.write, 0

    def write(descriptor, content):
        nonlocal written
        room = int(space) - written
        if room <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        written += (count := real(descriptor, bytes(content)[:room]))
        return count

    with monkeypatch.context() as patch:
        patch.setattr(os, "write", write)
        with pytest.raises(OSError, match="No space left on device"):
            run(tmp_path / "full", until=SHORT)
    for path in (tmp_path / "full" / "snap").glob("*"):
        assert read_snapshot(path).step == int(path.stem)
    run(tmp_path / "full", until=SHORT, resume=True)
    assert contents(tmp_path / "full") == short


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 300 kB, where a test may mount one: (path, function that makes it large)."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "tmpfs", str(place), "-o"]
    if shutil.which("mount") is None or subprocess.run([*mount, "size=300k"], capture_output=True).returncode != 0:
        pytest.skip("no right to mount a file system")
    yield place, lambda: subprocess.run([*mount, "remount,size=50m"], check=True)
    subprocess.run(["umount", str(place)], check=True)


def test_full_file_system_is_one_clean_error(small_disk, tmp_path):
    place, enlarge = small_disk
    with pytest.raises(OSError, match="No space left on device"):
        run(place / "run", until=LONG)
    manifest = Manifest(place / "run")
    manifest.read()
    assert len(manifest.entries) >= 2 and not manifest.damaged()
    enlarge()
    run(place / "run", until=LONG, resume=True)
    run(tmp_path / "whole", until=LONG)
    assert contents(place / "run") == contents(tmp_path / "whole")


def test_no_flipped_bit_goes_unseen(tmp_path):
    run(tmp_path, until=SHORT)
    content = sorted((tmp_path / "ckpt").glob("*.ckpt"))[-1].read_bytes()
    decode(content)
    rng = np.random.default_rng(0)
    for bit in rng.choice(8 * len(content), 1000, replace=False):
        flipped = bytearray(content)
        flipped[bit // 8] ^= 1 << bit % 8
        with pytest.raises(DamagedError):
            decode(bytes(flipped))
    for length in (0, 10, len(content) - 1):
        with pytest.raises(DamagedError):
            decode(content[:length])
