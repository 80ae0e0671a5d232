"""Cauchy stress of a state, all nine components in any dimension."""

import functools
from typing import Any

import numpy as np
import warp as wp

from ..materials import Law, Material
from ..scheme.flux import stress_in_reference
from ..simulation import Simulation
from ..space import Space


def padded(tensors: np.ndarray, diagonal: float) -> np.ndarray:
    """Tensors (n, dim, dim) as (n, 3, 3), with ``diagonal`` on the missing part of the diagonal."""
    n, dim = tensors.shape[:2]
    full = np.zeros((n, 3, 3), dtype=tensors.dtype)
    full[:, range(dim, 3), range(dim, 3)] = diagonal
    full[:, :dim, :dim] = tensors
    return full


@functools.cache
def _make_cauchy(space: Space, law: Law) -> Any:
    mat, Constants = space.mat, law.Constants
    Q_of = stress_in_reference(space, law)

    @wp.kernel(module="unique", enable_backward=False)
    def cauchy(F: wp.array(dtype=mat), c: Constants, sigma: wp.array(dtype=mat)):
        a = wp.tid()
        sigma[a] = Q_of(F[a], F[a], c)

    return cauchy


def body_stress(material: Material, F: np.ndarray, real: type, device: Any) -> np.ndarray:
    """σ of deformation gradients ``F`` (n, dim, dim) of one material [Pa], (n, 3, 3)."""
    try:
        space = Space(3, real)
        law = material.law(space)
    except ValueError:
        # A law of fewer dimensions only, a bar: uniaxial stress, the components it does not give are zero.
        space = Space(F.shape[1], real)
        law = material.law(space)
    constants = law.Constants()
    for name, value in material.constants().items():
        setattr(constants, name, value)
    gradients = wp.array(padded(F, 1.0) if space.dim == 3 else F, dtype=space.mat, device=device)
    sigma = wp.zeros_like(gradients)
    wp.launch(_make_cauchy(space, law), len(F), [gradients, constants, sigma], device=device)
    return padded(sigma.numpy(), 0.0)


def cauchy_stress(simulation: Simulation) -> np.ndarray:
    """σ = P(F) Fᵀ / J [Pa] of the present state, (n, 3, 3): M1 with the present configuration as reference.

    In 2-D and 1-D the 3-D law acts on F with the missing stretches equal to one, so σ33 of plane strain is there too.
    """
    F, real, device = simulation.F, simulation.space.real, simulation.device
    ends = np.cumsum([len(body.x) for body in simulation.bodies])[:-1]
    parts = zip(simulation.bodies, np.split(F, ends), strict=True)
    return np.concatenate([body_stress(body.material, F_body, real, device) for body, F_body in parts])
