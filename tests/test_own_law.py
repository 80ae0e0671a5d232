"""The laws of docs/howto/history.md and failure.md, as they stand there: books close, a restored run goes on."""

import re
from pathlib import Path

import numpy as np
import pytest

PAGES = Path(__file__).parents[1] / "docs" / "howto"


@pytest.fixture
def page(request, monkeypatch, tmp_path):
    """What the page's programs leave behind, run in a folder of their own."""
    path = PAGES / request.param
    cells = re.findall(r"```\{code-cell\} ipython3\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    names: dict[str, object] = {}
    for cell in cells:
        if cell.startswith("%%writefile "):
            name, law = cell.split("\n", 1)
            Path(name.removeprefix("%%writefile ")).write_text(law, encoding="utf-8")
        else:
            exec(compile(cell, str(path), "exec"), names)
    return names


@pytest.mark.parametrize("page", ["history.md"], indirect=True)
def test_the_law_of_the_page_keeps_its_books(page):
    simulation, energy, start = page["simulation"], page["energy"], page["start"]
    assert 0.5 < page["crushed"].min() < 0.8
    assert energy["material"] == pytest.approx(-page["exact"], rel=1e-9) and -energy["material"] > 0.3 * start
    assert abs(energy["residual"]) < 1e-12 * start and abs(energy["stepping"]) < 0.01 * start
    held = {name: np.array(array.numpy()) for name, array in simulation.evolving().items()}
    counters = simulation.counters
    simulation.step(5)
    ahead = simulation.history("plastic_volume")
    simulation.restore(held, counters)
    assert np.array_equal(simulation.history("plastic_volume"), page["crushed"])
    simulation.step(5)
    np.testing.assert_allclose(simulation.history("plastic_volume"), ahead, rtol=1e-12)


@pytest.mark.parametrize("page", ["failure.md"], indirect=True)
def test_the_criterion_of_the_page_breaks_and_keeps_its_books(page):
    simulation, energy, start = page["simulation"], page["energy"], page["start"]
    assert simulation.broken is not None and page["damage"].max() == 1.0
    assert (simulation.history("damage") == 1.0).sum() > 8
    assert abs(energy["residual"]) < 1e-12 * start and abs(energy["stepping"]) < 0.01 * start
    assert 0.01 < -energy["material"] / start < 0.9
