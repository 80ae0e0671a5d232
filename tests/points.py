"""One particle of a law with a history on a path of F, for tests of laws without bodies."""

import functools
import math

import numpy as np
import warp as wp

from warp_eulsph.materials import J2, Hardening, JohnsonCook, LinearHardening, Tabulated, Voce
from warp_eulsph.materials.base import history_row
from warp_eulsph.space import Space

COPPER = {"density": 8930.0, "young": 117e9, "poisson": 0.35}
MU, KAPPA = COPPER["young"] / 2.7, COPPER["young"] / 0.9
HARDENINGS = {
    "perfect": LinearHardening(yield_stress=0.4e9),
    "linear": LinearHardening(yield_stress=0.4e9, modulus=0.1e9),
    "voce": Voce(yield_stress=0.1e9, saturation=0.3e9, rate=8.0),
    "table": Tabulated(strains=(0.0, 0.05, 0.2, 1.0), stresses=(0.1e9, 0.25e9, 0.35e9, 0.4e9)),
    "johnson_cook": JohnsonCook(A=90e6, B=292e6, n=0.31, C=0.025, m=1.09),
}
DOUBLE = Space(3)


@functools.cache
def make_point(space, law):
    """Kernel: one step of one particle: update, then stress, energy, and the half step's stress before it."""
    real, mat, row, Constants = space.real, space.mat, history_row(space, law), law.Constants
    stress, energy, update, rebase = law.stress, law.energy, law.update, law.rebase

    @wp.kernel(module="unique", enable_backward=False)
    def point(
        F: wp.array(dtype=mat),
        dt: real,
        anew: int,
        c: Constants,
        h: wp.array(dtype=row),
        ahead: wp.array(dtype=mat),
        P: wp.array(dtype=mat),
        out: wp.array(dtype=real),
    ):
        ahead[0] = stress(F[0], mat(), h[0], dt, c)
        F_new, h_new, lost = update(F[0], mat(), h[0], dt, c)
        if anew == 1:
            F_new, h_new = rebase(F_new, h_new, c)
        F[0] = F_new
        h[0] = h_new
        P[0] = stress(F_new, mat(), h_new, real(0.0), c)
        out[0] = energy(F_new, h_new, c)
        out[1] = lost

    return point


class Point:
    """One particle of a material on a path, of copper where a hardening is given.

    ``sigma`` is (3, 3) or (dim, dim), ``ahead`` that of the half-step form.
    """

    def __init__(self, material, space=DOUBLE):
        self.space = space
        self.material = J2(**COPPER, hardening=material) if isinstance(material, Hardening) else material
        self.law = self.material.law(space)
        row = history_row(space, self.law)
        self.h = wp.array([row(*self.law.start)], dtype=row)
        self.constants, self.lost, self.energy = self.material.filled_constants(self.law), [], [0.0]
        self.total, self.F = np.eye(space.dim), np.eye(space.dim)

    def step(self, F, dt=1.0, anew=False):
        """To the total F; from a rebased one by the motion since."""
        dim, mat = self.space.dim, self.space.mat
        start = F @ np.linalg.inv(self.total) @ self.F if anew else F
        new = wp.array(start[None].astype(self.space.numpy), dtype=mat)
        ahead, P = (wp.zeros(1, dtype=mat) for _ in range(2))
        out = wp.zeros(2, dtype=self.space.real)
        arguments = [new, dt, int(anew), self.constants, self.h, ahead, P, out]
        wp.launch(make_point(self.space, self.law), 1, arguments)
        self.total, self.F = F, new.numpy()[0].astype(float).reshape(dim, dim)
        J = np.linalg.det(self.F)
        self.sigma = P.numpy()[0].reshape(dim, dim) @ self.F.T / J
        self.ahead = ahead.numpy()[0].reshape(dim, dim) @ start.T / np.linalg.det(start)
        self.lost.append(float(out.numpy()[1]))
        self.energy.append(float(out.numpy()[0]))
        return self

    def __getattr__(self, name):
        return self.law.by_name(self.h.numpy())[name][0]


def mises(tau):
    deviator = tau - np.trace(tau) / 3.0 * np.eye(3)
    return math.sqrt(1.5 * float(np.sum(deviator**2)))


def stretched(strain):
    """F of an isochoric uniaxial stretch with this logarithmic strain."""
    return np.diag(np.exp([strain, -0.5 * strain, -0.5 * strain]))


def sheared(angle):
    return np.eye(3) + angle * np.outer([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
