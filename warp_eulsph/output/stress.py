"""Cauchy stress of a state, all nine components in any dimension."""

import functools

import numpy as np
import warp as wp

from ..execution import launch
from ..linalg import det
from ..materials import Law, Material
from ..materials.base import history_row, long_form
from ..space import Space, matrix_type
from .recorded import RecordedSolids


@functools.cache
def _make_cauchy(space: Space, full: Space, law: Law) -> wp.Kernel:
    """Kernel: σ of F in the space of the simulation, by a law in ``full`` dimensions with missing stretches of one."""
    real, mat, Constants = space.real, space.mat, law.Constants
    mat33, dim, full_dim, full_mat = matrix_type(3, 3, space.real), space.dim, full.dim, full.mat
    P_of, determinant = long_form(full, law).stress, det(full)
    row, remembers = history_row(full, law), bool(law.history)

    @wp.kernel(module="unique", enable_backward=False)
    def cauchy(
        first: int,
        begin: int,
        F: wp.array(dtype=mat),
        history: wp.array(dtype=row),
        c: Constants,
        sigma: wp.array(dtype=mat33),
    ):
        a = first + wp.tid()
        F_a = F[a]
        G = wp.identity(n=wp.static(full_dim), dtype=real)
        for j in range(wp.static(dim)):
            for k in range(wp.static(dim)):
                G[j, k] = F_a[j, k]
        h = row()
        if wp.static(remembers):
            h = history[a - begin]
        stress = P_of(G, full_mat(), h, real(0.0), c) @ wp.transpose(G) / determinant(G)
        out = mat33()
        for j in range(wp.static(full_dim)):
            for k in range(wp.static(full_dim)):
                out[j, k] = stress[j, k]
        sigma[a] = out

    return cauchy


def body_stress(space: Space, material: Material, body: range, F: wp.array, history: wp.array, sigma: wp.array) -> None:
    """σ [Pa] of the deformation gradients ``F`` of one material's particles into ``sigma``, (n,) of 3 × 3.

    ``history`` has the rows of the ``body``; what is viscous in the stress is left out, for nothing says how F moves.
    """
    full = Space(3, space.real)
    try:
        law = material.law(full)
    except ValueError:
        # A law of fewer dimensions only, a bar: uniaxial stress, the components it does not give are zero.
        full = Space(space.dim, space.real)
        law = material.law(full)
    kernel = _make_cauchy(Space(space.dim, space.real), full, law)
    launch(kernel, len(body), [body.start, F, history, material.filled_constants(law), sigma], F.device, body.start)


def stresses(space: Space, n: int, device: wp.DeviceLike) -> wp.array:
    """An array for ``n`` stresses of 3 × 3 reals."""
    return wp.empty(n, dtype=matrix_type(3, 3, space.real), device=device)


def stress_array(simulation: RecordedSolids) -> wp.array:
    """σ = P(F) Fᵀ / J [Pa] of the present state by place, (n,) of 3 × 3: M1, the reference being the present.

    In 2-D and 1-D the 3-D law acts on F with the missing stretches equal to one, so σ33 of plane strain is there too.
    """
    space, F = simulation.space, simulation.stepper.U.F
    sigma = stresses(space, len(F), simulation.device)
    for body, (span, part) in zip(simulation.bodies, simulation.stepper.remembering, strict=True):
        body_stress(space, body.material, span, F, part.history, sigma)
    return sigma


def cauchy_stress(simulation: RecordedSolids) -> np.ndarray:
    """``stress_array`` on the host, by number, (n, 3, 3)."""
    return simulation.order.by_number(stress_array(simulation).numpy())
