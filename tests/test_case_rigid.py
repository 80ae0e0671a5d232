"""Rigid bodies in case files."""

import importlib
import json
import re
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from case_files import CASES, small

import warp_eulsph as es
from warp_eulsph.cases import CaseError, json_schema, parse_case, read_case
from warp_eulsph.cases.reading import tomllib
from warp_eulsph.interactions import Box, Contact, Driven, Free, Plane, RigidBody, Sphere
from warp_eulsph.output import Run, record

RIGID = {
    "table": {"shape": {"kind": "Plane", "normal": [0, 1]}},
    "ram": {
        "shape": {"kind": "Box", "sides": [0.5, 0.2]},
        "centre": [0.5, 1.1],
        "rotation": [0],
        "motion": {"kind": "Driven", "displacement": [0, "-20*t**2"]},
        "bodies": ["a"],
    },
    "ball": {
        "shape": {"kind": "Sphere", "radius": 0.5},
        "centre": [1.51, "0.5"],
        "motion": {"kind": "Free", "mass": "100", "velocity": [-2, 0]},
    },
}
PROBES = [{"kind": "RigidProbe", "name": "ball", "rigid": "ball"}, {"kind": "RigidProbe", "name": "first"}]


def test_a_case_is_what_python_says():
    case = parse_case(small(rigid=RIGID))
    simulation = case.build()
    table, ram, ball = simulation.interactions
    assert table == RigidBody(Plane([0.0, 1.0]), name="table")
    assert (ram.shape, ram.bodies, ram.name) == (Box([0.5, 0.2]), ["a"], "ram") and isinstance(ram.motion, Driven)
    assert ball == RigidBody(Sphere(0.5), [1.51, 0.5], motion=Free(mass=100.0, velocity=[-2.0, 0.0]), name="ball")
    assert simulation.by_graphs  # formulas run on the device
    simulation.run(0.02)
    by_hand = es.Simulation(case.body["a"].build("a"), interactions=simulation.interactions)
    by_hand.run(0.02)
    assert (simulation.x == by_hand.x).all()
    bound = simulation.bound_interactions
    np.testing.assert_allclose(bound[1].x, [0.5, 1.1 - 20 * 0.02**2], rtol=1e-14)
    assert bound[2].v[0] > -1.9 and bound[1].motion.work.numpy()[0] > 0.0  # both pushed


def test_the_described_case_is_the_same_and_fits_the_schema():
    case = parse_case(small(rigid=RIGID, probe=PROBES))
    described = case.describe()
    assert parse_case(described).describe() == described
    assert described["rigid"]["table"]["motion"] == {"kind": "Held"}
    jsonschema.validate(json.loads(json.dumps(described)), json_schema())
    assert "name" not in json_schema()["$defs"]["RigidBodyTable"]["properties"]  # it is the table's key


def test_probes_record_them(tmp_path):
    case = parse_case(small(rigid=RIGID, probe=PROBES, until=0.01))
    simulation = case.build()
    record(simulation, tmp_path / "run", case.until, case.recording(simulation))
    run = Run(tmp_path / "run")
    path, ball = run.probes["ball"], simulation.bound_interactions[2]
    np.testing.assert_allclose(path["x"][-1], ball.x, rtol=1e-12)
    np.testing.assert_allclose(path["force"][-1], ball.force, rtol=1e-12)
    assert path["spin"].shape == path["torque"].shape == (len(path["x"]), 1)
    assert (run.probes["first"]["x"] == 0.0).all()


def two(**changes):
    """The small case with a second body above the first."""
    case = small(**changes)
    above = json.loads(json.dumps(case["body"]["a"]))
    above["shape"] |= {"lower": [0, 1.01], "upper": [1, 2.01]}
    case["body"]["b"] = {**above, "velocity": [0, -10]}
    return case


def test_bodies_that_touch_are_one_line():
    for table in ({}, {"between": [["a", "b"]], "friction": "0.1*3"}):
        case = parse_case(two(contact=[table]))
        simulation = case.build()
        assert isinstance(simulation.interactions[0], Contact)
        simulation.run(0.01)
        centre = simulation.v[:16, 1].mean()
        assert centre < -1.0  # pushed from above
        assert parse_case(case.describe()).describe() == case.describe()
        jsonschema.validate(json.loads(json.dumps(case.describe())), json_schema())
    (contact,) = case.build().interactions
    assert contact.between == (("a", "b"),) and contact.friction == pytest.approx(0.3)
    by_kind = parse_case(two(interaction=[{"kind": "Contact"}])).build()
    assert by_kind.interactions == (Contact(),)
    with pytest.raises(CaseError, match=r"contact.0.between: unknown body 'c'"):
        parse_case(two(contact=[{"between": [["a", "c"]]}]))
    with pytest.raises(CaseError, match=r"contact.0.between.0: list should have at least 2 items"):
        parse_case(two(contact=[{"between": [["a"]]}]))


def test_mistakes_are_named_with_their_place():
    wrong = {
        "table": {"shape": {"kind": "Plain", "normal": [0, 1]}},
        "ram": {"shape": {"kind": "Box", "side": [1, 1]}, "motoin": "Held"},
        "ball": {"shape": {"kind": "Sphere", "radius": -1}, "motion": "Free"},
        "tool": {"shape": {"kind": "Sphere", "radius": 1}, "motion": {"kind": "Driven", "displacement": ["z", 0]}},
    }
    with pytest.raises(CaseError) as caught:
        parse_case(small(rigid=wrong))
    text = str(caught.value)
    for line in [
        "rigid.table.shape: unknown kind 'Plain'; did you mean 'Plane'?",
        "rigid.ram.shape.sides: is missing",
        "rigid.ram.shape.side: unknown key; did you mean 'sides'?",
        "rigid.ram.motoin: unknown key; did you mean 'motion'?",
        "rigid.ball.shape: Sphere: radius must be positive and finite, got -1.0",
        "rigid.ball.motion: Free: a rigid body that moves freely needs either a mass or a density, got neither",
    ]:
        assert line in text
    several = {"ram": {"shape": {"kind": "Plane", "normal": [0, 1]}, "bodies": ["b"]}}
    several["tool"] = wrong["tool"]
    probes = [{"kind": "RigidProbe", "name": "p", "rigid": "rum"}]
    with pytest.raises(CaseError) as caught:
        parse_case(small(rigid=several, probe=probes))
    assert "rigid.ram.bodies: unknown body 'b'" in str(caught.value)
    assert "rigid.tool.motion.displacement: ['z'] are not coordinates in 2-D" in str(caught.value)
    assert "probe.0.rigid: unknown rigid body 'rum'; did you mean 'ram'?" in str(caught.value)


def test_the_documents_case():
    page = (Path(__file__).parents[1] / "docs" / "cases.md").read_text(encoding="utf-8")
    text = next(block for block in re.findall(r"```text\n(.*?)```", page, re.DOTALL) if "[rigid" in block)
    found = tomllib.loads(text)
    found["rigid"]["ram"] |= {"bodies": ["b"], "centre": [0.5, 2.2]}
    found["rigid"]["ball"]["centre"] = [3, 0.5]
    simulation = parse_case(two(**found)).build()
    simulation.step(3)
    assert [getattr(each.option, "name", None) for each in simulation.bound_interactions] == [
        "table",
        "ram",
        "ball",
        None,
    ]


def test_the_example_is_the_same_in_python(monkeypatch):
    monkeypatch.syspath_prepend(str(CASES.parent))
    build = importlib.import_module("sphere_on_plate").build
    from_file, from_python = read_case(CASES / "sphere_on_plate.toml", ["n=3"]).build(), build(3)
    for simulation in (from_file, from_python):
        simulation.step(30)
    assert from_file.bound_interactions[0].force[2] > 1.0
    assert (from_file.x == from_python.x).all() and (from_file.v == from_python.v).all()
