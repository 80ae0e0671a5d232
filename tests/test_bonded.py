"""Bonded bodies: one solid of several materials, whose joint transmits as one material would."""

import numpy as np
import pytest
import warp as wp
from bodies import RUBBER, lattice

import warp_eulsph as es
from warp_eulsph.output.description import describe

HARD = es.NeoHookean(density=2200.0, young=68e6, poisson=0.45)


def halves(dim, n, law=RUBBER, bonded="left"):
    """The unit box cut in the middle along x; ``law`` is that of the right half."""
    x = lattice(dim, n)
    x = x[np.argsort(x[:, 0], kind="stable")]
    v = 5.0 * np.sin(3.0 * x[:, ::-1])
    left = x[:, 0] < 0.5
    parts = ((left, RUBBER, "left", None), (~left, law, "right", bonded))
    return [
        es.Body(x=x[part], volume=float(n) ** -dim, material=material, velocity=v[part], name=name, bonded=bond)
        for part, material, name, bond in parts
    ]


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize(("reference", "arrangement"), [(es.Never(), es.Convected()), (es.Always(), es.Current())])
def test_bonded_halves_of_one_material_are_one_body(reference, arrangement, dim, dtype):
    """In every bit: nothing knows of the joint but the launches."""
    parts = halves(dim, {1: 20, 2: 8, 3: 4}[dim])
    x, v = (np.concatenate([getattr(body, name) for body in parts]) for name in ("x", "velocity"))
    whole = es.Body(x=x, volume=parts[0].volume[0], material=RUBBER, velocity=v)
    found = []
    for bodies in (parts, whole):
        simulation = es.Simulation(bodies, reference=reference, arrangement=arrangement, dtype=dtype, sort=False)
        simulation.step(20)
        found.append((simulation.x, simulation.v, simulation.F, simulation.t))
    assert all(np.array_equal(one, other) for one, other in zip(*found, strict=True))


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_books_and_momentum_close_across_the_joint(dim):
    simulation = es.Simulation(halves(dim, {1: 20, 2: 10, 3: 6}[dim], HARD))
    start, momentum = simulation.energy()["total"], simulation.momentum()
    simulation.step(60)
    energy = simulation.energy()
    assert abs(energy["residual"]) < 1e-12 * start
    np.testing.assert_allclose(simulation.momentum(), momentum, atol=1e-12 * 2200.0 * 5.0)
    apart = es.Simulation(halves(dim, {1: 20, 2: 10, 3: 6}[dim], HARD, bonded=None))
    apart.step(60)
    assert np.abs(apart.x - simulation.x).max() > 1e-3


def test_a_wave_is_transmitted_by_the_impedances():
    """A bar pushed at its soft end: behind the joint, and before it, v is 2 Z₁/(Z₁ + Z₂) of what comes in."""
    n = 200
    soft, hard = (es.LinearElastic(density=k * 1e3, young=k * 1e6, poisson=0.0) for k in (1.0, 4.0))  # equal speeds
    x = lattice(1, n)
    bodies = [
        es.Body(x=x[:100], volume=1 / n, material=soft, name="soft"),
        es.Body(x=x[100:], volume=1 / n, material=hard, name="hard", bonded="soft"),
    ]
    simulation = es.Simulation(bodies, boundaries=[es.Velocity([0], value=1e-3)])
    simulation.run(0.8 / np.sqrt(1e3))  # the front at 0.8, the reflected one at 0.2
    for begin, end in ((0.3, 0.47), (0.53, 0.7)):
        behind = (x[:, 0] > begin) & (x[:, 0] < end)
        assert simulation.v[behind, 0].mean() == pytest.approx(2.0 / (1.0 + 4.0) * 1e-3, rel=0.01)


def test_the_joint_is_no_surface():
    faces = []
    for bond in ("left", None):
        simulation = es.Simulation(halves(2, 28, HARD, bonded=bond))  # eight spacings from every other face
        inner = (np.abs(simulation.X[:, 0] - 0.5) < 0.05) & (np.abs(simulation.X[:, 1] - 0.5) < 0.2)
        vectors = simulation.order.by_number(simulation.stepper.U.surface.numpy())[inner]
        faces.append(np.abs(vectors).max() * 28.0)
    assert faces[0] < 1e-9 and faces[1] > 0.5


def test_what_cannot_be_bonded_is_named():
    left, right = halves(2, 6)
    for wrong in ("right", "nobody"):
        with pytest.raises(ValueError, match=r"body 'right': bonded must be a body before it, of \['left'\]"):
            es.Simulation([left, es.Body(x=right.x, volume=1 / 36, material=RUBBER, name="right", bonded=wrong)])
    water = es.TaitLiquid(density=1e3, sound_speed=20.0)
    with pytest.raises(ValueError, match="a fluid must not be bonded to a solid"):
        es.Simulation([left, es.Body(x=right.x, volume=1 / 36, material=water, name="right", bonded="left")])
    other = es.Body(x=right.x, volume=1 / 36, material=RUBBER, name="right", bonded="left", dilation=1.5)
    with pytest.raises(ValueError, match="bodies 'left' and 'right' are bonded and must be of one medium"):
        es.Simulation([left, other])
    with pytest.raises(ValueError, match="takes each body by itself and is not for bonded ones"):
        es.Simulation(halves(2, 6), arrangement=es.Current(), scheme=es.Verlet(correction=es.PairAreas()))


def test_bonds_are_described_where_they_are(caplog):
    simulation = es.Simulation(halves(2, 6))
    assert "overlap" not in caplog.text
    bodies = describe(simulation)["bodies"]
    assert bodies["right"]["bonded"] == "left" and "bonded" not in bodies["left"]
    es.Simulation(halves(2, 6, bonded=None))
    assert "overlap or touch" in caplog.text
