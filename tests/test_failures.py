"""Errors of runs that failed: which particle, how many are bad, what to do. And of schemes that do not go together."""

import numpy as np
import pytest
from bodies import block
from fluid_laws import GAS, OIL

import warp_eulsph as es
from warp_eulsph.materials import TaitLiquid

WATER = TaitLiquid(density=1000.0, sound_speed=20.0)


def fails(body, **options):
    """A run that fails soon, and its error."""
    simulation = es.Simulation(body, **options)
    with pytest.raises(es.UnstableError) as caught:
        simulation.run(1.0)
    return simulation, caught.value


def test_the_particle_of_the_least_volume_is_named_in_any_order():
    """Not the first in memory; sorted or not it is the same."""
    found = []
    for sort in (True, False):
        body = block(2, 12, velocity=-1e4 * block(2, 12).x)
        simulation, error = fails(body, time_step=es.TimeStep(cfl=8.0), sort=sort)
        J = np.linalg.det(simulation.F)
        bad = int((J <= 0.0).sum())
        assert error.particle == J.argmin() and 1 < bad < 144
        assert f"det F = {J.min():.4g}, must be positive; {bad} of 144 particles are bad;" in str(error)
        found.append(str(error))
    assert found[0] == found[1]


@pytest.mark.parametrize("field", ["v", "x", "F"])
def test_what_is_not_finite_is_named_where_it_began(field):
    """It has reached neighbours by the end of that step; the middle of where fewest have it is meant."""
    simulation = es.Simulation(block(2, 12), reference=es.Never(), scheme=es.Verlet(dissipation=None, sharpening=None))
    simulation.step(2)
    array = getattr(simulation.stepper.U, field)
    values = array.numpy()
    values[simulation.order.places[66]] = np.nan
    array.assign(values)
    with pytest.raises(es.UnstableError, match=r"of body 'body' at x = .* m at the start has non-finite") as caught:
        simulation.step()
    everything = np.concatenate([simulation.x, simulation.v, simulation.F.reshape(144, 4)], axis=1)
    bad = int((~np.isfinite(everything)).any(axis=1).sum())
    assert caught.value.particle == 66 and 1 < bad < 144
    assert f"; {bad} of 144 particles are bad; " in str(caught.value)


def test_one_bad_particle_is_not_counted():
    """A linear law goes on with det F = −1, so that it stays alone."""
    bar = es.materials.Bar(density=1000.0, young=1e6)
    simulation = es.Simulation(block(1, 8, material=bar), reference=es.Never())
    F = simulation.stepper.U.F.numpy()
    F[3] = -1.0
    simulation.stepper.U.F.assign(F)
    with pytest.raises(es.UnstableError, match=r"particle 3 .* has det F = -\d.*, must be positive; no snapshot") as e:
        simulation.step()
    assert e.value.particle == 3


def test_a_run_that_fails_everywhere_says_so():
    """All turn inside out in one step, which was given, so that no Courant number would change it."""
    body = block(1, 12, velocity=-1e3 * block(1, 12).x)
    _, error = fails(body, time_step=es.TimeStep(fixed=0.02))
    assert "; all 12 particles are bad, as when steps are too long or units do not fit; " in str(error)
    assert "try a shorter step than 0.02 s," in str(error) and "cfl" not in str(error)


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize(("material", "remedy"), [(OIL, True), (GAS, False)], ids=["liquid", "gas"])
def test_a_fluid_without_volume_says_so(material, remedy, dim):
    """It keeps J alone, 0 of one that is not positive: that det F were 0 would be untrue."""
    n = {1: 12, 2: 12, 3: 6}[dim]
    x = block(dim, n).x - 0.5
    along = x * np.eye(dim)[0]  # by one axis alone, so that J is negative in any dimension
    _, error = fails(block(dim, n, velocity=-3e5 * along, material=material), time_step=es.TimeStep(fixed=5e-6))
    assert "has no volume left, its J = det F went from positive to zero or below in this step" in str(error)
    assert "det F = 0" not in str(error) and "limiter" not in str(error)
    assert ("a sound_speed of 10 times the largest speed" in str(error)) is remedy


# schemes


def test_schemes_of_two_kinds_name_the_body_and_what_to_change():
    """What it says to do works, where the simulation was given a scheme, or the first body, or the second."""
    one, other = es.LaxWendroff(), es.Verlet()

    def build(first=None, second=None, given=None):
        bodies = [block(1, 8, name="first", scheme=first), block(1, 8, name="second", scheme=second)]
        return es.Simulation(bodies, scheme=given)

    with pytest.raises(
        ValueError, match=r"got LaxWendroff of body 'first' and Verlet of body 'second' by default; "
    ) as e:
        build(first=one)
    assert "give body 'second' scheme=LaxWendroff(...), or the simulation scheme=LaxWendroff(...)" in str(e.value)
    build(first=one, second=one), build(first=one, given=one)
    with pytest.raises(ValueError, match="got Verlet of body 'first' and LaxWendroff of body 'second'; ") as e:
        build(second=one)
    assert "give body 'second' scheme=Verlet(...), or the simulation scheme=LaxWendroff(...)" in str(e.value)
    build(second=other), build(second=one, given=one)
    with pytest.raises(ValueError, match=r"of body 'second'; give body 'second' scheme=Verlet\(...\)$"):
        build(first=other, second=one)
    with pytest.raises(ValueError, match=r"got Verlet of the simulation .* body 'second' scheme=Verlet\(...\)$"):
        build(second=one, given=other)
