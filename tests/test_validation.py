"""The command ``validate``: cases are found, run and judged; what it prints and how it ends."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

import warp_eulsph as es
from warp_eulsph.cli import main
from warp_eulsph.validation import Case, Figure, command, load_all, names
from warp_eulsph.validation.figures import difference, order
from warp_eulsph.validation.history import at, series

KEYS = {"case", "passed", "metrics", "bands", "reference", "source", "seconds"}


@pytest.fixture
def only(monkeypatch):
    """Let the command know these cases only."""

    def only(**runs):
        made = {name: Case(name, f"title of {name}", f"source of {name}", run) for name, run in runs.items()}
        monkeypatch.setattr(command.registry, "names", lambda: list(made))
        monkeypatch.setattr(command.registry, "load", made.__getitem__)
        monkeypatch.setattr(command.registry, "load_all", lambda: made)

    return only


def good(quick):
    print("a case that talks")
    return [Figure("error", 0.1 if quick else 0.01, 0.0, 0.2, 0.0), Figure("seen", 3.0)]


def outside(quick):
    return [Figure("error", 0.5, 0.0, 0.2, 0.0), Figure("undefined", float("nan"), high=1.0)]


def unstable(quick):
    raise es.UnstableError("particle 7 inverted", 7, 0.1, 12)


def test_all_cases_are_found_and_say_where_they_come_from():
    found = load_all()
    assert {"amplification", "bar", "piston", "punch", "spinning_plate", "twisting_column"} <= set(found)
    for name, case in found.items():
        assert case.name == name, f"module {name} holds the case {case.name}; give both one name"
        assert len(case.title) > 10 and case.source
        assert "\n" not in case.title + case.source
    assert list(found) == names()


def test_references_come_with_the_package():
    for path in (Path(command.__file__).parent / "reference").glob("*.csv"):
        columns = series(path.stem)
        assert at(columns, "t", columns["t"][3]) == columns["t"][3] and len(columns) > 5


def test_json_and_nothing_else(only, capfd):
    only(good=good, outside=outside)
    assert main(["validate", "--quick", "--json"]) == 1
    first, second = json.loads(capfd.readouterr().out)
    assert set(first) == KEYS
    assert first["case"] == "good" and first["passed"] is True
    assert first["metrics"] == {"error": 0.1, "seen": 3.0}
    assert first["bands"] == {"error": [0.0, 0.2], "seen": [None, None]}
    assert first["reference"] == {"error": 0.0, "seen": None}
    assert first["seconds"] >= 0.0
    assert second["passed"] is False and second["metrics"] == {"error": 0.5, "undefined": None}


def test_a_case_that_raises_does_not_hide_the_others(only, capfd):
    only(unstable=unstable, good=good)
    assert main(["validate", "--json"]) == 1
    failed, held = json.loads(capfd.readouterr().out)
    assert set(failed) == KEYS | {"error"}
    assert failed["passed"] is False and "particle 7 inverted" in failed["error"] and failed["metrics"] == {}
    assert held["passed"] is True and held["metrics"]["error"] == 0.01
    assert main(["validate"]) == 1
    printed = capfd.readouterr().out
    assert "UnstableError: particle 7 inverted" in printed and "FAILED" in printed and "1 of 2 cases hold" in printed


def test_tables_and_summary(only, capfd):
    only(good=good, outside=outside)
    assert main(["validate", "good"]) == 0
    printed = capfd.readouterr().out
    assert "title of good" in printed and "source of good" in printed and "title of outside" not in printed
    assert "a case that talks" not in printed
    assert "1 of 1 cases hold" in printed
    assert main(["validate", "good", "outside", "good"]) == 1
    assert "OUTSIDE: error, undefined" in capfd.readouterr().out


def test_unknown_name(only, capfd):
    only(good=good, outside=outside)
    assert main(["validate", "good", "outsied", "--json"]) == 2
    captured = capfd.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1 and "'outsied'" in captured.err and "did you mean 'outside'?" in captured.err


def test_list_runs_nothing(only, capfd):
    only(unstable=unstable)
    assert main(["validate", "--list"]) == 0
    assert capfd.readouterr().out.splitlines() == [
        "unstable",
        "    title of unstable",
        "    reference: source of unstable",
    ]


def test_help_is_quick_and_loads_no_pictures():
    start = time.perf_counter()
    shown = subprocess.run([sys.executable, "-m", "warp_eulsph", "--help"], capture_output=True, text=True, check=True)
    assert "validate" in shown.stdout
    assert time.perf_counter() - start < 20.0  # about one, nearly all of it Warp's; generous for a busy machine
    code = "import sys, warp_eulsph.cli; print([m for m in ('h5py', 'matplotlib', 'scipy') if m in sys.modules])"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert loaded.stdout.strip().splitlines()[-1] == "[]"


def test_measures():
    assert order([1.0, 2.0, 4.0], [1.0, 0.25, 0.0625]) == pytest.approx(2.0)
    assert difference([1.1, 2.2], [1.0, 2.0]) == pytest.approx(0.1)


def test_quick_run_of_fast_cases(capfd):
    """Figures that no change of the default scheme may spoil: symbols, published digits, orders of exact waves."""
    named = ["amplification", "cosine_profile", "hertz", "swinging_plate", "wall_impact"]
    assert main(["validate", *named, "--quick", "--json"]) == 0
    found = {outcome["case"]: outcome for outcome in json.loads(capfd.readouterr().out)}
    assert set(found) == set(named)
    metrics = found["swinging_plate"]["metrics"]
    assert min(metrics["order_v"], metrics["order_F"], metrics["order_P"]) >= 1.9
    assert all(name.replace("_", "").isalnum() for outcome in found.values() for name in outcome["metrics"])


def test_step_cost_tells_a_good_step_from_a_bad_one():
    """The midpoint step at CFL 0.8 gains energy on the spinning plate, Verlet's does not; rows have five columns."""
    from warp_eulsph.validation.cases import spinning_plate
    from warp_eulsph.validation.step_cost import PLAIN, measure

    rows = [measure(spinning_plate.build, 8, 0.02, es.Never(), step, 0.8) for step in (PLAIN, es.LaxWendroff())]
    good, bad = ([float(word) for word in row.split(" | ")] for row in rows)
    assert good[0] < 2e-3 < bad[0]
    assert good[1] < 1.0 < bad[1]
