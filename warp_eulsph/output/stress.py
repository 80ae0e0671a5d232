"""Cauchy stress of a state, all nine components in any dimension."""

import functools
from typing import Any

import numpy as np
import warp as wp

from ..execution import launch
from ..materials import Law, Material
from ..scheme.flux import stress_in_reference
from ..space import Space, matrix_type
from .recorded import RecordedSolids


@functools.cache
def _make_cauchy(space: Space, full: Space, law: Law) -> Any:
    """Kernel: σ of F in the space of the simulation, by a law in ``full`` dimensions with missing stretches of one."""
    real, mat, Constants = space.real, space.mat, law.Constants
    mat33, dim, full_dim = matrix_type(3, 3, space.real), space.dim, full.dim
    Q_of = stress_in_reference(full, law)

    @wp.kernel(module="unique", enable_backward=False)
    def cauchy(first: int, F: wp.array(dtype=mat), c: Constants, sigma: wp.array(dtype=mat33)):
        a = first + wp.tid()
        F_a = F[a]
        G = wp.identity(n=wp.static(full_dim), dtype=real)
        for j in range(wp.static(dim)):
            for k in range(wp.static(dim)):
                G[j, k] = F_a[j, k]
        stress = Q_of(G, G, c)
        out = mat33()
        for j in range(wp.static(full_dim)):
            for k in range(wp.static(full_dim)):
                out[j, k] = stress[j, k]
        sigma[a] = out

    return cauchy


def body_stress(space: Space, material: Material, body: range, F: wp.array, sigma: wp.array) -> None:
    """σ [Pa] of the deformation gradients ``F`` of one material's particles into ``sigma``, (n,) of 3 × 3."""
    full = Space(3, space.real)
    try:
        law = material.law(full)
    except ValueError:
        # A law of fewer dimensions only, a bar: uniaxial stress, the components it does not give are zero.
        full = Space(space.dim, space.real)
        law = material.law(full)
    constants = law.Constants()
    for name, value in material.constants().items():
        setattr(constants, name, value)
    kernel = _make_cauchy(Space(space.dim, space.real), full, law)
    launch(kernel, len(body), [F, constants, sigma], F.device, body.start)


def stresses(space: Space, n: int, device: Any) -> wp.array:
    """An array for ``n`` stresses of 3 × 3 reals."""
    return wp.empty(n, dtype=matrix_type(3, 3, space.real), device=device)


def stress_array(simulation: RecordedSolids) -> wp.array:
    """σ = P(F) Fᵀ / J [Pa] of the present state by place, (n,) of 3 × 3: M1, the reference being the present.

    In 2-D and 1-D the 3-D law acts on F with the missing stretches equal to one, so σ33 of plane strain is there too.
    """
    space, F = simulation.space, simulation.stepper.U.F
    sigma = stresses(space, len(F), simulation.device)
    for body in simulation.bodies:
        body_stress(space, body.material, simulation.ranges[body.name], F, sigma)
    return sigma


def cauchy_stress(simulation: RecordedSolids) -> np.ndarray:
    """``stress_array`` on the host, by number, (n, 3, 3)."""
    return simulation.order.by_number(stress_array(simulation).numpy())
