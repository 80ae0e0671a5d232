"""The law of docs/howto/history.md, as it stands there: its books close in its own account, a restored run goes on."""

import re
from pathlib import Path

import numpy as np
import pytest

PAGE = Path(__file__).parents[1] / "docs" / "howto" / "history.md"


@pytest.fixture
def page(monkeypatch, tmp_path):
    """What the page's programs leave behind, run in a folder of their own."""
    cells = re.findall(r"```\{code-cell\} ipython3\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    name, law = cells[0].split("\n", 1)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    Path(name.removeprefix("%%writefile ")).write_text(law, encoding="utf-8")
    names: dict[str, object] = {}
    for cell in cells[1:]:
        exec(compile(cell, str(PAGE), "exec"), names)
    return names


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
