"""The command line: exit statuses, messages, and a run that is stopped, resumed, looked at and checked."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from warp_eulsph.cli import main
from warp_eulsph.commands.loading import examples, load_case
from warp_eulsph.commands.options import duration
from warp_eulsph.commands.progress import Progress
from warp_eulsph.output import Run

CASE = """
import numpy as np
import warp_eulsph as es
from warp_eulsph.output import PointProbe, Recording
from warp_eulsph.schedule import EveryTime

UNTIL = 2e-3


def build(n=6, young=17e6, push=0.0):
    s = (np.arange(n) + 0.5) / n
    x = np.stack(np.meshgrid(s, s, indexing="ij"), -1).reshape(-1, 2)
    rubber = es.NeoHookean(density=1100.0, young=young, poisson=0.45)
    body = es.Body(x=x, volume=1 / n**2, material=rubber, velocity=20.0 * np.sin(3.0 * x[:, ::-1]))
    held = es.Fixed(lambda X: X[:, 0] < 1 / n)
    driven = es.Velocity(lambda X: X[:, 0] > 1 - 1 / n, value=[-push, 0.0])
    cfl = 3.0 if push else 0.05
    steps = es.TimeStep(cfl=cfl)
    reference = es.Never() if push else es.Always()
    return es.Simulation(body, boundaries=[held, driven], time_step=steps, reference=reference)


def recording(simulation):
    return Recording(snapshots=EveryTime(5e-4), probes=[PointProbe(name="corner", X=(0.9, 0.9))])
"""
TOML = """
until = 1e-3
[parameters]
n = 6
[body.block]
shape = { kind = "box", lower = [0, 0], upper = [1, 1], spacing = "1/n" }
material = { kind = "NeoHookean", density = 1100, young = 17e6, poisson = 0.45 }
velocity = ["10*y", 0]
[output]
every = 4e-4
at = [5e-4]
steps = 1000
precision = "double"
fields = ["J"]
"""


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "plate.py"
    path.write_text(CASE)
    return path


def test_run_resume_info_check(case, tmp_path, capsys, caplog):
    caplog.set_level("INFO")
    whole, split = str(tmp_path / "whole"), str(tmp_path / "split")
    assert main(["run", str(case), "-o", whole]) == 0
    assert main(["run", str(case), "-o", split, "--max-wall", "0s"]) == 75
    assert "stopped by wall limit of 0 s at step 1, t = 2.7" in caplog.text
    assert f"warp-eulsph resume {split} goes on" in caplog.text
    case.rename(tmp_path / "elsewhere.py")  # the run keeps a copy
    Path(split).rename(tmp_path / "moved")
    assert main(["resume", str(tmp_path / "moved"), "--trust"]) == 0
    assert f"{case} is gone; using {tmp_path / 'moved' / 'case.py'}" in caplog.text
    one, two = Run(whole), Run(tmp_path / "moved")
    assert len(one) == len(two) == 5
    assert all(a.path.read_bytes() == b.path.read_bytes() for a, b in zip(one, two, strict=True))
    assert np.array_equal(one.probes["corner"]["x"], two.probes["corner"]["x"])

    capsys.readouterr()
    assert main(["info", whole]) == 0
    shown = capsys.readouterr().out
    for text in ("plate.py", "NeoHookean", "done", "5 of 36 particles", "corner", "checkpoints"):
        assert text in shown
    assert main(["info", whole, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["status"]["state"] == "done"

    assert main(["check", whole]) == 0
    assert "whole: 5 snapshots, 2 checkpoints, 1 tables" in capsys.readouterr().out
    damaged = bytearray(one[2].path.read_bytes())
    damaged[1000] ^= 1
    one[2].path.write_bytes(damaged)
    assert main(["check", whole]) == 2
    assert f"{one[2].path.name}: missing, or not what was written" in capsys.readouterr().out


def test_check_recovers_lists(case, tmp_path, capsys):
    directory = tmp_path / "run"
    assert main(["run", str(case), "-o", str(directory)]) == 0
    manifest = (directory / "manifest.jsonl").read_text()
    for name in ("manifest.jsonl", "run.vtkhdf", "run.vtkhdf.series"):
        (directory / name).unlink()
    last = sorted((directory / "snap").iterdir())[-1]
    last.write_bytes(last.read_bytes()[:500])
    assert main(["check", str(directory)]) == 2
    assert main(["check", str(directory), "--recover"]) == 0
    assert f"{last.name}: not what was written, moved to abandoned" in capsys.readouterr().out
    assert (directory / "manifest.jsonl").read_text() == "".join(manifest.splitlines(keepends=True)[:-1])
    assert len(Run(directory)) == 4 and (directory / "run.vtkhdf").exists()


def test_wrong_input_is_two(case, tmp_path, capsys):
    run = ["run", "-o", str(tmp_path / "run")]
    for arguments, message in [
        (["run", str(tmp_path / "absent.toml")], "no case file"),
        (["run", "example:puch"], "did you mean 'punch'?"),
        (["run", str(Path(__file__).parents[1] / "README.md")], "a case must be a .toml file, a .py file or example:"),
        (["run", __file__], "must define build(**settings) -> Simulation and UNTIL"),
        ([*run, str(case), "-s", "m=3"], "build has no setting 'm'; it has ['n', 'young', 'push']"),
        ([*run, str(case), "-s", "n"], "must be key=value"),
        ([*run, str(case), "-s", "young=-1.0"], "young must be positive"),
        ([*run, str(case), "--until", "nan"], "until must be finite"),
        (["resume", str(tmp_path)], "no run in"),
        (["info", str(tmp_path)], "no run in"),
        (["examples", "pnch"], "unknown example 'pnch'; did you mean 'punch'? examples are amplification, bar,"),
        ([*run, "punch"], "no case file punch; the example of that name is example:punch"),
        (["check", str(tmp_path)], "no run in"),
    ]:
        assert main(arguments) == 2
        error = capsys.readouterr().err
        assert message in error and "Traceback" not in error
    assert main([*run, str(case), "--until", "1e-4"]) == 0
    assert main([*run, str(case)]) == 2
    assert f"holds a run; go on with warp-eulsph resume {tmp_path / 'run'}, choose" in capsys.readouterr().err
    assert main([*run, str(case), "--until", "1e-4", "--replace"]) == 0
    case.write_text(CASE.replace("young=17e6", "young=18e6"))
    assert main(["resume", "--trust", str(tmp_path / "run"), "--until", "2e-4"]) == 2
    assert "simulation.bodies.body.material.young: 17000000.0, now 18000000.0" in capsys.readouterr().err
    assert main(["resume", "--trust", str(tmp_path / "run"), "--until", "2e-4", "--force"]) == 0


def test_unstable_run_is_three(case, tmp_path, capsys):
    assert main(["run", str(case), "-o", str(tmp_path / "run"), "-s", "push=300.0", "--until", "0.1"]) == 3
    assert "last good snapshot is" in capsys.readouterr().err
    run = Run(tmp_path / "run")
    assert run.state == "unstable"
    assert run.probes["corner"]["step"][-1] == run.status["step"] - 1  # all but the step that failed


def test_full_disk_is_one_and_can_be_resumed(case, tmp_path, capsys, monkeypatch):
    def fail(descriptor, content):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "write", fail)
        assert main(["run", str(case), "-o", str(tmp_path / "run")]) == 1
    assert "No space left on device" in capsys.readouterr().err


def test_toml_cases_and_examples(tmp_path, device):
    path = tmp_path / "block.toml"
    path.write_text(TOML)
    assert main(["run", str(path), "-o", str(tmp_path / "run"), "-s", "parameters.n=5"]) == 0
    run = Run(tmp_path / "run")
    assert run[0].N == 25 and run[0]["J"].dtype == np.float64 and run.fields == ["x", "J"]
    assert run.times.tolist() == [0.0, 4e-4, 5e-4, 8e-4, 1e-3]
    assert run.description["case"]["settings"]["parameters"]["n"] == 5
    path.unlink()
    assert main(["resume", str(tmp_path / "run"), "--until", "1.1e-3"]) == 0
    program = tmp_path / "program.py"
    path.write_text(TOML)
    program.write_text(f"from warp_eulsph.cases import read_case\nCASE = read_case({str(path)!r})\n")
    assert main(["run", str(program), "-o", str(tmp_path / "other"), "--device", device.alias]) == 0
    assert Run(tmp_path / "other")[0].N == 36
    assert main(["run", str(program), "-o", str(tmp_path / "third"), "-s", "n=3"]) == 2
    assert "punch" in examples()
    assert load_case("example:punch", ["parameters.n=8"]).build().x.shape == (64, 2)


def test_sigterm_is_75_and_resume_leaves_no_trace(case, tmp_path):
    """The command as a process of its own."""
    command = [sys.executable, "-m", "warp_eulsph"]
    assert main(["run", str(case), "-o", str(tmp_path / "whole"), "-s", "n=12"]) == 0
    process = subprocess.Popen([*command, "run", str(case), "-o", str(tmp_path / "run"), "-s", "n=12"])
    while not list((tmp_path / "run" / "snap").glob("*.vtkhdf")) and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(signal.SIGTERM)
    assert process.wait() == 75
    run = Run(tmp_path / "run")
    assert run.state == "stopped" and run.status["reason"] == "SIGTERM"
    assert subprocess.run([*command, "resume", "--trust", str(tmp_path / "run")]).returncode == 0
    names = sorted(path.name for path in (tmp_path / "whole" / "snap").iterdir())
    assert names == sorted(path.name for path in (tmp_path / "run" / "snap").iterdir())
    for name in names:
        assert (tmp_path / "whole/snap" / name).read_bytes() == (tmp_path / "run/snap" / name).read_bytes()


def test_progress_says_where_the_run_is(case, caplog, monkeypatch, capsys):
    simulation = load_case(str(case)).build()
    clock = iter(np.arange(0.0, 1000.0, 6.0))
    monkeypatch.setattr("warp_eulsph.commands.progress.time.monotonic", lambda: next(clock))
    with caplog.at_level("INFO"), Progress(2e-3, terminal=False) as progress:
        for _ in range(5):
            progress(simulation)
            simulation.step()
    assert len(caplog.records) == 2  # every second look, ten seconds being over
    for text in ("step 2", "dt = ", "particle-steps/s", "energy drift", "% of 0.002 s", "s left"):
        assert text in caplog.records[0].message
    with Progress(2e-3, terminal=True) as progress:
        for _ in range(3):
            progress(simulation)
            simulation.step()
    assert "particle-steps/s" in capsys.readouterr().err


def test_durations():
    assert [duration(text) for text in ("90", "90s", "1.5m", "3h", "2d")] == [90.0, 90.0, 90.0, 10800.0, 172800.0]
    with pytest.raises(SystemExit):
        main(["run", "example:punch", "--max-wall", "soon"])


def test_documented_programs_run(tmp_path, monkeypatch, capsys):
    """The Python of docs/runs.md, one block after the other; the first is a case file too."""
    text = (Path(__file__).parents[1] / "docs" / "runs.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    Path("column.py").write_text(blocks[0])
    assert main(["run", "column.py", "-s", "young=18e6", "--until", "0.01"]) == 0
    assert Run("runs/column").probe_names == ["base", "corner"]
    monkeypatch.chdir(tmp_path / "runs")
    names = {}
    for block in blocks:
        exec(compile(block, "runs.md", "exec"), names)
    assert names["run"].times[-1] == 0.03 and len(blocks) == 4
    assert names["data"].sizes["time"] == len(names["run"])


def test_help_loads_no_pictures_no_meshes_no_hdf5():
    code = (
        "import sys, warp_eulsph.cli\ntry: warp_eulsph.cli.main(['--help'])\nexcept SystemExit: pass\n"
        "print([m for m in ('h5py', 'matplotlib', 'vtk', 'pyvista', 'meshio', 'pydantic', 'tqdm') if m in sys.modules])"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert shown.strip().splitlines()[-1] == "[]"


def test_a_run_keeps_its_case_to_be_run_again(tmp_path, caplog):
    caplog.set_level("INFO")
    case = tmp_path / "block.toml"
    case.write_text(TOML)
    settings = ["-s", "parameters.n=5", "-s", "until=5e-4"]
    assert main(["run", str(case), *settings, "-o", str(tmp_path / "a"), "--max-wall", "0"]) == 75
    case.unlink()
    assert main(["run", str(tmp_path / "a" / "case.toml"), "-o", str(tmp_path / "b")]) == 0
    assert main(["resume", str(tmp_path / "a")]) == 0
    assert f"{case} is gone; using {tmp_path / 'a' / 'case.toml'}" in caplog.text
    one, two = Run(tmp_path / "a"), Run(tmp_path / "b")
    assert one[-1].N == 25 and one.times[-1] == 5e-4
    assert (tmp_path / "a" / "log.jsonl").read_bytes() == (tmp_path / "b" / "log.jsonl").read_bytes()
    assert all(a.path.read_bytes() == b.path.read_bytes() for a, b in zip(one, two, strict=True))
    # A later run makes room for its own.
    assert main(["run", str(tmp_path / "b" / "case.toml"), "-o", str(tmp_path / "a"), "--replace"]) == 0
    assert (tmp_path / "a" / "abandoned" / "0001" / "case.toml").exists()


def test_without_a_command_it_says_what_there_is(capsys):
    assert main([]) == 2
    said = capsys.readouterr().out
    assert all(f"    {name} " in said for name in ("run", "resume", "plot", "examples", "validate", "bench"))
    assert main(["--version"]) == 0
    assert re.fullmatch(r"warp-eulsph \S+ warp-lang \S+\n", capsys.readouterr().out)


def test_examples_are_listed_and_printed_to_start_from(tmp_path, capsys):
    assert main(["examples"]) == 0
    listed = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert listed.keys() == examples().keys() and listed["punch"] == "Punched rubber block"
    assert main(["examples", "punch"]) == 0
    printed = capsys.readouterr().out
    assert printed == examples()["punch"].read_text(encoding="utf-8")


def test_a_finished_run_says_that_nothing_is_left(case, tmp_path, caplog):
    caplog.set_level("INFO")
    assert main(["run", str(case), "-o", str(tmp_path / "run"), "--until", "1e-4"]) == 0
    assert "nothing left" not in caplog.text
    assert main(["resume", "--trust", str(tmp_path / "run"), "--until", "2e-4"]) == 0
    assert "nothing left" not in caplog.text
    assert main(["resume", "--trust", str(tmp_path / "run")]) == 0
    assert "there was nothing left to do; --until takes the run on to a later time" in caplog.text
