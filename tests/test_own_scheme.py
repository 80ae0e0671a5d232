"""A scheme is one file: a frozen dataclass of options, and a stepper that is a table of contents."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from clouds import cloud

import warp_eulsph as es
from warp_eulsph.scheme.stepper import Stepper

FIXED = es.TimeStep(fixed=1e-4)
RUBBER = es.NeoHookean(density=1100.0, young=17e6, poisson=0.45)


@dataclass(frozen=True)
class KickThenDrift(es.Scheme):
    """Symplectic Euler: v^{n+1} of the forces of U^n, then F and x with v^{n+1}."""

    dissipation: es.Upwind | None = es.Upwind()
    correction: es.Correction | None = es.Balance()
    cfl: ClassVar[float] = 0.4

    def build(self, parts):
        return KickThenDriftStepper(self, parts)


class KickThenDriftStepper(Stepper):
    def advance(self):
        U, half = self.U, self.half
        self._velocity_gradient(U)
        self._choose_dt(U)
        self._stress(U, 0.0)
        self._sum_forces(U, U, 0.0)
        self._kick(U)
        self._impose(U, 1.0)
        self._velocity_gradient(U)
        self._drift(U, U, 0.0, half)
        half.v.assign(U.v)
        self._drift(U, U, 1.0, U)
        self._release(U)
        self._update(U)
        self._check(U)
        self.ledger.record(U, half)
        self.clock.tick()


def disc(scheme, reference, arrangement=es.Current()):
    x, volume = cloud(2, 10, jitter=0.1)
    v = 20.0 * np.sin(4.0 * x[:, ::-1])
    body = es.Body(x=x, volume=volume, material=RUBBER, velocity=v)
    return es.Simulation(body, scheme=scheme, reference=reference, arrangement=arrangement)


@pytest.mark.parametrize("reference", [es.Never(), es.Every(3), es.Always()], ids=repr)
def test_own_scheme_runs_and_its_books_close(reference):
    simulation = disc(KickThenDrift(), reference)
    momentum, energy = simulation.momentum(), simulation.energy()["total"]
    simulation.run(5e-3)
    books = simulation.energy()
    assert simulation.steps > 10
    assert np.abs(simulation.momentum() - momentum).max() < 1e-11 * 1100.0 * 20.0
    assert abs(books["residual"]) < 1e-11 * energy
    other = disc(es.Verlet(tie=None, tilt=None, sharpening=None), reference)
    other.run(5e-3)
    moved = np.abs(other.displacement).max()
    assert np.abs(simulation.x - other.x).max() < 0.05 * moved


def test_what_a_scheme_does_not_offer_is_none():
    own = KickThenDrift()
    assert own.smoothing is own.limiter is own.shifting is own.tie is None
    assert es.Verlet().smoothing is es.Lax().tie is None


@pytest.mark.parametrize("correction", [None, es.PairAreas(), es.SurfaceVectors()], ids=repr)
@pytest.mark.parametrize("scheme", [es.Verlet, es.LaxWendroff])
def test_shifting_needs_potentials(scheme, correction):
    with pytest.raises(ValueError, match=r"shifting needs correction=Balance\(\) or Uncorrected\(\), whose pot"):
        scheme(correction=correction, shifting=es.Shifting())


@pytest.mark.parametrize("correction", [es.PairAreas(), es.SurfaceVectors()], ids=repr)
def test_corrections_are_for_what_moves(correction):
    """A solid beside a liquid keeps its arrangement, and needs none."""
    x, volume = cloud(2, 6)
    solid = es.Body(x=x, volume=volume, material=RUBBER, velocity=3.0 * x, name="solid")
    water = es.TaitLiquid(density=1e3, sound_speed=50.0)
    liquid = es.Body(x=x + 2.0, volume=volume, material=water, velocity=-x, name="liquid")
    simulation = es.Simulation([solid, liquid], scheme=es.Verlet(correction=correction), time_step=FIXED)
    alone = es.Simulation(solid, reference=es.Never(), time_step=FIXED)
    for each in (simulation, alone):
        each.step(10)
    assert np.array_equal(simulation.x[: len(x)], alone.x)
    assert simulation.energy()["correction"] != 0.0 == alone.energy()["correction"]
