"""Kills, failing disks and flipped bits: nothing confirmed is lost, nothing damaged is used, no trace is left."""

import errno
import os
import random
import shutil
import subprocess
import sys
from dataclasses import replace

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
        self.order = []
        self.real = {kind: getattr(os, kind) for kind in self.calls}
        self.fail = fail
        for kind in self.calls:
            monkeypatch.setattr(os, kind, lambda *arguments, kind=kind: self.call(kind, *arguments))

    def call(self, kind, *arguments):
        self.calls[kind] += 1
        self.order.append(kind)
        if self.fail(kind, self.calls[kind]):
            if kind == "write":  # half of it arrives
                self.real[kind](arguments[0], bytes(arguments[1])[: len(arguments[1]) // 2])
            raise OSError(errno.EIO, "Input/output error")
        return None if kind == "fsync" else self.real[kind](*arguments)

    def ends_of_files(self):
        """(kind, number) of each call, but of the writes in a row that make up a file the first and the last only."""
        numbers = dict.fromkeys(self.calls, 0)
        for before, kind, after in zip([None, *self.order], self.order, [*self.order[1:], None], strict=False):
            numbers[kind] += 1
            if kind != "write" or before != kind or after != kind:
                yield kind, numbers[kind]


def few(simulation):
    """The recording of ``run``, but one probe by steps and one by time: a file of every kind."""
    whole = recording(simulation)
    return replace(whole, probes=[whole.probes[0], whole.probes[-1]])


def run_few(directory, **options):
    """A short run with a file of every kind."""
    simulation = plate()
    record(simulation, directory, SHORT, few(simulation), **options)


@pytest.fixture(scope="module")
def short_few(tmp_path_factory):
    """Contents of such a run without failures."""
    directory = tmp_path_factory.mktemp("few")
    run_few(directory)
    return contents(directory)


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """Contents of a short run without failures."""
    directory = tmp_path_factory.mktemp("short")
    run(directory, until=SHORT)
    return contents(directory)


def test_every_failing_write_fsync_and_rename(short_few, tmp_path, monkeypatch):
    """Fail each call of each kind: a clean error, and a resume that leaves no trace."""
    with monkeypatch.context() as patch:
        disk = Disk(patch, lambda kind, n: False)
        run_few(tmp_path / "count")
    assert min(disk.calls.values()) > 10
    failing, raised = list(disk.ends_of_files()), 0
    assert len(failing) > 80
    for kind, n in failing:
        directory = tmp_path / f"{kind} {n}"
        with monkeypatch.context() as patch:
            Disk(patch, lambda k, i, kind=kind, n=n: (k, i) == (kind, n))
            try:
                run_few(directory)
            except OSError as error:
                assert error.errno == errno.EIO
                raised += 1
            Disk(patch, lambda kind, n: False)
            run_few(directory, resume=True)
        assert contents(directory) == short_few, f"{kind} number {n}"
    # Only the note on how the run goes may fail unheard: two files, each a write, two fsyncs and a rename.
    assert raised >= len(failing) - 8


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
