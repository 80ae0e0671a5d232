"""Bad case files: every mistake is named with its place."""

import pytest
from case_files import small

from warp_eulsph.cases import CaseError, parse_case, read_case

BAD = """
untill = 3
until = -1.0
periodic = [1, nan]
[parameters]
n = "1/0"
sin = 3
[body.a]
shape = { kind = "bx", lower = [0, 0], upper = [1, 1], spacing = 0.1 }
material = { kind = "NeoHookean", density = 1, young = 1.0, poison = 0.3 }
[body.b]
shape = { kind = "box", lower = [0, 0], upper = [1, true], spacing = "0.1*m" }
material = { kind = "NeoHookean", density = 1, young = 1.0, poisson = 0.7 }
velocity = [1, "__import__('os')"]
[[boundary]]
kind = "Fixed"
region = "w < 3"
bdy = "a"
[[boundary]]
kind = "Fixed"
region = { fil = "x.stl", depth = "a" }
[scheme]
kind = "Verlet"
dissipation = { epslon = 3 }
[output]
fields = ["velocty"]
every = inf
"""
PROBLEMS = [
    "parameters.n: must be finite, got inf from '1/0'",
    "parameters.sin: must be named by letters, digits and _, and not like a coordinate or function",
    "until: input should be greater than 0, got -1.0",
    "periodic.1: input should be a finite number, got nan",
    "body.a.shape: unknown kind 'bx'; did you mean 'box'?",
    "body.a.material.poisson: is missing",
    "body.a.material.poison: unknown key; did you mean 'poisson'?",
    "body.b.shape.upper.1: input should be a valid number, got True",
    "body.b.shape.spacing: unknown name 'm'",
    "body.b.material: poisson ratio must be in (-1, 0.5), got 0.7; use 0.49 to 0.499 for rubber",
    "body.b.velocity: unknown function '__import__'",
    "boundary.0.region: unknown name 'w'",
    "boundary.0.bdy: unknown key; did you mean 'body'?",
    "boundary.1.region.file: is missing",
    "boundary.1.region.fil: unknown key; did you mean 'file'?",
    "boundary.1.region.depth: unknown name 'a'",
    "scheme.dissipation.epslon: unknown key; did you mean 'epsilon'?",
    "output.fields: unknown field 'velocty'; did you mean 'velocity'?",
    "output.every: input should be a finite number, got inf",
    "untill: unknown key; did you mean 'until'?",
]


def test_all_mistakes_of_a_file_are_named_at_once(tmp_path):
    (tmp_path / "bad.toml").write_text(BAD)
    with pytest.raises(CaseError) as caught:
        read_case(tmp_path / "bad.toml")
    found = caught.value.problems
    assert str(caught.value).startswith(f"{tmp_path / 'bad.toml'}: {len(PROBLEMS)} problems\n")
    for problem in PROBLEMS:
        assert sum(line.startswith(problem) for line in found) == 1, (problem, found)
    assert len(found) == len(PROBLEMS)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"until": True}, "until: input should be a valid number, got True"),
        ({"body": {}}, "body: dictionary should have at least 1 item"),
        ({"boundary": [{"kind": "Fixed", "body": "aa"}]}, "boundary.0.body: unknown body 'aa'; did you mean 'a'?"),
        ({"boundary": [{"kind": "Fixed", "region": "z < 1"}]}, "boundary.0.region: ['z'] are not coordinates in 2-D"),
        ({"boundary": [{"kind": "Velocity", "value": [1, 2, 3]}]}, "boundary.0.value: must have 1 or 2 components in"),
        ({"boundary": [{"kind": "Velocity", "value": [1, True]}]}, "boundary.0.value: must be a number, a formula"),
        ({"boundary": [{"kind": "Fixed", "region": "x + 1"}]}, "boundary.0.region: must be a comparison such as"),
        ({"boundary": [{"kind": "Fixed", "region": "1 < t"}]}, "boundary.0.region: unknown name 't'"),
        ({"boundary": [{"kind": "BodyForce"}]}, "boundary.0.value: is missing"),
        ({"boundary": [{"value": 3}]}, "boundary.0: must be a table with a kind"),
        ({"boundary": {"kind": "Fixed"}}, "boundary: input should be a valid list"),
        ({"reference": "Evry"}, "reference: unknown kind 'Evry'; did you mean 'Every'?"),
        ({"reference": {"kind": "Every", "steps": 1.5}}, "reference.steps: input should be a valid integer, got 1.5"),
        ({"scheme": {"kind": "Lax", "limiter": "None"}}, "scheme.limiter: unknown key; known are ['kind', 'smoothing'"),
        ({"probe": [{"kind": "ReactionProbe", "name": "a", "boundary": 0}]}, "probe.0.boundary: must be one of the 0"),
        ({"probe": [{"kind": "BodyProbe", "name": "a b"}]}, "probe.0: probe name must be of letters, digits, - and _"),
        ({"probe": [{"kind": "BodyProbe", "name": "a"}] * 2}, "probe.1.name: is taken by another, got 'a'"),
        ({"output": {"region": "z < 1"}}, "output.region: ['z'] are not coordinates in 2-D"),
        ({"output": {"region": True}}, "output.region: must be a comparison such as 'y < 0.1', got True"),
        ({"output": {"body": "aa"}}, "output.body: unknown body 'aa'; did you mean 'a'?"),
        ({"output": {"at": [2, 1]}}, "output.at: times must be finite and increase"),
        ({"precision": "half"}, "precision: input should be 'double' or 'single', got 'half'"),
        ({"parameters": {"lambda": 3}}, "parameters.lambda: must be named by letters"),
        ({"parameters": {"a": "b + 1", "b": 2}}, "parameters.a: unknown name 'b'"),
        ({"parameters": 3}, "parameters: input should be a valid dictionary, got 3"),
        ({"time_step": {"fixed": "-1"}}, "time_step: fixed time step must be positive and finite, got -1.0 s"),
    ],
)
def test_each_mistake_is_named_with_its_place(changes, message):
    with pytest.raises(CaseError) as caught:
        parse_case(small(**changes))
    (problem,) = caught.value.problems
    assert problem.startswith(message)


def test_mistakes_that_only_particles_show_are_value_errors():
    case = parse_case(small(boundary=[{"kind": "Fixed", "region": "x > 9"}]))
    with pytest.raises(ValueError, match="the region selects no particle"):
        case.build()
    data = small()
    data["body"]["a"]["shape"] = {"kind": "ring", "centre": [0, 0], "inner": 2, "outer": 1, "spacing": 0.1}
    with pytest.raises(ValueError, match=r"body\.a\.shape: ring: inner must be below outer, got 2.0 and 1.0 m"):
        parse_case(data).build()


def test_unreadable_files_are_named(tmp_path):
    for content, message in (
        (None, "cannot be read"),
        (b"\xff\xfe", "cannot be read"),
        (b"until = ", "not TOML"),
        (b"a = " + b"[" * 5000, "not TOML"),
        (b"a = " + b"9" * 5000, "not TOML"),
    ):
        if content is not None:
            (tmp_path / "case.toml").write_bytes(content)
        with pytest.raises(CaseError, match=message):
            read_case(tmp_path / "case.toml")
