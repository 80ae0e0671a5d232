"""The map of contact: its files, and cells that hold since surfaces do not jump."""

import csv

import pytest

from warp_eulsph.validation import contact_map

PROBLEMS = {problem.name: problem for problem in contact_map.PROBLEMS}


def test_the_map_is_written(tmp_path):
    verdicts = contact_map.run([PROBLEMS["face on a face"]], ["elastic"], (0.05, 0.15), 1, tmp_path)
    assert [v.verdict for v in verdicts] == ["holds", "holds"]
    assert all(0.7 < v.nearest < 1.1 and v.within == 0 and 0.9 < v.kept < 1.0 for v in verdicts)
    with (tmp_path / "contact.csv").open() as file:
        assert [float(row["speed"]) for row in csv.DictReader(file)] == [0.05, 0.15]
    assert "| elastic, 8 | -0." in (tmp_path / "contact.md").read_text()
    assert (tmp_path / "contact_map.png").read_bytes().startswith(b"\x89PNG")


def test_metal_that_rumples_makes_no_energy():
    """Planes of their own through rumpled surfaces swing, and made a tenth of the energy."""
    verdict = contact_map.judge(PROBLEMS["plate between discs"], "yielding", 6, 0.3)
    assert verdict.verdict == "holds" and abs(verdict.account) < 0.01


def test_what_comes_to_the_surface_under_pressure_makes_no_energy():
    """Read anew, a square tears at the corner that it hits by: 0.14 of the energy came with what it bared."""
    verdict = contact_map.judge(PROBLEMS["corner on a face"], "elastic, current", 8, 0.5)
    assert abs(verdict.account) < 0.05


def test_bodies_that_pass_into_each_other_are_counted():
    """Without contact: a square in another."""
    simulation = contact_map.Simulation(contact_map.face_on_face(8, contact_map.ELASTIC, 50.0))
    assert contact_map.meeting(simulation) == (pytest.approx(1.0, abs=0.2), 0)
    simulation.run(0.01)
    nearest, within = contact_map.meeting(simulation)
    assert nearest < 0.75 and within > 20
