"""Propagation of a cosine profile by the Lax-CSPH and Lax-Wendroff-CSPH schemes (paper §6.1, Fig. 2).

    python examples/cosine_profile.py

u_t + u_x = 0 on ]0, 1[ with u = ½ (1 + cos(π (x − 0.2)/0.12)) within 0.12 of 0.2 and zero elsewhere, to t = 0.6, on 50
particles at (i + ½)/50. The lattice continues beyond both ends, as a periodic box of length 3 whose far parts nothing
reaches; the figures are those of the particles in ]0, 1[. On a lattice Shepard and linear values are the same.

Checked, to every printed digit: largest value, its place (vertex of the parabola through the highest particle and its
neighbours), least value and L2 error √(Σ (u − exact)² dx), against the two schemes written as finite differences.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from warp_eulsph.scheme.scalar import ConservationLaw, LinearAdvection, ScalarScheme
from warp_eulsph.validation.cases.cosine_profile import EXPECTED, LAX, LAX_WENDROFF, measure

PARTICLES, BOX, END = 50, 3.0, 0.6


def profile(x: np.ndarray, centre: float) -> np.ndarray:
    """The cosine hat of half width 0.12."""
    away = np.abs(x - centre)
    return np.where(away <= 0.12, 0.5 * (1.0 + np.cos(np.pi * away / 0.12)), 0.0)


def solve(scheme: ScalarScheme, dilation: float, cfl: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions in ]0, 1[ and the solution there at t = 0.6."""
    dx = 1.0 / PARTICLES
    x = (np.arange(round(BOX / dx)) + 0.5) * dx
    start, flux = profile(x, 0.2), LinearAdvection((1.0,))
    law = ConservationLaw(x[:, None], dx, start, flux=flux, scheme=scheme, dilation=dilation, periodic=(BOX,))
    law.run(END, cfl * dx)
    return x[:PARTICLES], law.values[:PARTICLES]


def figures(x: np.ndarray, u: np.ndarray) -> tuple[str, str, str, str]:
    """Largest value, its place, least value, L2 error as printed."""
    largest, place, least, error = measure(x, u)
    least = least if abs(least) > 1e-12 else 0.0  # no minus sign before rounding errors
    return f"{largest:.5f}", f"{place:.4f}", f"{least:.4f}", f"{error:.5f}"


def draw(path: Path, solutions: dict) -> None:
    """The solutions on three particles beside the exact one."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 2, figsize=(10.0, 4.0), sharey=True, constrained_layout=True)
    fine = np.linspace(0.0, 1.0, 1001)
    for axis, scheme, title in zip(axes, (LAX, LAX_WENDROFF), ("Lax-CSPH", "Lax-Wendroff-CSPH"), strict=True):
        axis.plot(fine, profile(fine, 0.2 + END), "k:", label="exact")
        for (who, dilation, cfl), (x, u) in solutions.items():
            if who == scheme and dilation == 1.0:
                axis.plot(x, u, ".-", label=f"CFL {cfl:g}")
        axis.set(title=title, xlabel="x", xlim=(0.0, 1.0))
        axis.legend()
    axes[0].set_ylabel("u at t = 0.6")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=Path("runs/cosine_profile"), help="directory of the picture")
    output = parser.parse_args(arguments).output
    solutions = {case: solve(*case) for case in EXPECTED}
    print(f"{'scheme':>18} h/dx  CFL    u_max  x_peak    u_min  L2 error")
    good = True
    for (scheme, dilation, cfl), printed in EXPECTED.items():
        found = figures(*solutions[scheme, dilation, cfl])
        good &= found == printed
        note = "" if found == printed else f"  expected {' '.join(printed)}"
        values = f"{found[0]}  {found[1]}  {found[2]:>7}  {found[3]}"
        print(f"{type(scheme).__name__:>18} {dilation:4.1f}  {cfl:3.1f}  {values}{note}")
    draw(output / "cosine_profile.png", solutions)
    print(f"picture: {output / 'cosine_profile.png'}")
    print("all figures agree" if good else "figures differ")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
