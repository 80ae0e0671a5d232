"""Taylor's bar and the necking bar by finite elements of revolution: what another method says of the same problems.

    python -m warp_eulsph.validation.rod_elements            python -m warp_eulsph.validation.rod_elements necking -n 4

Explicit, total Lagrangian, bilinear quadrilaterals of revolution with 2 × 2 Gauss points and the mean volume of each
element (Q1-P0, no volumetric locking); lumped masses, leapfrog. Plasticity by return along logarithmic strains with
eigenvectors and Newton's method. Shares nothing with the package but the constants of the laws and the problems.
"""

import argparse
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..materials import J2, LinearHardening, Voce
from .cases import necking, taylor_bar

COURANT, GRADING = 0.4, 1.5  # the latter of meshes towards a neck, where they are drawn out to many times their length
LAYERS = np.array([0.0, 1 / 16, 1 / 12, 1 / 8]) * necking.RADIUS  # m, half a spacing at 8, 6, 4 particles per radius
CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))
GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
PLACES = [(s, t) for s in GAUSS for t in GAUSS]


class Mesh:
    """A rod about the z axis.

    Args:
        across: elements per radius.
        radii: of the rod at the heights z [m], of one more each than elements along it.

    Attributes:
        X: initial nodes (r, z) [m], (across + 1, along + 1, 2); corners: their numbers, (elements, 4).
        N, B: shape functions at the Gauss points, (4, 4), and ∂N/∂X [1/m], (elements, 4, 4, 2).
        R, volume: radius [m] and volume [m³] of the Gauss points, (elements, 4); mass: of the nodes [kg].
    """

    def __init__(self, across: int, radii: np.ndarray, z: np.ndarray, density: float):
        r = np.linspace(0.0, 1.0, across + 1)[:, None] * radii
        self.X = np.stack([r, np.broadcast_to(z, r.shape)], axis=-1)
        nodes, along = np.arange(r.size).reshape(r.shape), len(z) - 1
        self.corners = np.stack([nodes[i : across + i, j : along + j].ravel() for i, j in CORNERS], axis=-1)
        X = self.X.reshape(-1, 2)[self.corners]
        N, slopes = np.empty((4, 4)), np.empty((4, 4, 2))
        for q, (s, t) in enumerate(PLACES):
            for c, (i, j) in enumerate(CORNERS):
                S, T = (s if i else 1.0 - s), (t if j else 1.0 - t)
                N[q, c], slopes[q, c] = S * T, ((1.0 if i else -1.0) * T, (1.0 if j else -1.0) * S)
        map_ = np.einsum("eca,qcb->eqab", X, slopes)
        self.N, self.B = N, np.einsum("qcb,eqba->eqca", slopes, np.linalg.inv(map_))
        self.R = X[..., 0] @ N.T
        self.volume = 0.25 * 2.0 * np.pi * self.R * np.linalg.det(map_)
        self.mass = density * self.gather(self.volume @ N).reshape(r.shape)

    def gather(self, shares: np.ndarray) -> np.ndarray:
        """Sums at the nodes of what the corners of elements have, (elements, 4)."""
        return np.bincount(self.corners.ravel(), shares.ravel(), self.X[..., 0].size)


class Matter:
    """J2 with isotropic hardening at the Gauss points of a mesh: C_p⁻¹ and α."""

    def __init__(self, law: J2, points: tuple[int, int]):
        if not isinstance(law.hardening, LinearHardening | Voce):
            raise TypeError(f"hardening must be LinearHardening or Voce here, got {law.hardening}")
        c = law.constants()
        self.mu, self.kappa, self.hardening = c["mu"], c["kappa"], law.hardening
        self.metric, self.alpha = np.tile(np.eye(3), (*points, 1, 1)), np.zeros(points)

    def yield_stress(self, alpha: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """y [Pa] and its slope."""
        h = self.hardening
        y, slope = h.yield_stress + h.modulus * alpha, np.full_like(alpha, h.modulus)
        if isinstance(h, Voce):
            left = h.saturation * np.exp(-h.rate * alpha)
            y, slope = y + h.saturation - left, slope + h.rate * left
        return y, slope

    def deviator(self, F: np.ndarray, J: np.ndarray, inverse: np.ndarray) -> np.ndarray:
        """Deviatoric Kirchhoff stress [Pa]; the state moves on."""
        b = F @ self.metric @ np.swapaxes(F, -1, -2)
        mean, half, shear = 0.5 * (b[..., 0, 0] + b[..., 1, 1]), 0.5 * (b[..., 0, 0] - b[..., 1, 1]), b[..., 0, 1]
        spread, angle = np.hypot(half, shear), 0.5 * np.arctan2(shear, half)
        e = 0.5 * np.log(np.stack([mean + spread, mean - spread, b[..., 2, 2]], axis=-1))
        e -= e.mean(axis=-1, keepdims=True)
        q = np.sqrt(6.0) * self.mu * np.sqrt(np.square(e).sum(axis=-1))
        grown = np.zeros_like(q)
        for _ in range(20):  # y is concave: from below Newton's steps do not pass the root
            y, slope = self.yield_stress(self.alpha + grown)
            left = np.maximum(q - 3.0 * self.mu * grown - y, 0.0)
            if (left < 1e-12 * self.mu).all():
                break
            grown += left / (3.0 * self.mu + slope)
        e *= (1.0 - 3.0 * self.mu * grown / np.maximum(q, 1e-30))[..., None]
        cos, sin = np.cos(angle), np.sin(angle)

        def tensor(values: np.ndarray) -> np.ndarray:
            out = np.zeros_like(F)
            out[..., 0, 0] = cos**2 * values[..., 0] + sin**2 * values[..., 1]
            out[..., 1, 1] = sin**2 * values[..., 0] + cos**2 * values[..., 1]
            out[..., 0, 1] = out[..., 1, 0] = cos * sin * (values[..., 0] - values[..., 1])
            out[..., 2, 2] = values[..., 2]
            return out

        flows = grown > 0.0
        G = inverse[flows] * (J[flows] ** (1.0 / 3.0))[:, None, None]
        self.metric[flows] = G @ tensor(np.exp(2.0 * e))[flows] @ np.swapaxes(G, -1, -2)
        self.alpha += grown
        return 2.0 * self.mu * tensor(e)


def forces(mesh: Mesh, matter: Matter, x: np.ndarray) -> np.ndarray:
    """Internal forces on the nodes [N], as ``x``."""
    corners = x.reshape(-1, 2)[mesh.corners]
    F = np.zeros((*mesh.R.shape, 3, 3))
    F[..., :2, :2] = np.einsum("eca,eqcb->eqab", corners, mesh.B)
    F[..., 2, 2] = (corners[..., 0] @ mesh.N.T) / mesh.R
    J, inverse = np.linalg.det(F), np.linalg.inv(F)
    V = mesh.volume
    theta = (J * V).sum(axis=1) / V.sum(axis=1)
    tau = matter.deviator(F, J, inverse)
    tau += (J * (matter.kappa * np.log(theta) / theta)[:, None])[..., None, None] * np.eye(3)
    P = tau @ np.swapaxes(inverse, -1, -2) * V[..., None, None]
    shares = np.einsum("eqab,eqcb->eca", P[..., :2, :2], mesh.B)
    shares[..., 0] += (P[..., 2, 2] / mesh.R) @ mesh.N
    return np.stack([mesh.gather(shares[..., i]) for i in range(2)], axis=-1).reshape(x.shape)


def longest_step(x: np.ndarray, speed: float) -> float:
    """Stable step [s]: the least height of an element over the speed of waves."""
    one, other = x[1:, 1:] - x[:-1, :-1], x[:-1, 1:] - x[1:, :-1]
    area = 0.5 * np.abs(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])
    longest = np.sqrt(np.maximum(np.square(one).sum(axis=-1), np.square(other).sum(axis=-1)))
    return 1.4 * COURANT * float(np.min(area / longest)) / speed


def run(
    mesh: Mesh,
    law: J2,
    v: np.ndarray,
    hold: Callable[[np.ndarray, float], None],
    times: Sequence[float],
    look: Callable[[np.ndarray, Matter, np.ndarray], Any],
) -> list[Any]:
    """Step from velocities ``v`` under ``hold(v, t)`` [m/s]; what ``look(x, matter, force)`` finds at the times."""
    matter, x, v = Matter(law, mesh.R.shape), mesh.X.copy(), v.copy()
    speed = float(np.sqrt((matter.kappa + 4.0 / 3.0 * matter.mu) / law.density))
    t, last, found = 0.0, 0.0, []
    for end in times:
        while t < end:
            force = forces(mesh, matter, x)
            dt = min(longest_step(x, speed), end - t)
            v -= force / mesh.mass[..., None] * (0.5 * (last + dt))  # leapfrog between steps of unequal length
            v[0, :, 0] = 0.0
            hold(v, t + 0.5 * dt)
            x += dt * v
            t, last = t + dt, dt
        found.append(look(x, matter, force))
    return found


def taylor(across: int, times: Sequence[float] = (20e-6, 40e-6, 80e-6)) -> list[Any]:
    """Taylor's bar; looks find (length, foot radius, radii at the heights of the case) [m] and the largest α."""
    z = np.linspace(0.0, taylor_bar.LENGTH, round(taylor_bar.LENGTH * across / taylor_bar.RADIUS) + 1)
    mesh = Mesh(across, np.full_like(z, taylor_bar.RADIUS), z, taylor_bar.COPPER.density)
    v = np.zeros_like(mesh.X)
    v[..., 1] = -taylor_bar.SPEED

    def hold(v: np.ndarray, t: float) -> None:
        v[:, 0, 1] = 0.0

    def look(x: np.ndarray, matter: Matter, force: np.ndarray) -> tuple[float, ...]:
        radii = np.interp(taylor_bar.HEIGHTS, x[-1, :, 1], x[-1, :, 0])
        return float(x[:, -1, 1].mean()), float(x[-1, 0, 0]), *map(float, radii), float(matter.alpha.max())

    return run(mesh, taylor_bar.COPPER, v, hold, times, look)


def pulled(across: int, elongations: Sequence[float] = (0.1, 0.2, 0.3, 0.4)) -> list[Any]:
    """Half of the necking bar, elements shorter towards the neck; looks find radii over ``RADIUS`` and the load [N].

    Radii of what was at ``LAYERS`` from the middle: where the lowest layers of particles are, and drawn away with.
    """
    half = 0.5 * necking.LENGTH
    z = half * np.linspace(0.0, 1.0, round(half * across / necking.RADIUS) + 1) ** GRADING
    mesh = Mesh(across, necking.RADIUS * necking.narrowing(z), z, necking.STEEL.density)

    def hold(v: np.ndarray, t: float) -> None:
        v[:, 0, 1] = v[:, -1, 0] = 0.0
        v[:, -1, 1] = 0.5 * necking.SPEED * min(t / necking.RISE, 1.0)

    def look(x: np.ndarray, matter: Matter, force: np.ndarray) -> tuple[list[float], float]:
        radii = np.interp(LAYERS, z, x[-1, :, 0]) / necking.RADIUS
        return radii.tolist(), float(force[:, -1, 1].sum())

    times = [e * necking.LENGTH / necking.SPEED + 0.5 * necking.RISE for e in elongations]
    return run(mesh, necking.STEEL, np.zeros_like(mesh.X), hold, times, look)


def main(argv: Sequence[str] | None = None) -> None:
    """Print what the looks find, over meshes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("problem", nargs="?", default="taylor", choices=("taylor", "necking"))
    parser.add_argument("-n", type=int, nargs="+", default=[4, 6], help="elements per radius")
    args = parser.parse_args(argv)
    for n in args.n:
        if args.problem == "taylor":
            print(f"{n} per radius at 20, 40, 80 µs: length, foot, radii at 2, 5, 10 mm [mm]; largest plastic strain")
            for *lengths, strain in taylor(n):
                print("  " + " ".join(f"{1e3 * length:7.3f}" for length in lengths) + f" {strain:7.3f}", flush=True)
        else:
            print(f"{n} per radius at 10 to 40 %: radius at the middle, of layers of 8, 6, 4 per radius; load [kN]")
            for radii, force in pulled(n):
                print("  " + " ".join(f"{radius:.4f}" for radius in radii) + f" {1e-3 * force:8.3f}", flush=True)


if __name__ == "__main__":
    main()
