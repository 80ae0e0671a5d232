"""Who is at a free surface of an arrangement, by its sums alone: faces, edges, corners, and nobody inside."""

import numpy as np
import pytest
import warp as wp

import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.scheme.exposure import EXPOSED

OPTIONS = {
    "cubic spline": {"weight": es.CubicSpline(), "dilation": 1.3},
    "liquids": {},
}


def sums(dim, jitter, n, **options):
    """|e_a| over the face, and the layer of each particle counted from the nearest face, for a block of liquid."""
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / n, jitter=jitter)
    simulation = es.Simulation(
        es.Body(x=x, volume=volume, material=es.TaitLiquid(density=1.0, sound_speed=1.0)), **options
    )
    medium = simulation.stepper.medium
    e = wp.zeros(len(x), dtype=simulation.space.vec, device=simulation.device)
    medium.configuration.refresh(simulation.stepper.U)
    medium.configuration.defect(wp.zeros_like(e), e)
    e = simulation.order.by_number(e.numpy())
    layers = np.floor(np.minimum(x, 1.0 - x) * n).astype(int).min(axis=1)
    return np.linalg.norm(e, axis=1) * n ** (dim - 1), layers


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
@pytest.mark.parametrize("jitter", [0.0, 0.1, 0.2])
@pytest.mark.parametrize(("dim", "n"), [(1, 24), (2, 16), (3, 10)])
def test_surfaces_are_told_from_disorder(dim, n, jitter, options):
    """Outermost particles of flat faces, edges and corners are above the share, all others below it."""
    found, layers = sums(dim, jitter, n, **options)
    assert found[layers == 0].min() > EXPOSED > found[layers > 0].max()


@pytest.mark.parametrize("dim", [2, 3])
def test_what_flew_off_and_sheets_of_one_layer_are_at_a_surface(dim):
    """They have next to no e_a: without neighbours, or with as many on both sides. Deep inside a block nothing is."""
    n = 12
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / n)
    water = es.TaitLiquid(density=1.0, sound_speed=1.0)
    simulation = es.Simulation(es.Body(x=x, volume=volume, material=water))
    medium, U = simulation.stepper.medium, simulation.stepper.U
    moved = U.x.numpy()
    sheet, lone = moved[:, -1] < 1.0 / n, (moved > 1.0 - 1.0 / n).all(axis=1)
    deep = (np.abs(moved[:, :-1] - 0.5) < 0.6 / n).all(axis=1) & (np.abs(moved[:, -1] - 7.0 / n) < 1.1 / n)
    moved[sheet, -1] -= 5.0 / n
    moved[lone, -1] += 2.5 / n  # the block's edge is within its reach
    U.x.assign(moved)
    medium.configuration.refresh(U)
    medium.stabilise(U)
    beside = medium.shifter.exposure.beside.numpy()
    assert deep.any() and beside[sheet | lone].all() and not beside[deep].any()


@pytest.mark.parametrize("dim", [1, 2])
def test_area_vectors_begin_at_free_surfaces_alone(dim):
    """e_a where the support reaches a surface, exactly zero inside a jittered block; they sum to its faces."""
    n = 24
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / n, jitter=0.1)
    water = es.TaitLiquid(density=1.0, sound_speed=1.0)
    simulation = es.Simulation(
        es.Body(x=x, volume=volume, material=water), scheme=es.Verlet(), weight=es.CubicSpline(), dilation=1.3
    )
    s = simulation.order.by_number(simulation.stepper.U.surface.numpy())
    layers = np.floor(np.minimum(x, 1.0 - x) * n).astype(int).min(axis=1)
    assert (s[layers > 4] == 0.0).all() and (np.abs(s[layers < 2]).max(axis=1) > 0.0).all()
    assert s[x[:, 0] > 0.5, 0].sum() == pytest.approx(1.0, rel=0.03)
