"""Fluids that tests share, and all that a law with a history says of them."""

import numpy as np
import warp as wp

from warp_eulsph.materials import IdealGas, MieGruneisen, Newtonian, StiffenedGas, TaitLiquid
from warp_eulsph.materials.base import history_row
from warp_eulsph.space import Space

GAS = IdealGas(density=1.2, pressure=1e5)
WATER = StiffenedGas(density=1e3, gamma=4.4, stiffness=6e8, pressure=1e5)
COPPER = MieGruneisen(density=8930.0, sound_speed=3940.0, slope=1.489, gruneisen=1.99)
OIL = TaitLiquid(density=900.0, sound_speed=20.0)
THICK = Newtonian(viscosity=3.0)


def long_law(material, dim=1, real=wp.float64):
    """Kernel of all that a law with a history says, by its constants."""
    space = Space(dim, real)
    law = material.law(space)
    mat, row, pair, Constants = space.mat, history_row(space, law), space.row(2), law.Constants
    stress_of, energy_of, moduli_of, heat_of, updated = law.stress, law.energy, law.wave_moduli, law.heat, law.update
    heats = law.heat is not None

    @wp.kernel(module="unique", enable_backward=False)
    def look(
        F: wp.array(dtype=mat),
        rate: mat,
        start: row,
        q: real,
        dt: real,
        c: Constants,
        h: wp.array(dtype=row),
        P: wp.array(dtype=mat),
        psi: wp.array(dtype=real),
        moduli: wp.array(dtype=pair),
        lost: wp.array(dtype=real),
    ):
        i = wp.tid()
        _, row_i, lost_i = updated(F[i], rate, start, dt, c)
        if wp.static(heats):
            row_i = heat_of(F[i], row_i, q, c)
        h[i] = row_i
        lost[i] = lost_i
        P[i] = stress_of(F[i], rate, row_i, real(0.0), c)
        psi[i] = energy_of(F[i], row_i, c)
        moduli[i] = moduli_of(F[i], row_i, c)

    def call(F, rate=None, q=0.0, dt=0.0):
        F = np.asarray(F, dtype=float)
        n = len(F)
        kinds = (row, mat, real, pair, real)
        out = [wp.zeros(n, dtype=kind) for kind in kinds]
        l = mat(*np.zeros(dim * dim)) if rate is None else mat(*np.ravel(rate))  # noqa: E741 (the letter of the field)
        given = [wp.array(F, dtype=mat), l, row(*law.start), q, dt, material.filled_constants(law)]
        wp.launch(look, n, [*given, *out])
        return [array.numpy().astype(float) for array in out]

    return call
