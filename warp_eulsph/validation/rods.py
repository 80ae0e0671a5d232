"""Measured Taylor rods: one law of copper fitted to one of them, the others predicted.

    python -m warp_eulsph.validation.rods [--fit] [-k 4] [--output DIR]

The final shapes are those of ``reference/measured/taylor_copper.csv`` (Zelepugin, Cherepanov, Pakhnutova, Materials
16, 2023, 5452, doi 10.3390/ma16155452, CC BY 4.0). The law is Johnson and Cook's with their constants of OFHC copper
(7th Int. Symp. Ballistics, 1983) but for A and B, strength and hardening, which depend on what was done to the copper
before: they are fitted to length and outline of rod 5 (``--fit``, with SciPy). Rod 1 is of OFHC copper at the same
temperature, rod 2 of a third at 718 K: both are predicted by the fitted A and B, and by Johnson and Cook's own. Prints
lengths and radii beside those measured, draws outlines (``rods.png``).
"""

import argparse
import dataclasses
from pathlib import Path
from typing import NamedTuple

import numpy as np
import warp as wp

from ..boundaries import mirror
from ..geometry import cylinder
from ..materials import J2, JohnsonCook
from ..simulation import Body, Simulation
from .cases import taylor_bar

FRACTIONS = (0.2, 0.25, 0.333, 0.5, 0.667)  # of the final length, above the foot, where radii were read
END = 120e-6  # s; the rods are at rest from some 100 µs on
#: A and B are fitted to rod 5, all else is Johnson and Cook's.
LAW = JohnsonCook(A=281e6, B=60e6, n=0.31, C=0.025, m=1.09, temperature=298.0, reference_temperature=298.0)
#: With their A and B.
OFHC = dataclasses.replace(LAW, A=90e6, B=292e6)


class Rod(NamedTuple):
    """A rod as measured [m, m/s, K]: before, and after with the radii at ``FRACTIONS`` of its length."""

    name: str
    copper: str
    length: float
    radius: float
    speed: float
    temperature: float
    final_length: float
    foot: float
    radii: np.ndarray


def measured() -> dict[str, Rod]:
    """The rods by their number."""
    path = Path(__file__).parent / "reference" / "measured" / "taylor_copper.csv"
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    names, found = lines[0].split(","), {}
    for line in lines[1:]:
        row = dict(zip(names, line.split(","), strict=True))
        L0, D0, v, T, L, foot = (float(row[name]) for name in ("L0", "D0", "v", "T", "Lf", "Rf"))
        radii = 1e-3 * np.array([float(row[f"r_{fraction:g}"]) for fraction in FRACTIONS])
        found[row["rod"]] = Rod(row["rod"], row["copper"], 1e-3 * L0, 5e-4 * D0, v, T, 1e-3 * L, 1e-3 * foot, radii)
    return found


def build(rod: Rod, law: JohnsonCook, k: int) -> Simulation:
    """The rod above the frictionless wall z = 0, ``k`` particles per radius."""
    copper = J2(
        density=8930.0, young=124e9, poisson=0.34, hardening=dataclasses.replace(law, temperature=rod.temperature)
    )
    x, volume = cylinder((0.0, 0.0, 0.0), (0.0, 0.0, rod.length), rod.radius, rod.radius / k)
    body = Body(x=x, volume=volume, material=copper, velocity=[0.0, 0.0, -rod.speed], name="rod")
    body, wall = mirror(body, point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, -1.0), depth=2.0 * rod.radius)
    return Simulation(body, boundaries=[wall])


def outline(simulation: Simulation, rod: Rod) -> tuple[np.ndarray, np.ndarray, float]:
    """Heights and radii [m] of the side, a point for each layer of the start, upwards; and the length."""
    own = simulation.order.by_number(simulation.particles.share.numpy()) > 0.0
    X, x, spacing = simulation.X[own], simulation.x[own], float(simulation.bodies[0].spacing[0])
    r, z = taylor_bar.outline(X, x, rod.radius).T
    last = X[:, 2] > X[:, 2].max() - 0.5 * spacing
    return z, r, float(x[last, 2].mean() + 0.5 * spacing)


def compare(rod: Rod, law: JohnsonCook, k: int) -> tuple[dict[str, float], tuple[np.ndarray, np.ndarray]]:
    """Relative errors of length, radii (their root mean square) and foot, at the wall; and the outline."""
    simulation = build(rod, law, k)
    simulation.run(END)
    z, r, length = outline(simulation, rod)
    radii = np.interp(np.array(FRACTIONS) * length, z, r)
    errors = radii / rod.radii - 1.0
    found = {"length": length / rod.final_length - 1.0, "foot": (1.5 * r[0] - 0.5 * r[1]) / rod.foot - 1.0}
    found |= {f"radius_at_{fraction:g}": float(error) for fraction, error in zip(FRACTIONS, errors, strict=True)}
    energy, start = simulation.energy(), simulation.stepper.ledger.start
    moving = energy["kinetic"] / start
    return found | {"radii": float(np.sqrt((errors**2).mean())), "moving": moving}, (z, r)


def fit(rod: Rod, law: JohnsonCook, k: int) -> JohnsonCook:
    """``law`` with the A and B that leave the least squares of errors of length and of the five radii."""
    from scipy.optimize import least_squares

    def errors(logarithms: np.ndarray) -> list[float]:
        A, B = np.exp(logarithms) * 1e6
        found, _ = compare(rod, dataclasses.replace(law, A=A, B=B), k)
        residuals = [found["length"] * len(FRACTIONS) ** 0.5] + [found[f"radius_at_{f:g}"] for f in FRACTIONS]
        print(f"A {1e-6 * A:.1f} MPa, B {1e-6 * B:.1f} MPa: {np.linalg.norm(residuals):.4f}", flush=True)
        return residuals

    start = np.log(np.array([250.0, 200.0]))
    A, B = np.exp(least_squares(errors, start, diff_step=0.02, xtol=2e-3, ftol=1e-3, max_nfev=8).x) * 1e6
    return dataclasses.replace(law, A=float(A), B=float(B))


def draw(found: dict[str, list[tuple[np.ndarray, np.ndarray]]], rods: dict[str, Rod], path: Path) -> None:
    """Outlines by the fitted law, and dashed by the published one, beside the points measured."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, len(found), figsize=(3.2 * len(found), 5), constrained_layout=True)
    for axes, (name, outlines) in zip(panels, found.items(), strict=True):
        rod = rods[name]
        for side in (-1.0, 1.0):
            for style, (z, r) in zip(("C0-", "C1--"), outlines, strict=False):
                axes.plot(1e3 * side * r, 1e3 * z, style)
            axes.plot(1e3 * side * rod.radii, 1e3 * rod.final_length * np.array(FRACTIONS), "ko", ms=4)
        axes.plot([-1e3 * rod.foot, 1e3 * rod.foot], [0.0, 0.0], "k|", ms=12)
        axes.axhline(1e3 * rod.final_length, color="k", lw=0.8, ls=":")
        kind = "fitted" if name == "5" else "predicted"
        axes.set(
            title=f"rod {name}, {kind}\n{rod.speed:.0f} m/s, {rod.temperature:.0f} K", aspect="equal", xlabel="r [mm]"
        )
    panels[0].set_ylabel("z [mm]")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(argv: list[str] | None = None) -> None:
    """Fit if asked to, print the errors, draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fit", action="store_true", help="find A and B anew, by rod 5")
    parser.add_argument("-k", type=int, default=4, help="particles per radius")
    parser.add_argument("--output", type=Path, default=Path("runs/rods"))
    args = parser.parse_args(argv)
    wp.config.log_level = wp.LOG_WARNING
    rods, law = measured(), LAW
    outlines: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {name: [] for name in rods}
    if args.fit:
        law = fit(rods["5"], law, args.k)
    for each in (law, OFHC):
        print(f"A = {1e-6 * each.A:.0f} MPa, B = {1e-6 * each.B:.0f} MPa")
        for name, rod in rods.items():
            if each is law or name != "5":
                found, side = compare(rod, each, args.k)
                outlines[name].append(side)
                shown = {key: round(float(value), 4) for key, value in found.items()}
                print(f"rod {name} ({rod.copper})", shown, flush=True)
    draw(outlines, rods, args.output / "rods.png")
    print(f"picture {args.output / 'rods.png'}")


if __name__ == "__main__":
    main()
