"""Materials and conditions of a user's own in case files: by module and class, and only in files that are trusted."""

import json

import jsonschema
import numpy as np
import pytest
import tomli_w
from case_files import small

import warp_eulsph as es
from warp_eulsph.cases import CaseError, json_schema, parse_case, read_case
from warp_eulsph.cli import main
from warp_eulsph.output import Run

PROGRAM = '''
from dataclasses import dataclass
from pathlib import Path

import warp_eulsph as es
from warp_eulsph.interactions import BoundInteraction

Path(__file__).with_suffix(".ran").touch()


@dataclass(frozen=True, kw_only=True)
class Rubber(es.NeoHookean):
    """As Neo-Hooke."""

    grade: int = 1


@dataclass(frozen=True)
class Wind(es.Boundary):
    """A body force along x.

    Args:
        strength: [m/s²].
    """

    strength: float = 1.0

    def bind(self, assembly):
        return es.BodyForce([self.strength] + [0.0] * (assembly.space.dim - 1)).bind(assembly)


@dataclass(frozen=True)
class Attraction(es.Interaction):
    """All of the first half of the particles is drawn along x, and the other half back."""

    strength: float

    def bind(self, assembly):
        return BoundAttraction(self, assembly)


class BoundAttraction(BoundInteraction):
    def __init__(self, option, assembly):
        self.strength, self.indices = option.strength, assembly.select(None, None, "Attraction")

    def forces(self, world, state, fraction, out):
        n, forces = len(self.indices), out.numpy()
        forces[: n // 2, 0] += self.strength
        forces[n // 2 :, 0] -= self.strength
        out.assign(forces)


@dataclass(frozen=True)
class Odd(es.Boundary):
    what: object = None

    def bind(self, assembly): ...
'''
MATERIAL = {"kind": "own_things:Rubber", "density": 1100.0, "young": 17e6, "poisson": 0.45}


@pytest.fixture
def folder(tmp_path):
    """A case file beside the program that it names."""
    (tmp_path / "own_things.py").write_text(PROGRAM)
    case = small(boundary=[{"kind": "own_things:Wind", "strength": "2*n"}], parameters={"n": 3}, until=2e-4)
    case["body"]["a"]["material"] = MATERIAL
    (tmp_path / "mine.toml").write_text(tomli_w.dumps(case))
    return tmp_path


def ran(folder):
    return (folder / "own_things.ran").exists()


def test_trusted_files_take_them(folder):
    case = read_case(folder / "mine.toml", trust=True)
    simulation = case.build()
    assert type(simulation.bodies[0].material).__name__ == "Rubber" and ran(folder)
    simulation.step()
    assert simulation.momentum()[0] > 0.0 and case.programs == (folder / "own_things.py",)
    described = case.describe()
    assert described["body"]["a"]["material"] == {**MATERIAL, "grade": 1}
    again = parse_case(described, directory=folder, trust=True)
    assert again.describe() == described
    assert type(again.build().bodies[0].material) is type(simulation.bodies[0].material)  # no second module
    jsonschema.validate(json.loads(json.dumps(described)), json_schema())


def test_without_trust_nothing_runs(folder, capsys):
    with pytest.raises(CaseError) as caught:
        read_case(folder / "mine.toml")
    assert len(caught.value.problems) == 2 and not ran(folder)
    assert caught.value.problems[0].startswith("body.a.material: 'own_things:Rubber' is a program, and a case file")
    assert main(["run", str(folder / "mine.toml"), "-o", str(folder / "run")]) == 2
    assert "say --trust (in Python trust=True) if it is yours" in capsys.readouterr().err and not ran(folder)


def test_run_and_resume_by_the_command(folder, capsys):
    directory = folder / "run"
    assert main(["run", "--trust", str(folder / "mine.toml"), "-o", str(directory)]) == 0
    assert (directory / "own_things.py").read_text() == PROGRAM
    (folder / "mine.toml").unlink()
    (folder / "own_things.ran").unlink()
    assert main(["resume", str(directory), "--until", "3e-4"]) == 2 and not ran(directory)
    assert "--trust" in capsys.readouterr().err
    assert main(["resume", "--trust", str(directory), "--until", "3e-4"]) == 0 and ran(directory)
    assert Run(directory).times[-1] == 3e-4


def test_the_word_alone_where_all_has_defaults(folder):
    case = parse_case(small(boundary=["own_things:Wind"]), directory=folder, trust=True)
    np.testing.assert_array_equal(case.build().boundaries[0].strength, 1.0)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (
            "nowhere_at_all:Wind",
            r"boundary.0: nowhere_at_all:Wind: No module named .*; a module lies beside",
        ),
        ("own_things:Wnd", r"own_things has no 'Wnd'"),
        ("own_things:Rubber", r"must be a whole class below Boundary, got <class"),
        ("own_things:Path", r"must be a whole class below Boundary, got <class"),
        ("broken:Wind", r"broken cannot be imported: ZeroDivisionError"),
        ("own_things:Odd", r"what: <class 'object'> cannot be written in a case file"),
    ],
)
def test_mistakes_are_named(folder, kind, message):
    (folder / "broken.py").write_text("1 / 0\n")
    with pytest.raises(CaseError, match=message):
        parse_case(small(boundary=[{"kind": kind}]), directory=folder, trust=True)


def test_arguments_are_checked_as_those_of_the_package(folder):
    wrong = [{"kind": "own_things:Wind", "strngth": 1.0}, {"kind": "own_things:Wind", "strength": "2*m"}]
    with pytest.raises(CaseError) as caught:
        parse_case(small(boundary=wrong), directory=folder, trust=True)
    assert caught.value.problems[0] == (
        "boundary.0.strngth: unknown key; did you mean 'strength'?; known are ['kind', 'strength']"
    )
    assert caught.value.problems[1].startswith("boundary.1.strength: unknown name 'm'")


@pytest.mark.parametrize("kind", ["os:system", "own_things:Wind", "a.b:c"])
def test_other_places_take_no_programs(folder, kind):
    """Schemes, weights, shapes are those of the package, trusted or not."""
    for changes in ({"weight": kind}, {"scheme": {"kind": kind}}, {"reference": kind}):
        with pytest.raises(CaseError, match="unknown kind"):
            parse_case(small(**changes), directory=folder, trust=True)
    assert not ran(folder) and issubclass(es.Fixed, es.Boundary)


def test_forces_between_bodies_are_named_too(folder):
    case = small(interaction=[{"kind": "own_things:Attraction", "strength": 5.0}])
    simulation = parse_case(case, directory=folder, trust=True).build()
    simulation.step()
    v = simulation.v[:, 0]
    assert v[:8].sum() > 0.0 > v[8:].sum() and abs(simulation.momentum()[0]) < 1e-12
    described = parse_case(case, directory=folder, trust=True).describe()
    assert described["interaction"] == case["interaction"]
    jsonschema.validate(json.loads(json.dumps(described)), json_schema())
    with pytest.raises(CaseError, match=r"interaction\.0: 'own_things:Attraction' is a program"):
        parse_case(case, directory=folder)
    with pytest.raises(CaseError, match=r"interaction\.0.*'Springs'"):
        parse_case(small(interaction=["Springs"]), directory=folder, trust=True)
