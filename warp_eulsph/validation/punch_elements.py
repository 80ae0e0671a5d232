"""The punch by finite elements, to see how far its reference has converged: reactions over ever finer meshes.

    python -m warp_eulsph.validation.punch_elements            python -m warp_eulsph.validation.punch_elements -n 20 40

Explicit, total Lagrangian, bilinear squares with 2 × 2 Gauss points, once as they are and once with the mean volume of
each element (Q1-P0, no volumetric locking); lumped masses, leapfrog. Shares nothing with the package but the law's
constants and the motion of the punch. Elements at the punch's edge invert at 10 ms and earlier the finer they are: that
ends a run.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from .cases.punch import REACTIONS
from .solids import RUBBER

CONSTANTS = RUBBER.constants()
MU, KAPPA = CONSTANTS["mu"], CONSTANTS["kappa"]
SPEED = np.sqrt((KAPPA + 4.0 * MU / 3.0) / RUBBER.density)  # m/s, of pressure waves
COURANT = 0.35
WINDOW = 0.25e-3  # s, half of the time over which reactions are averaged
TIMES = (0.003, 0.005, 0.007, 0.009, 0.0097, 0.010)  # s
CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))


def shape_slopes() -> np.ndarray:
    """∂N_c/∂ξ at the 2 × 2 Gauss points of the unit square: (points, corners, 2)."""
    places = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
    slopes = np.empty((4, 4, 2))
    for q, (s, t) in enumerate((s, t) for s in places for t in places):
        for c, (i, j) in enumerate(CORNERS):
            N, M = (s if i else 1.0 - s), (t if j else 1.0 - t)
            slopes[q, c] = (1.0 if i else -1.0) * M, (1.0 if j else -1.0) * N
    return slopes


SLOPES = shape_slopes()


def forces(x: np.ndarray, mean_volume: bool) -> tuple[np.ndarray, np.ndarray]:
    """Internal forces on the nodes [N/m], (n+1, n+1, 2), and the volume ratios of the elements, (n, n)."""
    n = len(x) - 1
    B = SLOPES * n  # ∂N/∂X
    corners = np.stack([x[i : n + i, j : n + j] for i, j in CORNERS], axis=2)  # (n, n, 4, 2)
    F = np.einsum("efca,qcb->efqab", corners, B)
    J = np.linalg.det(F)
    cofactor = np.stack([F[..., 1, 1], -F[..., 1, 0], -F[..., 0, 1], F[..., 0, 0]], axis=-1).reshape(F.shape)
    with np.errstate(invalid="ignore"):  # an inverted element ends the run
        isochoric = J ** (-2.0 / 3.0)
    trace = np.square(F).sum(axis=(3, 4)) + 1.0
    volume = J.mean(axis=2)
    pressure = KAPPA * ((volume[..., None] if mean_volume else J) - 1.0) - MU / 3.0 * isochoric / J * trace
    P = MU * isochoric[..., None, None] * F + pressure[..., None, None] * cofactor
    shares = np.einsum("efqab,qcb->efca", P, B) / (4.0 * n**2)
    total = np.zeros_like(x)
    for c, (i, j) in enumerate(CORNERS):
        total[i : n + i, j : n + j] += shares[:, :, c]
    return total, volume


def longest_step(x: np.ndarray, volume: np.ndarray) -> float:
    """Stable step [s]: the least height of an element over the speed of waves in it."""
    diagonals = x[1:, 1:] - x[:-1, :-1], x[:-1, 1:] - x[1:, :-1]
    longest = np.maximum(*(np.linalg.norm(d, axis=-1) for d in diagonals))
    area = volume / (len(x) - 1) ** 2
    return float(1.4 * COURANT * np.min(area / longest * np.sqrt(np.minimum(volume, 1.0)))) / SPEED


def reactions(n: int, mean_volume: bool, until: float) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and reactions [MN/m] of n × n elements, up to ``until`` or the first inverted element."""
    ends = np.ones(n + 1)
    ends[[0, -1]] = 0.5
    mass = (RUBBER.density / n**2 * np.outer(ends, ends))[..., None]
    x = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, n + 1)] * 2, indexing="ij"), axis=-1)
    v, driven = np.zeros_like(x), slice(0, n // 2 + 1)
    t, last, times, values = 0.0, 0.0, [], []
    while t < until:
        force, volume = forces(x, mean_volume)
        dt = longest_step(x, volume)
        if not volume.min() > 0.05 or not np.isfinite(dt):
            break
        kick = 0.5 * (last + dt)  # leapfrog between steps of unequal length
        v -= force / mass * kick
        v[[0, -1], :, 0] = 0.0
        v[:, 0, 1] = 0.0
        s = min((t + 0.5 * dt) / 2e-3, 1.0)
        speed = -10.0 * s * s * (3.0 - 2.0 * s)
        pushed = (mass[driven, -1, 0] * (speed - v[driven, -1, 1])).sum() / kick
        v[driven, -1, 1] = speed
        x = x + dt * v
        t, last = t + dt, dt
        times.append(t)
        values.append(-1e-6 * pushed)
    return np.array(times), np.array(values)


def main(argv: Sequence[str] | None = None) -> dict[tuple[int, bool], list[float]]:
    """Print the reactions; by (elements across, mean volume), nan after the end of a run."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, nargs="+", default=[20, 40, 80], help="elements across")
    parser.add_argument("--until", type=float, default=0.01 + WINDOW, help="end time [s]")
    args = parser.parse_args(argv)
    print(f"reference: {REACTIONS}\n{'elements':>24} " + " ".join(f"{1e3 * t:6.1f} ms" for t in TIMES))
    found = {}
    for mean_volume in (False, True):
        for n in args.n:
            times, values = reactions(n, mean_volume, args.until)
            row = []
            for t in TIMES:
                span = np.linspace(t - WINDOW, t + WINDOW, 201)
                row.append(float(np.interp(span, times, values).mean()) if times[-1] >= span[-1] - 1e-5 else np.nan)
            found[n, mean_volume] = row
            name = f"{n} × {n}, {'Q1-P0' if mean_volume else 'Q1'}"
            print(f"{name:>24} " + " ".join(f"{value:9.4f}" for value in row), flush=True)
    return found


if __name__ == "__main__":
    main()
