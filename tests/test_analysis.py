"""The scripts of analysis and the notebook run, small, and say what they should."""

import importlib
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ANALYSIS = ROOT / "examples" / "analysis"
CASES = ROOT / "examples" / "cases"


@pytest.fixture
def script(monkeypatch):
    """The module of a script."""
    monkeypatch.syspath_prepend(str(ANALYSIS))
    return importlib.import_module


def test_energy_balance_closes(script, tmp_path, capsys):
    plate = [str(CASES / "spinning_plate.toml"), "-s", "parameters.n=8", "-s", "until=4e-3"]
    shares = script("energy_balance").main([*plate, "--frames", "5", "--output", str(tmp_path)])
    assert abs(shares["residual"]) < 1e-12 and 0.9 < shares["total"] <= 1.0 + 1e-4
    assert shares["kinetic"] + shares["stored"] == pytest.approx(shares["total"], abs=1e-12)
    assert (tmp_path / "energy_balance.png").stat().st_size > 10_000
    assert "dissipation" in capsys.readouterr().out


def test_point_history_against_the_reference(script, tmp_path):
    plate = [str(CASES / "spinning_plate.toml"), "--point", "0.5,0.5", "--column", "Rcorner"]
    plate += ["--reference", str(ROOT / "warp_eulsph/validation/reference/spin2d105_2.csv"), "--output", str(tmp_path)]
    coarse, fine = (script("point_history").main([*plate, "-s", f"parameters.n={n}"]) for n in (8, 16))
    assert fine < 0.75 * coarse < 0.2
    assert (tmp_path / "point_history.png").stat().st_size > 10_000


def test_convergence_table(script, capsys):
    convergence = script("convergence")
    values = convergence.main([str(CASES / "spinning_plate.toml"), "-s", "until=4e-3", "--levels", "6,12,24"])
    rows = capsys.readouterr().out.splitlines()
    assert [row.split()[:2] for row in rows[1:]] == [["6", "36"], ["12", "144"], ["24", "576"]]
    # Second order inside, first at free surfaces, and not asymptotic yet; the table shows the order of its values.
    (order,) = convergence.orders([6, 12, 24], list(values.values()))
    assert float(rows[-1].split()[-1]) == pytest.approx(order, abs=0.005) and 1.0 < order < 3.0
    assert convergence.orders([1, 2, 4], [1.0, 0.5, 0.25]) == pytest.approx([1.0])
    assert convergence.orders([1, 2, 4], [1.0, 0.75, 0.6875]) == pytest.approx([2.0])


def test_animation(script, tmp_path):
    from PIL import Image

    bar = [str(CASES / "bar.toml"), "--frames", "4", "--field", "velocity.x", "--output", str(tmp_path)]
    with Image.open(script("animation").main(bar)) as shown:
        assert shown.n_frames == 5


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
    assert kinds.count("image/png") == 2 and kinds.count("image/gif") == 1
    (ratio,) = [float(o["data"]["text/plain"]) for o in outputs if "e-" in o.get("data", {}).get("text/plain", "")]
    assert abs(ratio) < 1e-12
