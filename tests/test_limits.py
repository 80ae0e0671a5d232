"""What would take all memory, all time or a name that no file can have is refused before it begins."""

import os
import subprocess
import sys
import time

import numpy as np
import pytest
import warp as wp
from kept_runs import plate, recording

from warp_eulsph import memory
from warp_eulsph.cases import read_case
from warp_eulsph.cases.expressions import device_function, parse
from warp_eulsph.cases.reading import CaseError
from warp_eulsph.cli import main
from warp_eulsph.geometry import annulus, box, nodes, sphere
from warp_eulsph.output import BodyProbe, record
from warp_eulsph.schedule import EverySteps, EveryTime
from warp_eulsph.space import Space

CASE = """
until = 1e-3
{top}
[body.block]
shape = {{ kind = "box", lower = [0, 0], upper = [1, 1], spacing = {spacing} }}
material = {{ kind = "NeoHookean", density = 1100, young = 17e6, poisson = 0.45 }}
velocity = ["{velocity}", 0]
"""


def written(path, spacing="0.25", velocity="y", top=""):
    path.write_text(CASE.format(spacing=spacing, velocity=velocity, top=top), encoding="utf-8")
    return path


NESTED = {
    "hypot": lambda depth: "hypot(" * depth + "x" + ", 1)" * depth,
    "hypot on the right": lambda depth: "hypot(1, " * depth + "x" + ")" * depth,
    "chain": lambda depth: "(1 if 0 < " * depth + "x" + " < 2 else 0)" * depth,
    "min": lambda depth: "min(1, " * depth + "x" + ")" * depth,
    "smoothstep": lambda depth: "smoothstep(" * depth + "x" + ")" * depth,
}


@pytest.mark.parametrize("nested", NESTED.values(), ids=NESTED)
def test_source_grows_in_proportion_to_the_formula(nested, monkeypatch):
    lengths = []
    monkeypatch.setattr(
        "warp_eulsph.cases.expressions._compiled",
        lambda lines, parts, space: lengths.append(sum(map(len, (*lines, *parts)))),
    )
    for depth in (5, 10, 20):
        device_function([parse(nested(depth), ["x"])], {}, Space(2))
    assert lengths[2] - lengths[1] < 2.5 * (lengths[1] - lengths[0])


@pytest.mark.parametrize(
    "text",
    [
        "hypot(hypot(x, y), hypot(y, t))",
        "1 if 0 < x + y <= 2*x < y + 3 else 2",
        "1 if x < (2 if 0 < y < 1 else 3) < t else 4",
    ],
)
def test_functions_and_chains_are_the_same_on_host_and_device(text):
    expression, space = parse(text, ["x", "y", "t"]), Space(2)
    function, row = device_function([expression], {}, space), space.row(1)

    @wp.kernel(enable_backward=False, module="unique")
    def evaluate(x: wp.array(dtype=space.vec), t: wp.float64, out: wp.array(dtype=row)):
        a = wp.tid()
        out[a] = function(x[a], t)

    x = np.random.default_rng(0).uniform(-1.0, 4.0, (200, 2))
    out = wp.zeros(len(x), dtype=row)
    wp.launch(evaluate, len(x), [wp.array(x, dtype=space.vec), 2.5, out])
    expected = expression({"x": x[:, 0], "y": x[:, 1], "t": 2.5})
    assert np.allclose(out.numpy()[:, 0], expected, rtol=1e-15)


@pytest.mark.parametrize("name", ["\uff58", "\uff4e", "\u00b5"])  # full-width x and n, the micro sign
def test_letters_that_mean_others_are_refused(name, tmp_path):
    with pytest.raises(CaseError, match=r"must be named by letters.*its letters mean"):
        read_case(written(tmp_path / "case.toml", top=f'[parameters]\n"{name}" = 3'))
    with pytest.raises(CaseError, match="must be in plain letters, got"):
        read_case(written(tmp_path / "case.toml", velocity=f"2*{name}"))


@pytest.mark.parametrize(
    "make",
    [
        lambda: box([0.0] * 3, [1.0] * 3, 1e-3),
        lambda: nodes([0.0] * 3, [1.0] * 3, 1e-3),
        lambda: sphere([0.0] * 3, 0.5, 1e-3),
        lambda: box([0.0] * 2, [1.0] * 2, 3e-5),
        lambda: annulus((0.0, 0.0), 1.0, 2.0, 20_000),
    ],
)
def test_a_thousand_million_particles_are_refused_before_they_are_made(make, monkeypatch):
    monkeypatch.setattr(memory, "available", lambda device: 2**33)
    begin = time.perf_counter()
    with pytest.raises(MemoryError, match=r"GB to be laid out, and 8\.59 GB are available; increase the spacing"):
        make()
    assert time.perf_counter() - begin < 1.0


def test_a_case_that_does_not_fit_is_wrong_input(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(memory, "available", lambda device: 2**20)
    assert main(["run", str(written(tmp_path / "a.toml", spacing="1e-3")), "-o", str(tmp_path / "run")]) == 2
    assert "does not fit into memory; increase the spacing" in capsys.readouterr().err
    assert main(["run", str(written(tmp_path / "b.toml", spacing="0.02")), "-o", str(tmp_path / "run")]) == 2
    assert "use fewer particles, float32, or a smaller dilation" in capsys.readouterr().err


def test_a_huge_dilation_counts_no_more_neighbours_than_there_are(device):
    assert memory.bytes_per_particle(Space(3), 1e200, True, device, 1000) < 1e5


def group(folder, limit, used, *, old=False, inactive=0):
    folder.mkdir(parents=True, exist_ok=True)
    names = ("memory.limit_in_bytes", "memory.usage_in_bytes") if old else ("memory.max", "memory.current")
    for name, value in zip(names, (limit, used), strict=True):
        (folder / name).write_text(f"{value}\n")
    (folder / "memory.stat").write_text(f"anon 5\ninactive_file {inactive}\n")


def test_memory_groups_are_seen_in_both_versions(tmp_path):
    own = tmp_path / "cgroup"
    group(tmp_path / "2" / "job", 1000, 700, inactive=100)
    group(tmp_path / "2" / "job" / "step", "max", 700)
    group(tmp_path / "2", 5000, 1000)
    own.write_text("0::/job/step\n")
    assert memory.of_groups(tmp_path / "2", own) == [400, 4000]
    group(tmp_path / "1" / "memory" / "job", 1000, 400, old=True)
    own.write_text("3:cpu,cpuacct:/x\n2:memory:/job\n")
    assert memory.of_groups(tmp_path / "1", own) == [600]
    own.write_text("0::/../elsewhere\n")
    assert memory.of_groups(tmp_path / "1", own) == []
    assert memory.of_groups(tmp_path, tmp_path / "absent") == []


@pytest.mark.parametrize("interval", [1e-25, 1e-12])
def test_intervals_that_nobody_can_wait_for_are_refused(interval, tmp_path):
    for go in (
        lambda: plate().run(1.0, every=interval, output=tmp_path / "run"),
        lambda: plate().run(1.0, every=interval),
        lambda: record(plate(), tmp_path / "run", 1.0, recording(plate(), probes=[], snapshots=EveryTime(interval))),
    ):
        with pytest.raises(ValueError, match=r"interval must be at least 1/1e\+09 of the time from 0"):
            go()
    assert not (tmp_path / "run" / "run.json").exists()
    with pytest.raises(ValueError, match="long enough to be told apart"):
        EveryTime(1e-25).next_time(1.0)


def test_schedules_take_numbers_only():
    for make in (lambda: EveryTime("1"), lambda: EveryTime(None), lambda: EverySteps(1.5), lambda: EverySteps(True)):
        with pytest.raises(ValueError, match="must be"):
            make()


def test_names_of_probes_are_names_of_folders():
    for name in ("a" * 300, "\uff41", "a/b", "", 3, None):
        with pytest.raises(ValueError, match="probe name must be of"):
            BodyProbe(name=name)
    BodyProbe(name="grün-1")


@pytest.mark.parametrize("given", ["0", "abc", "1.5"])
def test_a_wrong_environment_is_one_line(given, tmp_path):
    case = written(tmp_path / "case.toml")
    command = [sys.executable, "-m", "warp_eulsph", "run", str(case), "-o", str(tmp_path / "run")]
    done = subprocess.run(
        command, env={**os.environ, "WARP_EULSPH_THREADS": given}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert "WARP_EULSPH_THREADS must be a number of threads, from 1 to 9999, got" in done.stderr
