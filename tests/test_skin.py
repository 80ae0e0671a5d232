"""The skin of bodies: which particles are outermost, the face of each, which way out is."""

from dataclasses import dataclass

import numpy as np
import pytest
import warp as wp
from bodies import RUBBER, block

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.geometry import disc
from warp_eulsph.interactions import BoundInteraction
from warp_eulsph.interactions.skin import Skin

REFERENCES = pytest.mark.parametrize("arrangement", [es.Convected(), es.Current()], ids=["fixed", "moving"])


@dataclass(frozen=True)
class Looker(es.Interaction):
    """Finds the skin and exerts nothing."""

    names: tuple | None = None

    def bind(self, assembly):
        return BoundLooker(self, assembly)


class BoundLooker(BoundInteraction):
    sortable = True

    def __init__(self, option, assembly):
        self.option, self.assembly, self.indices = option, assembly, np.arange(len(assembly.X))

    def start(self, world):
        self.skin = Skin(world, self.assembly, self.option.names)
        self.skin.look(world.U)

    def rebuild(self, world):
        self.skin.rebuild()

    def forces(self, world, state, fraction, out):
        pass


def skin_of(bodies, **options):
    """The skin, whose arrays are cut to what is outermost, as numpy: numbers, area, normal, bend; the simulation."""
    simulation = es.Simulation(bodies, interactions=[Looker()], **options)
    return simulation, *outermost(simulation)


def outermost(simulation):
    skin = simulation.bound_interactions[0].skin
    there = skin.there.numpy() == 1
    return skin.indices[there], *(array.numpy()[there] for array in (skin.area, skin.normal, skin.bend))


@REFERENCES
@pytest.mark.parametrize("jitter", [0.0, 0.1])
@pytest.mark.parametrize(("dim", "n"), [(1, 10), (2, 8), (3, 6)])
def test_the_outer_layer_of_a_block(dim, n, jitter, arrangement):
    simulation, numbers, area, normal, bend = skin_of(block(dim, n, jitter), arrangement=arrangement)
    cell = np.floor(block(dim, n).x * n).astype(int)
    expected = np.flatnonzero(((cell == 0) | (cell == n - 1)).any(axis=1))
    assert np.array_equal(numbers, expected)
    # on one face: what the others do not reach
    top = (cell[numbers, 0] == n - 1) & ((cell[numbers, 1:] > 1) & (cell[numbers, 1:] < n - 2)).all(axis=1)
    assert top.any()
    tolerance = 0.01 if jitter == 0.0 else 0.25  # each for itself; the sum is better
    np.testing.assert_allclose(area[top] * n ** (dim - 1), 1.0, atol=tolerance)
    assert area[top].mean() * n ** (dim - 1) == pytest.approx(1.0, abs=0.05)
    assert (normal[top, 0] > (1.0 - 1e-6 if jitter == 0.0 else 0.98)).all()
    assert (bend[top] < (1e-6 if jitter == 0.0 else 0.05)).all()
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, rtol=1e-12)
    skin = simulation.bound_interactions[0].skin
    M = RUBBER.young * (1 - RUBBER.poisson) / ((1 + RUBBER.poisson) * (1 - 2 * RUBBER.poisson))
    np.testing.assert_allclose(skin.modulus.numpy(), M, rtol=1e-12)
    np.testing.assert_allclose(skin.half.numpy(), 0.5 / n, rtol=1e-12)


@pytest.mark.parametrize(("dim", "n", "more"), [(2, 8, 0.003), (3, 6, 0.09), (3, 12, 0.04)])
def test_a_whole_face_has_its_area(dim, n, more):
    """Its rims and corners included, for whom lies on it; in 3-D rims count for some more, the less the finer."""
    simulation, numbers, area, _, _ = skin_of(block(dim, n))
    on = simulation.x[numbers, 0] > 1.0 - 1.0 / n
    assert on.sum() == n ** (dim - 1)
    assert -0.003 < area[on].sum() - 1.0 < more


@REFERENCES
def test_a_disc(arrangement):
    x, volume = disc(centre=(0.0, 0.0), radius=1.0, spacing=0.1)
    body = es.Body(x=x, volume=volume, material=RUBBER)
    _, numbers, area, normal, _ = skin_of(body, arrangement=arrangement)
    at = x[numbers]
    radius = np.linalg.norm(at, axis=1)
    assert radius.min() > 0.9
    assert area.sum() == pytest.approx(2.0 * np.pi, rel=0.01)
    assert np.einsum("ka,ka->k", normal, at / radius[:, None]).min() > np.cos(np.radians(21.0))  # of a cut lattice


@REFERENCES
def test_normals_follow_what_turns_and_bends(arrangement):
    """A plate two particles thick, rolled up: its normals are those of the arc, its two faces do not see each other."""
    n = 60
    flat = np.stack(np.meshgrid((np.arange(n) + 0.5) / n, [-0.5 / n, 0.5 / n], indexing="ij"), -1).reshape(-1, 2)
    body = es.Body(x=flat, volume=1.0 / n**2, material=RUBBER)
    simulation, numbers, area, _, _ = skin_of(body, arrangement=arrangement)
    assert len(numbers) == 2 * n
    inside = (flat[numbers, 0] > 3.0 / n) & (flat[numbers, 0] < 1.0 - 3.0 / n)
    np.testing.assert_allclose(area[inside] * n, 1.0, atol=0.01)
    angle = 2.0 * flat[:, 0]
    out = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    rolled = out * (0.5 + flat[:, 1:])
    along = np.stack([out[:, 1], -out[:, 0]], axis=1)
    F = np.einsum("ni,nj->nij", along * (2.0 * (0.5 + flat[:, 1:])), [[1.0, 0.0]] * len(flat))
    F += np.einsum("ni,nj->nij", out, [[0.0, 1.0]] * len(flat))
    simulation.stepper.U.x.assign(rolled)
    simulation.stepper.U.F.assign(F)
    simulation.bound_interactions[0].skin.look(simulation.stepper.U)
    _, _, normal, bend = outermost(simulation)
    expected = out * np.sign(flat[:, 1:])
    assert np.abs(normal - expected[numbers])[inside].max() < 1e-10
    assert bend[inside].max() < 0.01


def test_only_the_named_bodies_and_the_same_bits_by_threads_and_sorting():
    bodies = [block(2, 80, 0.1, name="one"), es.Body(x=block(2, 6).x + 2.0, volume=1 / 36, material=RUBBER, name="two")]
    simulation = es.Simulation(bodies, interactions=[Looker(("two",))])
    assert np.array_equal(outermost(simulation)[0] // 6400, np.ones(20))
    found = []
    for threads in (1, 4):
        execution.set_threads(threads)
        simulation, *own = skin_of(bodies, arrangement=es.Current())
        found.append([array.tobytes() for array in own])
    assert found[0] == found[1]
    before = outermost(simulation)
    simulation.sorting.permute(np.concatenate([np.arange(6400)[::-1], np.arange(6400, 6436)]))
    simulation.bound_interactions[0].skin.look(simulation.stepper.U)
    for old, new in zip(before, outermost(simulation), strict=True):
        np.testing.assert_allclose(new, old, atol=1e-10)  # sums in another order


@REFERENCES
def test_a_surface_that_opens(arrangement):
    """Where the arrangement is read anew, what a hole lays bare is outermost; otherwise it stays what it was."""
    body = block(2, 10)
    simulation, numbers, _, _, _ = skin_of(body, arrangement=arrangement)
    x = body.x.copy()
    x[x[:, 0] > 0.5, 0] += 0.3
    simulation.stepper.U.x.assign(x)
    if isinstance(arrangement, es.Current):
        simulation.stepper.refresh((0,))
    skin = simulation.bound_interactions[0].skin
    skin.find()
    now = skin.indices[skin.there.numpy() == 1]
    opened = np.flatnonzero(np.abs(body.x[:, 0] - 0.5) < 0.06)
    assert np.isin(opened, now).all() == isinstance(arrangement, es.Current)
    assert np.isin(numbers, now).all()


def test_float32():
    _, numbers, area, normal, _ = skin_of(block(3, 5), dtype=wp.float32)
    assert len(numbers) == 125 - 27 and normal.dtype == np.float32
    assert area.max() * 25 < 1.5


def test_a_body_without_a_surface_is_named():
    body = dict(x=block(2, 6).x, volume=1 / 36, material=RUBBER, name="ring", surface=0.0)
    with pytest.raises(ValueError, match="body 'ring' has no outermost particles"):
        skin_of(es.Body(**body), arrangement=es.Current())
