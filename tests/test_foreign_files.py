"""Files of others beside a run are left alone, and a folder from elsewhere runs nothing and reads nothing outside."""

import hashlib
import json
import os
import shutil
import tempfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from kept_runs import plate, run

from warp_eulsph.cli import main
from warp_eulsph.output import DamagedError, Run, RunDirectory, read_snapshot
from warp_eulsph.output.atomic import append_line, left_behind, move, replace_file, temporary_beside
from warp_eulsph.output.checkpoint import FORMAT, decode
from warp_eulsph.output.manifest import Manifest

SHORT = 8e-4


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    directory = tmp_path_factory.mktemp("foreign") / "run"
    run(directory, until=SHORT)
    return directory


@pytest.fixture
def copy(original, tmp_path):
    return shutil.copytree(original, tmp_path / "run")


def files(directory):
    return sorted(path for path in directory.rglob("*") if path.is_file() and path.name != "run.lock")


def test_a_resume_touches_no_file_of_others(copy, tmp_path):
    outside = tmp_path / "outside"
    outside.mkdir()
    mine = [
        outside / "mine.tmp",
        copy / "mine.tmp",
        copy / "snap" / "mine.tmp",
        copy / "notes" / "a.tmp",
        copy / "log.jsonl.tmp",
    ]
    for path in mine:
        path.parent.mkdir(exist_ok=True)
        path.write_text("mine")
    (copy / "linked").symlink_to(outside)
    target = tmp_path / "target"
    target.write_text("mine")
    for name in ("run.json.tmp", "status.json.tmp", "manifest.jsonl.tmp", "run.vtkhdf.tmp"):
        (copy / name).symlink_to(target)
    left = temporary_beside(copy / "snap" / "0000000011.vtkhdf")
    left.write_bytes(b"half")
    run(copy, until=2 * SHORT, resume=True)
    assert all(path.read_text() == "mine" for path in mine) and target.read_text() == "mine"
    assert not left.exists() and not list(left_behind(copy / "snap"))


@pytest.mark.parametrize("name", ["case.toml", "probes/mine.txt", "snap/photo.jpg", "stop", "log.jsonl", "run.json"])
def test_a_run_into_a_folder_with_files_of_others_is_refused(tmp_path, name, capsys):
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("{}" if name == "run.json" else "mine")
    before = {path: path.read_bytes() for path in files(tmp_path)}
    for options in ([], ["--replace"]):
        assert main(["run", "example:punch", "-o", str(tmp_path), *options]) == 2
    assert "which no run left there; choose a directory" in capsys.readouterr().err
    with pytest.raises(FileExistsError, match="which no run left there"):
        plate().run(1e-4, output=tmp_path)
    assert {path: path.read_bytes() for path in files(tmp_path)} == before


def test_other_files_may_lie_there(tmp_path):
    (tmp_path / "notes.md").write_text("mine")
    run(tmp_path, until=1e-4)
    assert (tmp_path / "notes.md").read_text() == "mine"


@pytest.mark.skipif(not os.path.isdir("/dev/shm"), reason="no second file system")
def test_snapshots_on_another_disk_move_too(copy, tmp_path):
    with tempfile.TemporaryDirectory(dir="/dev/shm") as other:
        shutil.move(copy / "snap", f"{other}/snap")
        (copy / "snap").symlink_to(f"{other}/snap")
        late = sorted((copy / "snap").glob("*.vtkhdf"))[-1]
        content = late.read_bytes()
        assert RunDirectory(copy).rewind(int(late.stem) - 1) is not None
        assert not late.exists() and (copy / "abandoned" / "0001" / "snap" / late.name).read_bytes() == content
        folder, there = tmp_path / "folder", Path(other) / "folder"
        (folder / "in").mkdir(parents=True)
        (folder / "in" / "a").write_text("a")
        (folder / "link").symlink_to("in")
        move(folder, there)
        assert (there / "in" / "a").read_text() == "a" and (there / "link").is_symlink() and not folder.exists()


def test_whole_files_are_written_through_no_link(tmp_path):
    target = tmp_path / "target"
    target.write_text("mine")
    (tmp_path / "file").symlink_to(target)
    replace_file(tmp_path / "file", b"new")
    assert target.read_text() == "mine" and not (tmp_path / "file").is_symlink()
    append_line(tmp_path / "lines", "one")
    assert (tmp_path / "lines").read_text() == "one\n"


# what comes from elsewhere


def test_programs_that_a_folder_names_run_only_if_trusted(tmp_path, capsys):
    ran = tmp_path / "ran"
    program = tmp_path / "evil.py"
    program.write_text(f"open({str(ran)!r}, 'w').close()\nUNTIL = 1.0\n")
    run(tmp_path / "run", until=1e-4)
    home = RunDirectory(tmp_path / "run")
    content = home.read(home.description)
    for source in (program, tmp_path / "gone.py"):
        home.write(home.description, content | {"case": {"source": str(source), "overrides": [], "device": None}})
        shutil.copy(program, home.path / "case.py")
        assert main(["resume", str(home.path)]) == 2
        assert "say --trust if it is yours" in capsys.readouterr().err and not ran.exists()
    for case in ({"source": 3}, [], {"source": "x.toml", "overrides": 3}, {"source": "x.toml", "device": 3}, "text"):
        home.write(home.description, content | {"case": case})
        assert main(["resume", str(home.path)]) == 2


def test_nothing_outside_a_snapshot_is_read(copy, tmp_path):
    secret = tmp_path / "secret"
    secret.write_bytes(np.arange(1000, dtype=np.float32).tobytes())
    path = sorted((copy / "snap").glob("*.vtkhdf"))[0]
    kept = path.read_bytes()

    def external(data):
        data.create_dataset("J", (36,), np.float32, external=[(str(secret), 0, 144)])

    def virtual(data):
        layout = h5py.VirtualLayout((36,), np.float32)
        layout[:] = h5py.VirtualSource(str(sorted((copy / "snap").glob("*.vtkhdf"))[1]), "VTKHDF/PointData/J", (36,))
        data.create_virtual_dataset("J", layout)

    def soft(data):
        data["J"] = h5py.SoftLink("/VTKHDF/PointData/pressure")

    def linked(data):
        data["J"] = h5py.ExternalLink(str(sorted((copy / "snap").glob("*.vtkhdf"))[1]), "VTKHDF/PointData/J")

    def huge(data):
        data.create_dataset("J", (10**13,), np.float32, chunks=(1000,))

    def bomb(data):
        data.create_dataset("J", data=np.zeros(10**7, np.float32), compression="gzip")

    def text(data):
        data.create_dataset("J", data=[b"a"] * 36)

    for change in (external, virtual, soft, linked, huge, bomb, text):
        with h5py.File(path, "r+") as file:
            data = file["VTKHDF/PointData"]
            attributes = dict(data["J"].attrs)
            del data["J"], file.attrs["sha256"]
            change(data)
            if change not in (soft, linked):
                data["J"].attrs.update({key: value for key, value in attributes.items() if key != "sha256"})
        with pytest.raises(DamagedError, match=r"J (is a link|is kept in another file|says it has)"):
            read_snapshot(path)
        path.write_bytes(kept)


def test_checkpoints_that_lie_about_sizes_are_refused():
    def made(header):
        content = FORMAT + json.dumps(header).encode() + b"\n" + bytes(64)
        return content + hashlib.sha256(content).digest()

    rest = {"time": 0.0, "step": 1, "counters": {}, "description": {}, "environment": {}}
    decode(made({**rest, "arrays": [["x", "<f8", [8]]]}))
    for arrays in (
        [["x", "<f8", [10**15]]],
        [["x", "<f8", [-1]]],
        [["x", "<f8", [-2, -4]]],
        [["x", "O", [8]]],
        [["x", "nonsense", [8]]],
        [["x", "<f8", [100]]],
        [["x"]],
        3,
    ):
        with pytest.raises(DamagedError):
            decode(made({**rest, "arrays": arrays}))
    for header in ({**rest}, [], 3, {**rest, "arrays": [], "step": "x"}):
        with pytest.raises(DamagedError):
            decode(made(header))


def test_names_that_lead_elsewhere_are_no_snapshots(copy):
    entries = Manifest(copy)
    entries.read()
    entries.replace([entries.entries[0]._replace(name="snap/../../secret.vtkhdf"), *entries.entries[1:]])
    with pytest.raises(DamagedError):
        Manifest(copy).read()
    assert all(frame.path.parent == copy / "snap" for frame in Run(copy))
