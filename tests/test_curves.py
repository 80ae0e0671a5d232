"""Curves of a run by name: the numbers of its log and tables, and the command that draws and writes them."""

import numpy as np
import pytest
from kept_runs import run as kept_run

from warp_eulsph.cli import main
from warp_eulsph.output import Run
from warp_eulsph.output.history import history, names


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    directory = tmp_path_factory.mktemp("run")
    kept_run(directory)
    return Run(directory)


def test_figures_are_those_of_the_tables(run):
    corner, hold = run.probes["corner"], run.probes["hold"]
    cases = {
        "log.kinetic": (run.log["kinetic"], "log.kinetic"),
        "log.momentum.y": (run.log["momentum"][:, 1], "log.momentum.y"),
        "corner.x.y": (corner["x"][:, 1], "corner.x.y [m]"),
        "corner.u.x": (corner["x"][:, 0] - corner["x"][0, 0], "corner.u.x [m]"),
        "corner.cauchy_stress.xy": (corner["cauchy_stress"][:, 0, 1], "corner.cauchy_stress.xy [Pa]"),
        "hold.force.x": (hold["force"][:, 0], "hold.force.x [N]"),
    }
    for name, (values, label) in cases.items():
        found = history(run, name)
        np.testing.assert_array_equal(found.values, values)
        assert found.label == label and len(found.t) == len(values) and (np.diff(found.t) > 0.0).all()
    assert cases.keys() <= {*names(run)} and not {"log.t", "log.step"} & {*names(run)}
    for name in names(run):
        assert np.isfinite(history(run, name).values).all()


def test_names_that_are_not_there_are_named(run):
    for name in ("corner.x", "corner.x.z", "corner.y", "nowhere.x", "log.t", ""):
        with pytest.raises(ValueError, match=r"has no history .*there are log\.dt, log\.kinetic"):
            history(run, name)
    with pytest.raises(ValueError, match=r"did you mean hold.force.x\?"):
        history(run, "hold.forc.x")


def test_command_lists_draws_and_writes(run, tmp_path, capsys):
    directory = str(run.directory.path)
    assert main(["curve", directory]) == 0
    assert capsys.readouterr().out.split() == names(run)
    picture, table = tmp_path / "a.png", tmp_path / "a.csv"
    assert main(["curve", directory, "hold.force.x", "hold.force.y", "--over", "corner.u.x", "-o", str(picture)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main(["curve", directory, "hold.force.x", "--over", "corner.u.x", "-o", str(table)]) == 0
    assert table.read_text().splitlines()[0] == "corner.u.x [m],hold.force.x [N]"
    written = np.loadtxt(table, delimiter=",", skiprows=1)
    np.testing.assert_array_equal(written[:, 1], run.probes["hold"]["force"][:, 0])
    over = history(run, "corner.u.x")
    np.testing.assert_array_equal(written[:, 0], np.interp(run.probes["hold"]["t"], over.t, over.values))


@pytest.mark.parametrize("arguments", [["nowhere"], ["RUN", "log.kinetik"], ["RUN", "log.kinetic", "-o", "a.txt"]])
def test_bad_commands_exit_2(run, arguments, capsys):
    assert main(["curve", *[str(run.directory.path) if word == "RUN" else word for word in arguments]]) == 2
    assert capsys.readouterr().err.startswith("warp-eulsph: ")
