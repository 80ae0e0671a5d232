"""The schema of case files: all that the package has, by existing, with units; and the case of the documents."""

import inspect
import json
import re

import pytest
from case_files import CASES, FILES, small

import warp_eulsph as es
from warp_eulsph.cases import CaseError, json_schema, parse_case
from warp_eulsph.cases.options import concrete, writable
from warp_eulsph.cases.reading import tomllib
from warp_eulsph.cases.shapes import SHAPES
from warp_eulsph.output import Probe


def test_every_argument_of_the_simulation_is_in_case_files():
    arguments = set(inspect.signature(es.Simulation).parameters)
    # The plural of a list of tables, and the type as a word.
    renamed = {"bodies": "body", "boundaries": "boundary", "interactions": "interaction", "dtype": "precision"}
    assert {renamed.get(name, name) for name in arguments} <= set(json_schema()["$defs"]["Case"]["properties"])


def test_all_classes_of_the_package_can_be_named():
    """By existing: nothing is listed in the room of cases. Mirror ghosts are written as planes of the body."""
    left_out = {cls.__name__ for cls in concrete(es.Boundary)} - {cls.__name__ for cls in writable(es.Boundary)}
    assert left_out == {"MirrorGhosts"}
    assert len(writable(Probe)) == len(concrete(Probe)) >= 4
    assert writable(es.Interaction) == concrete(es.Interaction)
    for base in (es.Material, es.Weight, es.ReferencePolicy):
        assert writable(base) == concrete(base) and len(concrete(base)) >= 4
    schema = json.dumps(json_schema())
    for name in es.__all__:
        part = getattr(es, name)
        if isinstance(part, type) and issubclass(part, (es.Material, es.Weight, es.ReferencePolicy)):
            assert inspect.isabstract(part) or f'"{name}"' in schema, name
    assert {shape.__name__ for shape in SHAPES} >= {
        "box",
        "nodes",
        "disc",
        "ring",
        "cylinder",
        "sphere",
        "tube",
        "mesh",
    }


@pytest.mark.parametrize("weight", [cls.__name__ for cls in concrete(es.Weight)])
def test_every_weight_builds(weight):
    simulation = parse_case(small(weight=weight)).build()
    assert type(simulation.stepper.configuration.weight).__name__ == weight


def test_schema_says_units_and_kinds():
    definitions = json_schema()["$defs"]
    assert definitions["NeoHookean"]["properties"]["young"]["description"] == "Young's modulus [Pa]."
    assert definitions["TaitLiquid"]["properties"]["density"]["description"] == "initial density [kg/m³]."
    assert definitions["box"]["properties"]["spacing"]["description"].startswith("wanted spacing [m]")


def test_case_of_the_documents_builds_and_its_mistakes_are_as_shown():
    text = (CASES.parents[1] / "docs" / "cases.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    simulation = parse_case(tomllib.loads(example)).build()
    simulation.step(2)
    assert simulation.stepper.options.dissipation.epsilon == 0.8
    bad = example.replace("poisson =", "poison =").replace('"y < layer"', '"y < leyer"')
    with pytest.raises(CaseError) as caught:
        parse_case(tomllib.loads(bad))
    shown = re.search(r"```text\n(case: .*?)\n```", text, re.DOTALL)[1]
    assert str(caught.value) == shown


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_editors_accept_the_case_files_by_the_schema(file):
    from jsonschema import Draft202012Validator

    validator = Draft202012Validator(json_schema())
    data = tomllib.loads(file.read_text(encoding="utf-8"))
    assert not [error.message for error in validator.iter_errors(data)]
    part = data["transport"] if "transport" in data else next(iter(data["body"].values()))["material"]
    part = part.get("material", part)  # of one that wraps another
    part["wrong"] = part.pop("velocity" if "transport" in data else "density")
    assert not validator.is_valid(data)
