"""``warp-eulsph bench``: what programs read of it, and that its measures measure."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from warp_eulsph import execution
from warp_eulsph.bench import command, contact_cost, equal_error, many_runs, mixing, passes, release, snapshot_cost
from warp_eulsph.bench.cases import CASES, MODES
from warp_eulsph.bench.machine import arithmetic, bandwidth
from warp_eulsph.bench.phases import PHASES
from warp_eulsph.cli import main
from warp_eulsph.memory import array_bytes

KEYS = {
    "case",
    "dim",
    "dtype",
    "mode",
    "particles",
    "neighbours",
    "threads",
    "particle_steps_per_second",
    "roof_fraction",
    "bytes_per_particle",
}


@pytest.fixture
def quick(monkeypatch):
    """A small case in every mode, timed for a moment, on a machine of given limits."""
    small = [case for case in CASES if case.name.endswith("2d-float64")]
    assert {case.mode for case in small} == set(MODES)
    monkeypatch.setattr(command, "CASES", tuple(dataclasses.replace(case, side=20) for case in small))
    monkeypatch.setattr(command, "SECONDS_PER_ROUND", 0.01)
    monkeypatch.setattr(command, "limits_of", lambda dtype, threads: (20e9, 50e9))


def test_names_of_cases_differ_and_cover_modes_dimensions_and_precisions():
    assert len({case.name for case in CASES}) == len(CASES)
    assert {(case.dim, case.dtype, case.mode) for case in CASES} == {
        (dim, dtype, mode) for dim in (1, 2, 3) for dtype in ("float32", "float64") for mode in MODES
    }


FIGURES = sorted((Path(__file__).parents[1] / "bench").glob("*.json"))


@pytest.mark.parametrize("path", FIGURES, ids=lambda path: path.stem)
def test_figures_of_releases_can_be_read(path):
    """Of a release that CHANGELOG.md knows, all cases of it, with the machine and how quiet it was."""
    figures = json.loads(path.read_text(encoding="utf-8"))
    assert figures["version"] == path.stem
    changes = (path.parents[1] / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## {path.stem}" in changes and np.datetime64(figures["date"]) >= np.datetime64("2026-01-01")
    assert figures["machine"]["name"] and figures["machine"]["cores"] >= 1 and figures["versions"]["warp-lang"]
    assert len({result["case"] for result in figures["results"]}) == len(figures["results"]) >= 18
    for result in figures["results"]:
        assert set(result) >= KEYS and result["particle_steps_per_second"] > 0.0 and 0.0 < result["roof_fraction"] < 1.0


def test_there_are_figures_of_this_release():
    version = re.search(r'^version = "(.*)"', (Path(__file__).parents[1] / "pyproject.toml").read_text(), re.MULTILINE)
    assert version[1] in {path.stem for path in FIGURES}


def test_figures_of_a_release_are_written_with_the_machine(quick, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(release, "CASES", tuple(case for case in command.CASES))
    figures = json.loads(release.main(["-o", str(tmp_path)]).read_text())
    assert [result["mode"] for result in figures["results"]] == list(MODES)
    assert figures["machine"]["cores"] == execution.cores()


def test_json_has_the_keys_and_plausible_values(quick, capsys):
    threads = execution.threads()
    assert main(["bench", "-k", "2d-float64", "--json"]) == 0
    *rubber, water = results = json.loads(capsys.readouterr().out)
    assert [result["mode"] for result in rubber] == list(MODES) and water["case"] == "liquid-2d-float64"
    for result in results:
        assert set(result) >= KEYS
        assert result["particles"] == 400
        widest = np.pi * (2.0 * (1.8 if result is water else 1.3)) ** 2  # less at faces
        assert 0.7 * widest < result["neighbours"] < widest
        assert 1e3 < result["particle_steps_per_second"] <= 2e7
        assert 0.0 < result["roof_fraction"] < 1.0
        assert 400.0 < result["bytes_per_particle"] < 4000.0
        assert set(result["phases"]) <= {*PHASES, "other"}
        assert sum(result["phases"].values()) > 0.0
    total, _, eulerian = rubber
    assert eulerian["phases"]["neighbour search"] > 0.0
    assert "neighbour search" not in total["phases"]
    assert eulerian["particle_steps_per_cpu_second"] < total["particle_steps_per_cpu_second"]
    assert execution.threads() == threads


def test_lines_for_people_name_case_rate_and_phases(quick, capsys):
    assert main(["bench", "-k", "total"]) == 0
    shown = capsys.readouterr().out
    assert "total-2d-float64: " in shown and "M particle-steps/s" in shown and "forces (M5, M9)" in shown


def test_unknown_case_is_named(capsys):
    assert main(["bench", "-k", "no such"]) == 2
    assert "no case is named like 'no such'; there are: total-1d-float32" in capsys.readouterr().err


def test_memory_counts_shared_arrays_once():
    class Holder:
        pass

    Holder.__module__ = "warp_eulsph.somewhere"
    array = wp.zeros(100, dtype=wp.vec3d)
    holder = Holder()
    holder.fields, holder.again, holder.part = {"a": array}, [array], array[10:20]
    holder.other = wp.zeros(7, dtype=wp.float32)
    assert array_bytes(holder) == 2400 + 28


@pytest.mark.of_the_cpu
@pytest.mark.parametrize("real", [wp.float32, wp.float64])
def test_limits_of_the_machine_are_of_this_world(real):
    """Between a tenth of a slow core and a large server."""
    execution.set_threads(1)
    assert 1e9 < bandwidth(real) < 2e12
    assert 1e9 < arithmetic(real) < 1e12


def test_cost_of_snapshots_is_measured(capsys):
    """A small block, one snapshot in the run; how long that takes is for a quiet machine to say."""
    figures = snapshot_cost.main(["--side", "12", "--steps", "60", "--rounds", "1"])
    assert set(figures) == {"step_ms", "stall_ms", "stall_percent", "processor_ms", "disk_ms", "cost_percent"}
    assert figures["step_ms"] > 0.0 and figures["processor_ms"] > figures["disk_ms"] > 0.0
    assert figures["stall_percent"] == pytest.approx(2.0 * figures["stall_ms"] / figures["step_ms"])
    assert "1728 particles" in capsys.readouterr().out


def test_cost_of_mixing_is_measured(capsys):
    """A small cube, stirred for a moment: it fits the caches, where the order of particles costs nothing."""
    threads = execution.threads()
    found = mixing.main(["--side", "8", "--steps", "20"])
    assert execution.threads() == threads
    assert set(found) == {"lattice", "left", "sorted", "look", "sort"}
    assert all(1e4 < found[name] < 1e8 for name in ("lattice", "left", "sorted"))
    assert found["look"] > 0.0 and found["sort"] > 0.0
    assert "M particle-steps per processor second" in capsys.readouterr().out


def test_many_runs_together_are_timed_beside_those_one_by_one(monkeypatch, capsys):
    for name, value in {"STEPS": 30, "ROUNDS": 1, "ALONE": 1, "TOGETHER": 10}.items():
        monkeypatch.setattr(many_runs, name, value)
    before = execution.threads()
    try:
        many_runs.main(["--bars", "3", "--independent"])
    finally:
        execution.set_threads(before)
    printed = capsys.readouterr().out
    assert "3 bars of 40 particles, 30 steps each" in printed and "as independent runs of one simulation" in printed


def test_cost_of_contact_is_timed_beside_steps_without(monkeypatch, capsys):
    monkeypatch.setattr(contact_cost, "ROUNDS", 1)
    monkeypatch.setattr(contact_cost, "BLOCKS", ((2, 10, 2),))
    before = execution.threads()
    try:
        contact_cost.main()
    finally:
        execution.set_threads(before)
    size, outermost, milliseconds, *shares = re.split(r"\s{2,}", capsys.readouterr().out.splitlines()[1])
    assert size == "2 x 10^2" and outermost == "36%" and float(milliseconds) > 0.0
    assert all(float(share.rstrip("%")) < 100.0 for share in shares)


def test_runs_beside_the_first_release_still_have_their_error(monkeypatch, capsys):
    """The bar, which is quick: the error that is recorded, within 5 %."""
    monkeypatch.setattr(equal_error, "FIRST_RELEASE", {"bar": equal_error.FIRST_RELEASE["bar"]})
    before = execution.threads()
    try:
        equal_error.main(["--beside"])
    finally:
        execution.set_threads(before)
    then, recorded, here = (line.split("|") for line in capsys.readouterr().out.splitlines()[2:])
    assert max(float(row[4]) for row in (then, recorded, here)) < 0.0501
    assert float(here[4]) == pytest.approx(float(recorded[4]), rel=0.02)


@pytest.mark.of_the_cpu
def test_kernels_of_a_step_are_timed(monkeypatch):
    """A total Lagrangian step makes five sums over neighbours; their times and those of the rest make up the step's."""
    monkeypatch.setattr(passes, "SECONDS", 0.05)
    case = next(case for case in CASES if case.name == "total-2d-float64")
    threads = execution.threads()
    try:
        small = dataclasses.replace(case, side=40)
        first, again = passes.tables([small, small], rounds=2)
    finally:
        execution.set_threads(threads)
    lines = first.splitlines()
    assert "%" not in lines[0] and again.splitlines()[0].split()[8] == "%,"
    sums = {line.split()[0] for line in lines if line.endswith("per pair")}
    assert len(sums) == 5 and "sharpening.sharpen" in sums and "updates.kick" not in sums
    listed = [float(line.split()[1]) for line in lines[1:]]
    assert listed == sorted(listed, reverse=True)
    assert sum(listed) == pytest.approx(float(lines[0].split()[1]), rel=0.2)  # those below LEAST are not listed
    assert passes.main(["no such"]) == 2
