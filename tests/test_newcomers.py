"""Small mistakes of whoever is new: each error says what was wrong, what is allowed, what was given, and what to do."""

import functools
from dataclasses import dataclass

import numpy as np
import pytest
from bodies import RUBBER, block, lattice
from case_files import small

import warp_eulsph as es
from warp_eulsph.boundaries import Boundary
from warp_eulsph.cases import CaseError, parse_case
from warp_eulsph.cli import main
from warp_eulsph.interactions import Plane, RigidBody
from warp_eulsph.materials import J2, NeoHookean
from warp_eulsph.output import record


@dataclass(frozen=True)
class Unbound(Boundary):
    def bind(self, assembly):
        return None


class UnboundToo(es.Interaction):
    def bind(self, assembly):
        return None


@dataclass(frozen=True, kw_only=True)
class Wrong(NeoHookean):
    """Rubber whose author forgot something."""

    given: dict | None = None
    lawless: bool = False

    def constants(self):
        return self.given or super().constants()

    def law(self, space):
        return None if self.lawless else super().law(space)


WRONG = functools.partial(Wrong, density=1100.0, young=1e6, poisson=0.3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"device": "cuda:77"}, r"device must be one of \['cpu'.*\], got 'cuda:77'; None takes Warp's default"),
        ({"device": "gpu"}, r"device must be one of .* got 'gpu'"),
        (
            {"boundaries": [Unbound()]},
            r"what Unbound.bind\(assembly\) returns must be such as a Bound, .* got NoneType",
        ),
        ({"interactions": [UnboundToo()]}, r"what UnboundToo.bind\(assembly\) returns must be such as a BoundInter"),
    ],
)
def test_options_of_a_simulation(options, message):
    with pytest.raises(ValueError, match=message):
        es.Simulation(block(2, 4), **options)


@pytest.mark.parametrize(
    ("material", "message"),
    [
        (WRONG(given={"mu": 1.0}), r"Wrong.constants\(\) must be a dict of \['kappa', 'mu'\], .* got \{'mu': 1.0\}"),
        (WRONG(given={"mu": 1.0, "lam": 1.0, "nu": 0.3}), r"Wrong.constants\(\) must be a dict of \['kappa', 'mu'\]"),
        (WRONG(given=[1.0]), r"Wrong.constants\(\) must be a dict"),
        (WRONG(lawless=True), r"what Wrong.law\(space\) returns must be such as Law\(Constants, .* got NoneType"),
    ],
)
def test_laws_of_ones_own(material, message):
    """A constant that is left out was 0 without a word."""
    with pytest.raises(ValueError, match=message):
        es.Simulation(block(2, 4, material=material))


@pytest.mark.parametrize(
    ("x", "volume", "message"),
    [
        (lattice(2, 4), 0.0625e-9, r"the nearest of its body 3.16e\+04 spacings away; that is 1 where x, volume and"),
        (lattice(2, 4), 0.0625e6, r"with 15 neighbours .* the nearest of its body 0.001 spacings away"),
        (np.zeros((1, 2)), 1.0, r"the nearest of its body inf spacings away; .* at least 2 particles"),
    ],
    ids=["in mm", "in km", "one particle"],
)
def test_units_that_do_not_fit(x, volume, message):
    with pytest.raises(ValueError, match=message):
        es.Simulation(es.Body(x=x, volume=volume, material=RUBBER))


def test_calls():
    """What is missing, or in another place than meant, is told with all that is taken."""
    with pytest.raises(TypeError, match=r"and 'poisson'. NeoHookean takes density, young, poisson, all by name$"):
        es.NeoHookean(density=1100.0)
    with pytest.raises(TypeError, match=r"multiple values for argument 'value'. Pressure takes value, region"):
        es.Pressure(lambda X: X[:, 0] > 0.7, value=1e5)
    with pytest.raises(TypeError, match=r"missing .* 'hardening'. J2 takes density, young, poisson, hardening"):
        J2(density=1100.0, young=1e6, poisson=0.3)
    with pytest.raises(ValueError, match=r"J2: hardening must be such as \w+\(...\), got 'linear'"):
        J2(density=1100.0, young=1e6, poisson=0.3, hardening="linear")
    with pytest.raises(ValueError, match=r"bodies must be a list of names, got 'body'; write \['body'\]"):
        RigidBody(Plane((0.0, 1.0)), bodies="body")
    simulation = es.Simulation(block(2, 4))
    with pytest.raises(ValueError, match=r"reaction: .* is not one of simulation.boundaries; give one of these"):
        simulation.reaction(es.Fixed())
    with pytest.raises(ValueError, match=r"history has no names, for these materials remember nothing, got 'strain'"):
        simulation.history("strain")
    with pytest.raises(IndexError) as caught:
        es.Simulation(block(2, 4), boundaries=[es.Fixed(lambda X: X[:, 2] < 0.3)])
    assert caught.value.__notes__ == ["Fixed: in the function of its region, for positions of shape (16, 2)"]


@pytest.mark.parametrize("place", ["file", "file/below"])
def test_places_that_cannot_be_written(place, tmp_path):
    (tmp_path / "file").write_text("kept")
    with pytest.raises(OSError, match=r"must have a directory that can be made, got .*file.* \(.*\); choose another"):
        record(es.Simulation(block(2, 4, material=RUBBER)), tmp_path / place, 1e-3)
    assert (tmp_path / "file").read_text() == "kept"


@pytest.mark.parametrize("command", ["check", "info", "resume"])
def test_a_case_is_no_run(command, tmp_path, capsys):
    (tmp_path / "case.toml").write_text("until = 1.0")
    assert main([command, str(tmp_path / "case.toml")]) == 2
    assert "case.toml, which is a file: cases are run by warp-eulsph run, into directories" in capsys.readouterr().err


def test_case_files():
    """Keys of the case beneath a table are that table's; numbers have no units."""
    wrong = small(until="1 s")
    wrong["body"]["a"] |= {"precision": "single", "velocty": 1.0}
    with pytest.raises(CaseError) as caught:
        parse_case(wrong)
    text = str(caught.value)
    assert "body.a.precision: unknown key; it is one of the case: write it above the first [table]; known here" in text
    assert "body.a.velocty: unknown key; did you mean 'velocity'?" in text
    assert "until: not a formula: '1 s' (invalid syntax); numbers are in SI units and have none written" in text
