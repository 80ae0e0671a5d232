"""Amplification and phase error of the Lax-CSPH and Lax-Wendroff-CSPH schemes (paper, Fig. 1).

    python examples/amplification.py

The weights of S and of the gradient are read from the library: it smooths and differentiates one spike on a periodic
lattice, and the Fourier transform of the answers gives the symbols s(θ) of S and i d(θ)/dx of ∂/∂x. With the Courant
number c the amplification factors per step are

    Lax: G = s − i c d,        Lax-Wendroff: G = 1 − i c d s − ½ c² d².

Checked: stability limits CFL_LW = 2 √m₂ = 2 min √(1 − s²)/|d|, m₂ the second moment of S along an axis, on the line,
the square and the cubic lattice; and G on three particles against its closed form.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from warp_eulsph import CubicSpline
from warp_eulsph.validation.cases.amplification import LIMITS, factors, limit, spike_responses, symbols, three_particles


def limits_hold() -> bool:
    """Print the table of stability limits and compare it with the exact one."""
    good = True
    print(f"{'weight':>12} h/dx  CFL of Lax-Wendroff on the line, the square, the cubic lattice")
    for (weight, dilation), printed in LIMITS.items():
        shown = []
        for dim, digits in enumerate(printed, start=1):
            found = limit(weight, dilation, dim)
            text = f"{found.cfl:.{len(digits.split('.')[1])}f}"
            agrees = text == digits and abs(found.least - found.cfl) < 1e-5
            agrees &= found.growth_at < 1e-12 and found.growth_beyond > 1e-8
            good &= agrees
            shown.append(text if agrees else f"{text} (exact {digits}; {found})")
        print(f"{weight!r:>12} {dilation:4.1f}  {'  '.join(shown)}")
    return good


def phases_hold() -> bool:
    """Compare G on three particles with its closed form, and print where a step is an exact shift."""
    error, shift_lax, shift_lw = three_particles().values()
    print(f"three particles: s = cos θ, d = sin θ within {error:.1e}")
    print(f"exact shifts: Lax at CFL 1 within {shift_lax:.1e}, Lax-Wendroff at CFL 2 within {shift_lw:.1e}")
    return max(error, shift_lax, shift_lw) < 1e-13


def draw(path: Path) -> None:
    """|G| and relative phase −arg G/(c θ) of both schemes on three particles."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    theta = np.linspace(1e-3, np.pi, 400)
    s, d, _ = symbols(spike_responses(CubicSpline(), 1.0, 1), theta)
    figure, axes = pyplot.subplots(2, 2, figsize=(9.0, 6.5), sharex=True, constrained_layout=True)
    courant = ((0.25, 0.5, 0.75, 1.0), (0.5, 1.0, 1.5, 2.0))
    for column, title in enumerate(("Lax-CSPH", "Lax-Wendroff-CSPH")):
        for c in courant[column]:
            G = factors(s, d, c)[column]
            visible = np.abs(G) > 1e-6  # a wave that dies in one step has no phase
            phase = -np.unwrap(np.angle(G)) / (c * theta)
            axes[0, column].plot(theta / np.pi, np.abs(G), label=f"CFL {c:g}")
            axes[1, column].plot(theta[visible] / np.pi, phase[visible])
        axes[0, column].set(title=title, ylim=(0.0, 1.1))
        axes[1, column].set(xlabel="θ/π", ylim=(0.0, 2.0 if column == 0 else 1.2))
        axes[0, column].legend()
    axes[0, 0].set_ylabel("amplification |G|")
    axes[1, 0].set_ylabel("relative phase")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=Path("runs/amplification"), help="directory of the picture")
    output = parser.parse_args(arguments).output
    good = limits_hold()
    good &= phases_hold()
    draw(output / "amplification.png")
    print(f"picture: {output / 'amplification.png'}")
    print("all figures agree" if good else "figures differ")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
