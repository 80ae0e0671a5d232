"""What case files say reaches the run: conditions, recording, meshes, overrides."""

import json

import numpy as np
import pytest
from case_files import CASES, small

import warp_eulsph as es
from warp_eulsph.cases import CaseError, parse_case, read_case
from warp_eulsph.output import Run, record


def test_motion_and_traction_and_mirror_from_a_file():
    case = parse_case(
        small(
            boundary=[
                {"kind": "Motion", "displacement": [0, "0.1*t*t"], "region": "y < 0.25"},
                {"kind": "Pressure", "value": "1e3*t", "region": "y > 0.5"},
                {"kind": "Roller", "normal": [1, 1], "region": "x > 0.8 and y > 0.3"},
                {"kind": "Traction", "value": [0, 1e3], "normal": [1, 0], "region": "0.6 < x <= 1"},
                {"kind": "Pressure", "value": 1e2, "normal": [-1, 0], "region": "x < 0.25"},
                {"kind": "Clamped", "point": [0, 1], "normal": [0, 1]},
            ],
        )
    )
    simulation = case.build()
    kinds = ["Motion", "Pressure", "Roller", "Traction", "Pressure", "Clamped"]
    assert [type(b).__name__ for b in simulation.boundaries] == kinds
    simulation.run(0.002)
    below = simulation.bodies[0].x[:, 1] < 0.25
    moved = (simulation.x - simulation.bodies[0].x)[below]
    np.testing.assert_allclose(moved, np.broadcast_to([0.0, 0.1 * 0.002**2], moved.shape), rtol=0, atol=1e-15)
    mirrored = small()
    mirrored["body"]["a"]["mirror"] = [{"point": [0, 0], "normal": [-1, 0]}]
    simulation = parse_case(mirrored).build()
    # Two support radii, 4 · 1.3 · 0.25 m, hold all of the body.
    assert len(simulation.x) == 32 and type(simulation.boundaries[0]).__name__ == "MirrorGhosts"


def test_recording_and_probes_from_a_file(tmp_path):
    """What is kept, and a probe of every kind; each says what the simulation says."""
    data = small(
        until=0.004,
        boundary=[{"kind": "Fixed", "region": "y < 0.25"}, {"kind": "Velocity", "region": "y > 0.75", "value": [1, 0]}],
        probe=[
            {"kind": "PointProbe", "name": "top", "X": [0.5, 1], "schedule": {"kind": "EveryTime", "interval": 1e-3}},
            {"kind": "BodyProbe", "name": "all", "body": "a"},
            {"kind": "ReactionProbe", "name": "pull", "boundary": 1},
            {"kind": "SectionProbe", "name": "cut", "point": [0, 0.5], "normal": [0, 1]},
        ],
        output={"every": 2e-3, "at": [1e-3], "fields": ["velocity"], "log": {"kind": "EverySteps", "count": 2}},
    )
    case = parse_case(data)
    assert parse_case(case.describe()).describe() == case.describe()
    simulation = case.build()
    record(simulation, tmp_path, case.until, case.recording(simulation), case=case.describe())
    run = Run(tmp_path)
    np.testing.assert_allclose(run.times, [0.0, 1e-3, 2e-3, 4e-3], rtol=1e-12)
    assert set(run.fields) == {"x", "velocity"} and len(run.log["t"]) >= 3
    np.testing.assert_allclose(run.probes["top"]["t"], np.arange(5) * 1e-3, rtol=1e-9)
    np.testing.assert_array_equal(run.probes["pull"]["force"][-1], simulation.reaction(simulation.boundaries[1]))
    np.testing.assert_allclose(run.probes["all"]["momentum"][-1], simulation.momentum(), rtol=1e-12)
    assert set(run.probes) == {"top", "all", "pull", "cut"}


@pytest.mark.parametrize("reading", ["file", "described"])
def test_snapshots_of_a_region_of_a_file(tmp_path, reading):
    data = small(until=1e-6, parameters={"top": 0.5}, output={"region": "y > top", "body": "b", "fields": ["velocity"]})
    data["body"]["b"] = json.loads(json.dumps(data["body"]["a"]))
    data["body"]["b"]["shape"] |= {"lower": [2, 0], "upper": [3, 1]}
    case = parse_case(data)
    case = parse_case(case.describe()) if reading == "described" else case
    simulation = case.build()
    record(simulation, tmp_path, case.until, case.recording(simulation), case=case.describe())
    frame = Run(tmp_path)[-1]
    X = np.concatenate([body.x for body in simulation.bodies])
    wanted = np.flatnonzero((X[:, 1] > 0.5) & (X[:, 0] > 2.0))
    assert len(wanted) == 8 and frame.particles.tolist() == wanted.tolist()
    assert Run(tmp_path).description["case"]["output"]["region"] == "y > top"


def test_bodies_by_name_and_periodic_boxes():
    data = small(periodic=[0, 4], boundary=[{"kind": "Velocity", "body": "b", "value": 2}])
    data["body"]["b"] = json.loads(json.dumps(data["body"]["a"]))
    data["body"]["b"]["shape"] |= {"lower": [2, 0], "upper": [3, 1]}
    simulation = parse_case(data).build()
    assert list(simulation.ranges) == ["a", "b"] and simulation.space.periodic
    np.testing.assert_array_equal(simulation.conditions[0].indices, np.arange(16, 32))


def test_particles_are_sorted_in_memory_unless_the_case_says_no():
    assert parse_case(small()).build().sorting.on
    assert not parse_case(small(sort=False)).build().sorting.on


def test_meshes_are_found_beside_the_case_file(tmp_path):
    from surfaces import angle_profile, write

    write(tmp_path / "angle.vtk", *angle_profile())
    (tmp_path / "case.toml").write_text(
        'until = 1\n[body.a]\nshape = { kind = "mesh", file = "angle.vtk", spacing = 0.25 }\n'
        'material = { kind = "NeoHookean", density = 1, young = 1, poisson = 0 }\n'
        '[[boundary]]\nkind = "Fixed"\nregion = { file = "angle.vtk", depth = 0.13 }\n'
    )
    case = read_case(tmp_path / "case.toml")
    # All 48 particles lie half a spacing beneath a face but the two in the middle of the inner edge.
    assert case.dim == 3 and len(case.build().conditions[0].indices) == 46
    case = read_case(tmp_path / "case.toml", ["output.region.file=angle.vtk", "output.region.depth=0.13"])
    simulation = case.build()
    kept = case.recording(simulation).particles(simulation)
    assert kept.tolist() == simulation.conditions[0].indices.tolist()
    assert case.describe()["body"]["a"]["shape"]["file"] == str(tmp_path / "angle.vtk")


# overrides


def test_overrides_reach_everything(tmp_path):
    case = read_case(
        CASES / "punch.toml",
        [
            "n = 10",
            "boundary.1.axes=[0, 1]",
            "boundary.2.region=y > 0.9",
            "reference=Never",
            'scheme={kind = "LaxWendroff", dissipation = "None"}',
            "body.block.material.young=2*n*1e6",
            "output.fields=['velocity']",
        ],
    )
    assert case.boundary[1].axes == [0, 1] and case.boundary[2].region.given == "y > 0.9"
    assert case.reference.make() == es.Never() and case.scheme.make() == es.LaxWendroff(dissipation=None)
    assert read_case(CASES / "punch.toml", ["parameters.n=10"]).parameters == case.parameters
    assert case.body["block"].material.young == 20e6 and case.output.fields == ["velocity"]


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("n", "must be key.path=value"),
        ("=3", "must be key.path=value"),
        ("until.x=3", "until is 0.03 and has no 'x'"),
        ("boundary.7.axes=[0]", "'7' must be one of the 3 entries"),
        ("boundary.x.axes=[0]", "'x' must be one of the 3 entries"),
        ("paremeters.n=3", "paremeters: unknown key; did you mean 'parameters'?"),
        ("body.block.material.kind=NeoHokean", "body.block.material: unknown kind 'NeoHokean'; did you mean"),
    ],
)
def test_bad_overrides_are_named(override, message):
    with pytest.raises(CaseError) as caught:
        read_case(CASES / "punch.toml", [override])
    assert message in str(caught.value)


def test_a_mirror_is_as_deep_as_what_its_body_is_bonded_to_needs():
    """A liquid bonded to a gas takes what suits a gas: three supports of 2.6 spacings, not of the 3.6 of liquids."""
    data = small()
    liquid, gas = {"kind": "TaitLiquid", "density": 1e3, "sound_speed": 20}, {"kind": "IdealGas", "density": 1.0}
    shape = {"kind": "box", "lower": [0, 0], "upper": [20, 1], "spacing": 0.25}
    mirrored = {"mirror": [{"point": [20, 0], "normal": [1, 0]}], "bonded": "gas"}
    data["body"] = {
        "gas": {"shape": {**shape, "lower": [-1, 0], "upper": [0, 1]}, "material": {**gas, "pressure": 1e5}},
        "liquid": {"shape": shape, "material": liquid, **mirrored},
    }
    simulation = parse_case(data).build()
    ghosts = simulation.ranges["liquid"].stop - 16 - 320
    assert ghosts == 4 * int(3.0 * 2.6 - 0.5 + 1.0)
