"""A run's directory damaged in every way: it is said, nothing whole is lost, and nothing is a traceback."""

import json
import os
import random
import shutil

import h5py
import pytest
from kept_runs import contents, plate, recording, run

from warp_eulsph.cli import main
from warp_eulsph.output import DamagedError, Run, check, read_snapshot, record, recover

SHORT = 8e-4
JSON = ("run.json", "env.json", "status.json")
LINES = ("manifest.jsonl", "log.jsonl", "probes.jsonl")


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    directory = tmp_path_factory.mktemp("damage") / "run"
    run(directory, until=SHORT)
    assert check(directory).problems == []
    return directory


@pytest.fixture(scope="module")
def longer(original, tmp_path_factory):
    """What the run is when it went on without damage."""
    directory = shutil.copytree(original, tmp_path_factory.mktemp("longer") / "run")
    run(directory, until=2 * SHORT, resume=True)
    return contents(directory)


@pytest.fixture
def copy(original, tmp_path):
    return shutil.copytree(original, tmp_path / "run")


def files(directory):
    return sorted(path for path in directory.rglob("*") if path.is_file() and path.name != "run.lock")


def numbers_in(path):
    """Places of digits in a file's text that are part of a value."""
    return [k for k, byte in enumerate(path.read_bytes()) if chr(byte).isdigit()]


def values_of(content):
    """What the bytes of a file of JSON, or of lines of it, say; None where they say nothing."""
    try:
        return [json.loads(text) for text in ([content] if content.count(b"\n{") == 0 else content.splitlines())]
    except ValueError:
        return None


@pytest.mark.parametrize("name", [*JSON, *LINES])
def test_no_changed_digit_goes_unseen(original, tmp_path, name):
    copy = shutil.copytree(original, tmp_path / "run")
    content = (copy / name).read_bytes()
    rng = random.Random(name)
    places = numbers_in(copy / name)
    for place in rng.sample(places, min(40, len(places))):
        changed = bytearray(content)
        changed[place] = ord(rng.choice([c for c in "0123456789" if ord(c) != content[place]]))
        if values_of(changed) == values_of(content):
            continue  # the last of seventeen digits, which tells no other number
        (copy / name).write_bytes(changed)
        assert check(copy).problems, f"{name}, byte {place}: {content[place - 20 : place + 20]}"
    (copy / name).write_bytes(content)
    assert not check(copy).problems


def test_no_changed_value_of_a_snapshot_or_table_is_read(copy, caplog):
    path = sorted((copy / "snap").glob("*.vtkhdf"))[1]
    for name in ("VTKHDF/Points", "VTKHDF/PointData/velocity", "VTKHDF/PointData/body"):
        kept = path.read_bytes()
        with h5py.File(path, "r+") as file:
            file[name][3] += 1
        with pytest.raises(DamagedError, match="is not what was written"):
            read_snapshot(path)
        field = {"Points": "x"}.get(name.split("/")[-1], name.split("/")[-1])
        with pytest.raises(DamagedError, match="is not what was written"):
            Run(copy)[1][field]
        assert any(path.name in problem for problem in check(copy).problems)
        path.write_bytes(kept)
    for attribute, value in (("time", 1.0), ("step", 5), ("dimension", 3)):
        kept = path.read_bytes()
        with h5py.File(path, "r+") as file:
            file.attrs[attribute] = value
        with pytest.raises(DamagedError, match="not what was written"):
            read_snapshot(path)
        path.write_bytes(kept)
    piece, rows = next((copy / "probes" / "corner").glob("*.h5")), len(Run(copy).probes["corner"]["t"])
    with h5py.File(piece, "r+") as file:
        file["t"][0] = 1.0
    assert f"probes/corner/{piece.name}: not what was written" in check(copy).problems
    assert len(Run(copy).probes["corner"]["t"]) < rows and f"{piece.name}: not what was written" in caplog.text


def test_a_deleted_piece_is_missed(tmp_path, caplog):
    simulation = plate()
    record(simulation, tmp_path, SHORT, recording(simulation, checkpoint=1e-9))
    pieces = sorted((tmp_path / "probes" / "corner").glob("*.h5"))
    rows = len(Run(tmp_path).probes["corner"]["t"])
    assert len(pieces) > 3 and not check(tmp_path).problems
    pieces[2].unlink()
    assert check(tmp_path).problems == [f"probes/corner/{pieces[2].name}: missing"]
    assert len(Run(tmp_path).probes["corner"]["t"]) < rows
    assert f"{pieces[2].name}: missing; its rows are left out" in caplog.text
    shutil.rmtree(tmp_path / "probes" / "whole")
    assert any("probes/whole" in problem for problem in check(tmp_path).problems)


def test_recovery_launders_no_damage(copy, capsys):
    bad = sorted((copy / "snap").glob("*.vtkhdf"))[1]
    with h5py.File(bad, "r+") as file:
        file["VTKHDF/PointData/velocity"][0] = 7.0
    changed = bad.read_bytes()
    assert main(["check", str(copy)]) == 2
    assert recover(copy) == [f"snap/{bad.name}: not what was written, moved to abandoned"]
    assert not bad.exists() and (copy / "abandoned" / "0001" / "snap" / bad.name).read_bytes() == changed
    assert not check(copy).problems and bad.name not in (copy / "manifest.jsonl").read_text()
    # Without a manifest the digests within tell it
    other = sorted((copy / "snap").glob("*.vtkhdf"))[0]
    with h5py.File(other, "r+") as file:
        file["VTKHDF/Points"][0] = 7.0
    (copy / "manifest.jsonl").unlink()
    assert recover(copy) == [f"snap/{other.name}: not what was written, moved to abandoned"]


def test_a_resume_launders_no_damage_either(copy):
    snapshots = sorted((copy / "snap").glob("*.vtkhdf"))
    snapshots[0].write_bytes(snapshots[0].read_bytes() + b"more")
    run(copy, until=2 * SHORT, resume=True)
    assert not snapshots[0].exists() and (copy / "abandoned" / "0001" / "snap" / snapshots[0].name).exists()
    assert not check(copy).problems


@pytest.mark.parametrize("line", [0, 2, -2])
def test_a_flipped_bit_in_the_log_costs_that_line(copy, line, caplog):
    log = copy / "log.jsonl"
    lines = log.read_bytes().splitlines(keepends=True)
    whole = Run(copy).log
    broken = bytearray(lines[line])
    broken[12] ^= 0x40
    lines[line] = bytes(broken)
    log.write_bytes(b"".join(lines))
    left = Run(copy).log
    assert len(left["t"]) == len(whole["t"]) - 1 and set(left["t"]) < set(whole["t"])
    assert any("log.jsonl: line" in problem for problem in check(copy).problems)
    damaged = log.read_bytes()
    run(copy, until=2 * SHORT, resume=True)
    assert set(left["t"]) <= set(Run(copy).log["t"]) and not check(copy).problems
    assert (copy / "abandoned" / "0001" / "log.jsonl").read_bytes() == damaged


@pytest.mark.parametrize(
    "content", [b"", b"\x00\xff\xfe", b"[]", b"3", b"{", b'{"step": "x"}\n', b"[" * 100_000, b"null\n"]
)
@pytest.mark.parametrize("name", ["status.json", "env.json", "log.jsonl", "manifest.jsonl", "probes.jsonl"])
def test_damage_beside_a_whole_checkpoint_blocks_no_resume(original, longer, tmp_path, name, content):
    copy = shutil.copytree(original, tmp_path / "run")
    (copy / name).write_bytes(content)
    run(copy, until=2 * SHORT, resume=True)
    assert contents(copy)["state"] == longer["state"]
    assert all(problem.endswith("not in probes.jsonl; recover lists it") for problem in check(copy).problems)
    assert name == "probes.jsonl" or not check(copy).problems
    assert not recover(copy) and not check(copy).problems


def commands(directory, tmp_path):
    """Every command that looks at a run, each with its exit status."""
    for arguments in (
        ["info", str(directory)],
        ["info", str(directory), "--json"],
        ["check", str(directory)],
        ["export", str(directory), str(tmp_path / "out.csv")],
        ["export", str(directory), str(tmp_path / "out.vtkhdf")],
        ["resume", str(directory)],
        ["check", str(directory), "--recover"],
    ):
        yield arguments, main(arguments)


ODD = {
    "a folder": lambda path: path.mkdir(),
    "empty": lambda path: path.write_bytes(b""),
    "text": lambda path: path.write_text("hello\n"),
    "binary": lambda path: path.write_bytes(bytes(range(256)) * 20),
    "a list": lambda path: path.write_text('[{"step": []}]\n'),
    "another table": lambda path: path.write_text('{"step": -1, "time": {}, "case": [], "until": "x", "files": 3}\n'),
    "a dead link": lambda path: path.symlink_to(path.parent / "nowhere"),
}


CASE = (
    'until = 1e-3\n[parameters]\nn = 4\n[body.block]\nshape = { kind = "box", lower = [0, 0], upper = [1, 1], '
    'spacing = "1/n" }\nmaterial = { kind = "NeoHookean", density = 1100, young = 17e6, poisson = 0.45 }\n'
    'velocity = ["10*y", 0]\n[output]\nevery = 4e-4\n[[probe]]\nkind = "BodyProbe"\nname = "whole"\n'
)


def mutated(directory, seed):
    """Do one to three of many things to the folder; what was done."""
    rng, done = random.Random(seed), []
    for _ in range(rng.randint(1, 3)):
        there = files(directory)
        path = rng.choice(there) if rng.random() < 0.6 else directory / rng.choice((*JSON, *LINES))
        kind = rng.choice(["odd", "flip", "cut", "delete", "stray", "double", "folder"])
        if kind == "odd":
            name = rng.choice(list(ODD))
            if path.exists():
                path.unlink()
            path.parent.mkdir(exist_ok=True)
            ODD[name](path)
            done.append(f"{path.name} is {name}")
        elif kind == "stray":
            folder = rng.choice([directory, directory / "snap", directory / "ckpt", directory / "probes"])
            name = rng.choice(["notes.vtkhdf", "12.vtkhdf", "x.ckpt", "notes.h5", "0001x", "٣.vtkhdf", "99.ckpt"])
            if folder.is_dir():
                rng.choice(list(ODD.values())[:5])(folder / name) if not (folder / name).exists() else None
                done.append(f"{name} in {folder.name}")
        elif kind == "folder":
            folder = directory / rng.choice(["snap", "ckpt", "probes", "abandoned"])
            if folder.is_dir():
                shutil.rmtree(folder)
            elif folder.exists():
                folder.unlink()
            if rng.random() < 0.5:
                folder.write_text("not a folder")
            done.append(f"{folder.name} gone")
        elif not path.is_file():
            continue
        elif kind == "flip":
            content = bytearray(path.read_bytes())
            for _ in range(rng.choice([1, 1, 20])):
                if content:
                    content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
            path.write_bytes(content)
            done.append(f"bits of {path.name}")
        elif kind == "cut":
            content = path.read_bytes()
            path.write_bytes(content[: rng.randrange(len(content) + 1)])
            done.append(f"cut {path.name}")
        elif kind == "delete":
            path.unlink()
            done.append(f"no {path.name}")
        else:
            path.write_bytes(path.read_bytes() * 2)
            done.append(f"twice {path.name}")
    return ", ".join(done)


def test_mutated_folders_are_never_a_traceback_and_lose_nothing_whole(tmp_path, capsys):
    case = tmp_path / "plate.toml"
    case.write_text(CASE)
    assert main(["run", str(case), "-o", str(tmp_path / "run")]) == 0
    whole = {path.read_bytes() for path in files(tmp_path / "run") if path.suffix in (".vtkhdf", ".h5")}
    for seed in range(int(os.environ.get("WARP_EULSPH_MUTATIONS", "20"))):
        directory = shutil.copytree(tmp_path / "run", tmp_path / f"mutated {seed}")
        done = mutated(directory, seed)
        kept = {path.read_bytes() for path in files(directory)} & whole
        for arguments, status in commands(directory, tmp_path):
            assert status in (0, 2, 3), (seed, done, arguments)
        assert "Traceback" not in capsys.readouterr().err, (seed, done)
        lost = [content for content in kept if content not in {path.read_bytes() for path in files(directory)}]
        derived = {path.read_bytes() for path in (tmp_path / "run").glob("run.vtkhdf")}  # made anew at will
        assert not set(lost) - derived, (seed, done)
        shutil.rmtree(directory)
