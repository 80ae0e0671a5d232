"""The two scalar examples reproduce their figures and write their pictures."""

import importlib.util
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parent.parent / "examples"


@pytest.mark.parametrize("name", ["amplification", "cosine_profile"])
def test_example(name, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    specification = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    example = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(example)
    status = example.main(["--output", str(tmp_path)])
    printed = capsys.readouterr().out
    assert status == 0, printed
    assert "all figures agree" in printed
    assert (tmp_path / f"{name}.png").stat().st_size > 10_000


def test_a_wrong_figure_is_found(tmp_path, capsys):
    specification = importlib.util.spec_from_file_location("cosine_profile", EXAMPLES / "cosine_profile.py")
    example = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(example)
    case = (example.LAX, 1.0, 1.0)
    example.EXPECTED = {case: ("0.98295", *example.EXPECTED[case][1:])}
    assert example.main(["--output", str(tmp_path)]) == 1
    assert "expected 0.98295" in capsys.readouterr().out
