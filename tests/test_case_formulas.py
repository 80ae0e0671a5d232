"""Options and formulas of case files."""

import numpy as np
import pytest
import warp as wp
from case_files import small

import warp_eulsph as es
from warp_eulsph.cases import CaseError, parse_case
from warp_eulsph.cases.expressions import parse


def test_options_nest_and_switch_off():
    case = parse_case(
        small(
            scheme={
                "kind": "LaxWendroff",
                "dissipation": {"epsilon": "1/2", "sensor": {"kind": "PaperSensor", "X": 1e-6}},
                "correction": "None",
                "smoothing": {"kind": "NeighbourAverage", "values": "Linear"},
            },
            reference={"kind": "Every", "steps": "2 + 3"},
            time_step={"cfl": 0.3},
        )
    )
    assert case.scheme.make() == es.LaxWendroff(
        dissipation=es.Upwind(epsilon=0.5, sensor=es.PaperSensor(1e-6)),
        correction=None,
        smoothing=es.NeighbourAverage(values=es.Linear()),
    )
    assert case.reference.make() == es.Every(5) and case.time_step.make() == es.TimeStep(cfl=0.3)
    assert parse_case(case.describe()).scheme.make() == case.scheme.make()


@pytest.mark.parametrize("precision", ["double", "single"])
def test_formulas_act_on_the_device_as_on_the_host(precision):
    """A body force by formula pushes each particle as numpy says; all functions and operators, two components."""
    parts = [
        "a*sin(x)*cos(y) + tan(t)/(1 + exp(-x)) - atan2(y, x + 1) + hypot(x, y)**2",
        "min(x, y, 0.5) + max(x, t) + smoothstep((x - 0.2)/0.5) + sqrt(abs(x - y)) if x < 0.6 and not y > 0.9 else "
        "clip(x*10, 1, 2) + log(1 + x) + floor(3*x) - ceil(y) + sign(x - y) + sinh(x)*cosh(y) - tanh(x) + asin(x/2)"
        " + acos(y/2) - atan(-x)",
    ]
    case = parse_case(
        small(
            parameters={"two": 2, "a": "10*two**-1*two**0"},
            boundary=[{"kind": "BodyForce", "value": parts, "material": True}],
            precision=precision,
        )
    )
    simulation = case.build()
    external = wp.zeros(len(simulation.x), dtype=simulation.space.vec, device=simulation.device)
    simulation.conditions[0].load(simulation.stepper.U, simulation.clock.fields, 0.0, external)
    x, y = simulation.bodies[0].x.T
    first = 5 * np.sin(x) * np.cos(y) - np.arctan2(y, x + 1) + x**2 + y**2
    s = np.clip((x - 0.2) / 0.5, 0, 1)
    near = np.minimum(np.minimum(x, y), 0.5) + np.maximum(x, 0) + s * s * (3 - 2 * s) + np.sqrt(np.abs(x - y))
    far = np.clip(10 * x, 1, 2) + np.log(1 + x) + np.floor(3 * x) - np.ceil(y) + np.sign(x - y)
    far += np.sinh(x) * np.cosh(y) - np.tanh(x) + np.arcsin(x / 2) + np.arccos(y / 2) + np.arctan(x)
    expected = np.stack([first, np.where((x < 0.6) & ~(y > 0.9), near, far)], axis=1) * 1000 * 0.25**2
    tolerance = 1e-13 if precision == "double" else 1e-5
    np.testing.assert_allclose(external.numpy(), expected, rtol=0, atol=tolerance * np.abs(expected).max())


@pytest.mark.parametrize(
    "text",
    [
        "x.real",
        "x[0]",
        "'x'",
        "f'{x}'",
        "lambda: 1",
        "[x for x in y]",
        "(y := 1)",
        "x @ y",
        "x // 2",
        "x % 2",
        "x << 1",
        "x if y else 1",
        "x == y",
        "1 < x",
        "min(*x)",
        "min(x)",
        "sin(x, y)",
        "clip(a=1)",
        "sin",
        "print(1)",
        "True",
        "None",
        "1j",
        "1e999",
        "9" * 400,
        "",
        "x;y",
        "x\ny",
        "import os",
        "-" * 900 + "1",
        "(" * 500 + "1" + ")" * 500,
        "x + " * 300 + "x",
        "\0",
    ],
)
def test_formulas_are_numbers_and_nothing_else(text):
    with pytest.raises(ValueError, match=r"formula|unknown|number|needed|takes|null"):
        parse(text, ["x", "y"])


def test_noise_in_formulas_is_named_or_evaluates():
    random = np.random.default_rng(4)
    words = ["x", "y", "1", "2.5", "pi", "(", ")", "+", "-", "*", "/", "**", "sin(", "min(", ",", "<", "and", "not"]
    words += ["if", "else", "q", "sqrt(", "clip(", "\t", "'", "."]
    evaluated = 0
    for _ in range(3000):
        text = " ".join(random.choice(words, size=random.integers(1, 9)))
        try:
            expression = parse(text, ["x", "y"])
        except ValueError as error:
            assert str(error)
            continue
        evaluated += 1
        assert np.shape(expression({"x": np.ones(3), "y": np.zeros(3)})) in ((), (3,))
    assert evaluated > 100


# definitions

DEFINITIONS = {"R": "hypot(x, y)", "wave": "a*sin(pi*R) + x", "late": "wave*(1 + t)", "unused": "exp(9*x)"}


@pytest.mark.parametrize("precision", ["double", "single"])
def test_definitions_act_on_the_device_as_on_the_host(precision):
    case = parse_case(
        small(
            parameters={"a": 3},
            definitions=DEFINITIONS,
            boundary=[
                {"kind": "BodyForce", "value": ["late*R", "wave - y"], "region": "R < 1"},
                {"kind": "Fixed", "region": "wave > 3"},
            ],
            precision=precision,
        )
    )
    assert parse_case(case.describe()).describe() == case.describe()
    simulation = case.build()
    x, y = simulation.X.T
    R, wave = np.hypot(x, y), 3 * np.sin(np.pi * np.hypot(x, y)) + x
    np.testing.assert_array_equal(simulation.conditions[0].indices, np.flatnonzero(R < 1))
    np.testing.assert_array_equal(simulation.conditions[1].indices, np.flatnonzero(wave > 3))
    external = wp.zeros(len(x), dtype=simulation.space.vec, device=simulation.device)
    simulation.clock.fields.t.fill_(0.5)
    simulation.conditions[0].load(simulation.stepper.U, simulation.clock.fields, 0.0, external)
    expected = np.stack([1.5 * wave * R, wave - y], axis=1) * 1000 * 0.25**2 * (R < 1)[:, None]
    tolerance = 1e-13 if precision == "double" else 1e-5
    np.testing.assert_allclose(external.numpy(), expected, rtol=0, atol=tolerance * np.abs(expected).max())


def test_a_formula_holds_the_definitions_it_uses_and_no_others():
    region = parse_case(
        small(definitions=DEFINITIONS, parameters={"a": 1}, output={"region": "wave < 1"})
    ).output.region
    (part,) = region.parts
    assert [name for name, _ in part.definitions] == ["R", "wave"] and region.names == {"a", "pi", "x", "y"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"definitions": {"x": "y"}}, "definitions.x: must be named by letters, digits and _, and not like a"),
        ({"definitions": {"a": "y"}, "parameters": {"a": 1}}, "definitions.a: is the name of a parameter, too"),
        ({"definitions": {"b": "c + 1", "c": "x"}}, "definitions.b: unknown name 'c'; known are"),
        ({"definitions": {"b": "x < 1"}}, "definitions.b: must be a number, got a comparison"),
        (
            {"definitions": {"b": "t*x", "c": "2*b"}, "boundary": [{"kind": "Fixed", "region": "c < 1"}]},
            "boundary.0.region: 'c' depends on ['t'], which formulas in this place must not",
        ),
        (
            {"definitions": {"b": "z*x"}, "boundary": [{"kind": "Fixed", "region": "b < 1"}]},
            "boundary.0.region: ['z'] are not coordinates in 2-D",
        ),
    ],
)
def test_wrong_definitions_are_named(changes, message):
    with pytest.raises(CaseError) as caught:
        parse_case(small(**changes))
    (problem,) = caught.value.problems
    assert problem.startswith(message)


def test_a_definition_that_is_no_text_is_named():
    with pytest.raises(CaseError) as caught:
        parse_case(small(definitions={"b": 3}))
    assert caught.value.problems[0] == "definitions.b: must be a formula as text, got 3; numbers are parameters"
