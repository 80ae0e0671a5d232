"""What accompanies work at a terminal: a picture of a run that goes on, and completion in the shell."""

import os
import shutil
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from kept_runs import plate

from warp_eulsph.cli import main
from warp_eulsph.output import Recording, record
from warp_eulsph.schedule import EverySteps

SMALL = ["--size", "300,200"]


def test_a_run_is_drawn_as_it_goes_on(tmp_path, capsys):
    """Frames that come while somebody looks; the last one too; the file is an image at any time."""
    from PIL import Image

    directory, target, goes_on = tmp_path / "run", tmp_path / "now.png", threading.Event()

    def step_slowly(simulation):
        if simulation.steps == 2:
            goes_on.wait(60.0)  # until the first frames are drawn

    def run():
        record(plate(), directory, 1e-3, Recording(snapshots=EverySteps(1)), watch=step_slowly)

    runner = threading.Thread(target=run)
    runner.start()
    while not (directory / "manifest.jsonl").exists():
        time.sleep(0.01)

    def release():
        while not target.exists():
            time.sleep(0.01)
        goes_on.set()

    looker = threading.Thread(target=release)
    looker.start()
    assert main(["plot", str(directory), "--watch", "0.05", "-o", str(target), *SMALL]) == 0
    runner.join()
    looker.join()
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) >= 2 and lines[-1].startswith(f"{target}: t = 0.001 s, step ")
    assert np.asarray(Image.open(target)).shape == (200, 300, 3)
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_a_run_that_is_over_is_drawn_once(tmp_path, capsys):
    plate().run(1e-4, output=tmp_path / "run")
    assert main(["plot", str(tmp_path / "run"), "--watch", "-o", str(tmp_path / "a.png"), *SMALL]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 1


@pytest.mark.parametrize("arguments", [["-o", "a.gif"], ["--frames", "0"], ["--watch", "0"]])
def test_only_last_frames_are_watched(tmp_path, arguments, capsys):
    assert main(["plot", str(tmp_path), "--watch", *arguments]) == 2
    assert "--watch draws the last frame into a .png" in capsys.readouterr().err


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_bash_completes_commands_and_options(tmp_path):
    script = tmp_path / "completion"
    script.write_text(subprocess.check_output([sys.executable, "-m", "warp_eulsph", "completion", "bash"], text=True))

    def completed(*words):
        (tmp_path / "mine.toml").touch()
        line = (
            f"COMP_WORDS=({' '.join(words)}); COMP_CWORD={len(words) - 1}; _shtab_warp_eulsph; echo ${{COMPREPLY[@]}}"
        )
        done = subprocess.run(
            ["bash", "-c", f"source {script}; {line}"], capture_output=True, text=True, cwd=tmp_path, env=os.environ
        )
        return done.stdout.split()

    assert completed("warp-eulsph", "exp") == ["export"]
    assert completed("warp-eulsph", "plot", "--wat") == ["--watch"]
    assert completed("warp-eulsph", "run", "mi") == ["mine.toml"]
    assert completed("warp-eulsph", "completion", "z") == ["zsh"]


def test_completion_says_what_is_missing(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "shtab", None)
    assert main(["completion", "bash"]) == 2
    assert "pip install 'warp_eulsph[completion]'" in capsys.readouterr().err
