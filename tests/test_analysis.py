"""The scripts of analysis and the notebook run, small, and say what they should."""

import importlib
import re
import shutil
from pathlib import Path

import pytest

from warp_eulsph.cases import read_case
from warp_eulsph.output import record

ROOT = Path(__file__).parents[1]
ANALYSIS = ROOT / "examples" / "analysis"
CASES = ROOT / "examples" / "cases"


@pytest.fixture(scope="module")
def plates(tmp_path_factory):
    """Directories of the spinning plate over its first swing, 8, 16 and 32 particles across."""
    made = []
    for n in (8, 16, 32):
        case = read_case(CASES / "spinning_plate.toml", [f"parameters.n={n}", "until=6e-3", "output.every=2e-3"])
        made.append(tmp_path_factory.mktemp(f"plate{n}"))
        simulation = case.build()
        record(simulation, made[-1], case.until, case.recording(simulation))
    return made


@pytest.fixture
def script(monkeypatch):
    """The module of a script."""
    monkeypatch.syspath_prepend(str(ANALYSIS))
    return importlib.import_module


def test_energy_balance_closes(script, plates, capsys):
    shares = script("energy_balance").main([str(plates[0])])
    assert abs(shares["residual"]) < 1e-12 and 0.9 < shares["total"] <= 1.0 + 1e-4
    assert shares["kinetic"] + shares["stored"] + shares["tied"] == pytest.approx(shares["total"], abs=1e-12)
    assert (plates[0] / "energy_balance.png").stat().st_size > 10_000
    assert "dissipation" in capsys.readouterr().out


def test_probe_history_against_the_reference(script, plates):
    reference = ["--reference", str(ROOT / "warp_eulsph/validation/reference/spin2d105_2.csv"), "--column", "Rcorner"]
    main = script("probe_history").main
    coarse, middle, fine = (main([str(p), "corner", "x", "--component", "length", *reference]) for p in plates)
    # The probe extrapolates to the corner from particles that lie half a spacing inside.
    assert fine < middle < coarse < 0.1 and fine < 0.5 * coarse
    assert (plates[0] / "probe_history.png").stat().st_size > 10_000


def test_convergence_table(script, plates, capsys):
    convergence = script("convergence")
    (order,) = convergence.main([str(path) for path in plates])
    rows = [row.split() for row in capsys.readouterr().out.splitlines()]
    assert [row[0] for row in rows[1:]] == ["64", "256", "1024"] and float(rows[-1][-1]) == pytest.approx(
        order, abs=0.01
    )
    # Second order inside, first at free surfaces, and not asymptotic yet.
    assert 1.0 < order < 3.0
    assert convergence.orders([2.0, 2.0], [1.0, 0.5, 0.25]) == pytest.approx([1.0])
    assert convergence.orders([2.0, 2.0], [1.0, 0.75, 0.6875]) == pytest.approx([2.0])


def test_animation(script, plates):
    from PIL import Image

    with Image.open(script("animation").main([str(plates[0]), "--field", "von_mises"])) as shown:
        assert shown.n_frames == 4


def test_notebook_runs_from_case_to_pictures(tmp_path):
    """Executed as it is, in a copy of its folder; it holds no outputs itself."""
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(ANALYSIS / "case_to_pictures.ipynb", as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells)
    (tmp_path / "analysis").mkdir()
    shutil.copytree(CASES, tmp_path / "cases")
    resources = {"metadata": {"path": str(tmp_path / "analysis")}}
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources=resources).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    kinds = [kind for output in outputs for kind in output.get("data", {})]
    assert kinds.count("image/png") == 3 and kinds.count("image/gif") == 1
    printed = "".join(output.get("text", "") for output in outputs)
    assert abs(float(re.search(r"residual over energy: (\S+)", printed)[1])) < 1e-12
