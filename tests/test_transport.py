"""Transported quantities as runs: recorded, resumed bit for bit, drawn beside the exact solution, from case files."""

import json

import numpy as np
import pytest
import warp as wp
from case_files import CASES
from clouds import cloud
from kept_runs import StopAfter, contents

from warp_eulsph.cases import CaseError, parse_case, read_case
from warp_eulsph.cli import main
from warp_eulsph.operators.values import Linear
from warp_eulsph.output import BodyProbe, Recording, Run, RunDirectory, record
from warp_eulsph.schedule import EverySteps, EveryTime
from warp_eulsph.scheme.health import UnstableError
from warp_eulsph.scheme.scalar import ConservationLaw, LinearAdvection, OneStepLax, TwoStepLaxWendroff
from warp_eulsph.scheme.smoothing import LinearExact, NeighbourAverage
from warp_eulsph.transport import Transport
from warp_eulsph.validation.cases import cosine_profile

SMALL = {
    "until": 0.1,
    "time_step": 0.01,
    "transport": {
        "shape": {"kind": "box", "lower": [0, 0], "upper": [1, 1], "spacing": 0.25},
        "velocity": [1, 0],
        "initial": "x*y",
    },
}
SCHEMES = [
    OneStepLax(),
    TwoStepLaxWendroff(),
    TwoStepLaxWendroff(NeighbourAverage(Linear())),
    TwoStepLaxWendroff(LinearExact()),
]


def small(**changes):
    """A small case with other entries in its table ``transport``, and others at the top."""
    case = json.loads(json.dumps(SMALL))
    for name, value in changes.items():
        (case["transport"] if name in ("velocity", "initial", "exact", "held", "shape") else case)[name] = value
    return case


def blob(dim, scheme=TwoStepLaxWendroff(), dtype=wp.float64):
    """A Gaussian on a jittered cloud, carried along the diagonal; particles at the inflow are held."""
    x, volume = cloud(dim, {1: 24, 2: 9, 3: 5}[dim], jitter=0.1)
    law = ConservationLaw(
        x,
        volume,
        np.exp(-np.square(x - 0.4).sum(axis=1) / 0.04),
        flux=LinearAdvection((1.0,) * dim),
        scheme=scheme,
        held=lambda X: X[:, 0] < 0.1,
        dtype=dtype,
    )
    return Transport(law, 0.01, lambda X, t: np.exp(-np.square(X - 0.4 - t).sum(axis=1) / 0.04))


# case files of the paper's examples


@pytest.mark.parametrize(("scheme", "dilation", "cfl"), cosine_profile.EXPECTED)
def test_cosine_profile_from_its_file_to_every_printed_digit(scheme, dilation, cfl):
    overrides = [f"parameters.cfl={cfl}", f"dilation={dilation}", f"scheme={type(scheme).__name__}"]
    case = read_case(CASES / "cosine_profile.toml", overrides)
    transport = case.build()
    while transport.t < case.until:
        transport.advance(case.until)
    inside = transport.x[:, 0] < 1.0
    found = cosine_profile.measure(transport.x[inside, 0], transport.values[inside])
    for value, printed in zip(found, cosine_profile.EXPECTED[scheme, dilation, cfl], strict=True):
        digits = len(printed.split(".")[1])
        assert value == pytest.approx(float(printed), abs=0.5000001 * 10.0**-digits)
    # Beyond ]0, 1[ there is what has left it; with CFL 2 on three particles nothing is lost.
    assert transport.amounts()["error"] == pytest.approx(found[3], abs=0.02)


@pytest.mark.parametrize("waves", [1, 6, 17, 25])
@pytest.mark.parametrize("cfl", [0.5, 1.5, 2])
def test_waves_are_amplified_and_turned_as_the_factor_says(waves, cfl):
    case = read_case(CASES / "amplification.toml", [f"parameters.waves={waves}", f"parameters.cfl={cfl}"])
    transport = case.build()
    while transport.t < case.until:
        transport.advance(case.until)
    # Phases of some hundred radians are rounded to 1e-13.
    assert transport.steps == 40 and transport.amounts()["error"] < 1e-12
    amplification = case.parameters["amplification"]
    assert amplification == pytest.approx(1.0, abs=1e-12) if cfl == 2 else amplification < 1.0


# stopping and resuming


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("scheme", SCHEMES, ids=repr)
def test_resume_is_bitwise(scheme, dim, dtype):
    whole = blob(dim, scheme, dtype)
    for _ in range(7):
        whole.advance(0.1234)
    arrays = {name: array.numpy().copy() for name, array in whole.evolving().items()}
    counters = whole.counters
    resumed = blob(dim, scheme, dtype)
    for array in (resumed.law.U, resumed.law.half, resumed.law._grad_U, resumed.law._flux, resumed.law._grad_flux):
        array.assign(np.full_like(array.numpy(), np.nan))
    resumed.restore(arrays, counters)
    for transport in (whole, resumed):
        while transport.t < 0.1234:
            transport.advance(0.1234)
    assert resumed.counters == whole.counters and whole.t == 0.1234 and whole.steps == 13
    assert resumed.values.tobytes() == whole.values.tobytes()
    with pytest.raises(ValueError, match="restore: arrays must have names and shapes"):
        resumed.restore({"U": np.zeros((3, 1))}, counters)


@pytest.mark.parametrize("name", ["amplification", "cosine_profile"])
@pytest.mark.parametrize("precision", ["double", "single"])
def test_stopped_runs_of_the_examples_leave_the_same_files(name, precision, tmp_path):
    case = read_case(CASES / f"{name}.toml", [f"precision={precision}"])

    def run(directory, stop=None, **options):
        transport = case.build()
        watch = None if stop is None else stop.watch
        return record(transport, directory, case.until, case.recording(transport), stop=stop, watch=watch, **options)

    assert run(tmp_path / "whole").stopped is None
    stop = StopAfter(1, 13, 14)
    assert run(tmp_path / "parts", stop).stopped == "step 1"
    assert [run(tmp_path / "parts", stop, resume=True).stopped for _ in range(3)] == ["step 13", "step 14", None]
    assert contents(tmp_path / "parts") == contents(tmp_path / "whole")


def test_changed_cases_are_not_resumed(tmp_path, capsys):
    arguments = ["run", str(CASES / "cosine_profile.toml"), "-o", str(tmp_path), "--max-wall", "0"]
    assert main(arguments) == 75
    (tmp_path / "case.toml").write_text((CASES / "cosine_profile.toml").read_text().replace("[1] ", "[2] "))
    home = RunDirectory(tmp_path)
    described = home.read(home.description)
    described["case"]["source"] = str(tmp_path / "case.toml")
    home.write(home.description, described)
    assert main(["resume", str(tmp_path)]) == 2
    assert "simulation.flux.velocity: [1.0], now [2.0]" in capsys.readouterr().err


# what a run keeps


def test_run_is_recorded_looked_at_and_drawn(tmp_path, capsys):
    assert main(["run", "example:cosine_profile", "-o", str(tmp_path / "run")]) == 0
    run = Run(tmp_path / "run")
    assert run.fields == ["x", "exact", "particle", "value", "volume"] and run.units["value"] == "-"
    assert run[-1].N == 50 and len(run) == 6 and run.times[-1] == 0.6
    np.testing.assert_allclose(run[-1]["exact"], cosine_profile.profile(run[-1].x[:, 0], 0.8), rtol=0, atol=1e-6)
    assert run.log["amount"] == pytest.approx(0.12, rel=1e-12) and run.log["error"][0] == 0.0
    assert run.log["step"].tolist() == [0, 16, 30]
    # The log is of all particles, the snapshots of those in ]0, 1[
    inside = np.sqrt(np.sum(np.square(run[-1]["value"] - run[-1]["exact"]) / 50))
    assert inside == pytest.approx(cosine_profile.measure(run[-1].x[:, 0].astype(float), run[-1]["value"])[3], rel=1e-5)
    assert inside < run.log["error"][-1] < 1.001 * inside
    assert main(["info", str(tmp_path / "run")]) == 0
    said = capsys.readouterr().out
    assert "velocity [1.0] m/s, 1-D, float64" in said and "L2 error 0.163" in said
    assert main(["check", str(tmp_path / "run")]) == 0
    assert main(["plot", str(tmp_path / "run"), "-o", str(tmp_path / "a.png")]) == 0
    assert (tmp_path / "a.png").stat().st_size > 10_000
    assert main(["export", str(tmp_path / "run"), str(tmp_path / "a.npz")]) == 0
    assert np.load(tmp_path / "a.npz")["value"].shape == (6, 50)


def test_exact_values_are_drawn_and_fit_into_the_picture(tmp_path):
    from warp_eulsph.pictures import Picture, fitted, quantity

    case = parse_case(small(initial="x", exact="x + 3"))
    transport = case.build()
    record(transport, tmp_path, 0.01, case.recording(transport))
    frame = Run(tmp_path)[0]
    assert quantity(frame, "value").exact == pytest.approx(frame["exact"])
    assert fitted(Picture(field="value"), [frame]).limits == (0.125, 3.875)
    assert quantity(frame, "exact").exact is None


def test_interpolation_and_data_sets_of_a_transported_quantity(tmp_path):
    pytest.importorskip("xarray")
    transport = blob(2)
    record(transport, tmp_path, 0.05, Recording(snapshots=EveryTime(0.02), dtype=np.float64, log=EverySteps(2)))
    run = Run(tmp_path)
    assert set(run.fields) == {"x", "value", "exact", "volume", "smoothing_length", "body", "particle"}
    assert run.to_xarray().value.sel(time=0.02).shape == (81,)
    assert run.log["error"][-1] == pytest.approx(transport.amounts()["error"])
    linear = parse_case(small(initial="x + 2*y", output={"precision": "double"}))
    transport = linear.build()
    record(transport, tmp_path / "linear", 0.01, linear.recording(transport))
    found = Run(tmp_path / "linear")[0].interpolate(np.array([[0.4, 0.3]]), "value")
    assert found == pytest.approx(1.0, abs=1e-13)


def test_growth_is_named_and_the_last_good_frame_stays(tmp_path):
    law = ConservationLaw(
        (np.arange(20) + 0.5)[:, None] / 20,
        0.05,
        np.sin(2.0 * np.pi * (np.arange(20) + 0.5) / 20) + 1e-3 * (-1.0) ** np.arange(20),
        flux=LinearAdvection((1.0,)),
        dilation=1.3,
        periodic=(1.0,),
    )
    transport = Transport(law, 0.15)
    with pytest.raises(
        UnstableError, match=r"particle \d+ at x = \[.*\] m has the value .*; the last good snapshot is"
    ):
        record(transport, tmp_path, 100.0, Recording(snapshots=EverySteps(1)))
    run = Run(tmp_path)
    assert run.state == "unstable" and np.abs(run[-1]["value"]).max() < 100.2 and transport.steps == run.steps[-1] + 1


def test_errors_name_the_input(tmp_path):
    transport = blob(1)
    with pytest.raises(ValueError, match="time step must be positive and finite, got 0"):
        Transport(transport.law, 0.0)
    with pytest.raises(ValueError, match="probes look at solids, got 'a' for a transported quantity"):
        record(transport, tmp_path / "a", 1.0, Recording(probes=[BodyProbe(name="a")]))
    with pytest.raises(ValueError, match=r"snapshot fields must be among \['value', 'exact'.* got \['velocity'\]"):
        record(transport, tmp_path / "a", 1.0, Recording(fields=["velocity"]))
    with pytest.raises(ValueError, match="exact values need an exact solution"):
        _ = Transport(transport.law, 0.1).exact_values
    assert not (tmp_path / "a" / "run.json").exists()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"velocity": [1]}, "transport.velocity: must have 2 components, got 1"),
        ({"initial": [1, 2]}, "transport.initial: must have 1 component, got 2"),
        ({"initial": "t"}, "transport.initial: unknown name 't'"),
        ({"exact": "z"}, "transport.exact: ['z'] are not coordinates in 2-D"),
        ({"held": "x"}, "transport.held: must be a comparison"),
        ({"time_step": 0}, "time_step: input should be greater than 0, got 0"),
        ({"scheme": "Verlet"}, "scheme: unknown kind 'Verlet'; known are ['OneStepLax', 'TwoStepLaxWendroff']"),
        ({"periodic": [1]}, "periodic: must have 2 lengths, got 1"),
        ({"body": {}}, "body: unknown key"),
        ({"output": {"body": "a"}}, "output.body: unknown key"),
        ({"output": {"fields": ["velocity"]}}, "output.fields: unknown field 'velocity'"),
        ({"output": {"fields": ["exact"]}}, "output.fields: 'exact' needs the exact solution; give transport.exact"),
    ],
)
def test_each_mistake_of_a_case_is_named_with_its_place(changes, message):
    with pytest.raises(CaseError) as caught:
        parse_case(small(**changes))
    (problem,) = caught.value.problems
    assert problem.startswith(message)
