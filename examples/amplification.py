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

from warp_eulsph import CubicSpline, Weight
from warp_eulsph.scheme.scalar import ConservationLaw, LinearAdvection
from warp_eulsph.scheme.smoothing import NeighbourAverage
from warp_eulsph.weights import WendlandC2

#: Exact stability limits of Lax-Wendroff-CSPH: (weight, h/dx) -> line, square, cubic lattice, as text so that every
#: printed digit counts. At h = 0.7 dx the nearest particles alone lie in the support of the cubic spline.
LIMITS = {
    (CubicSpline(), 0.7): ("2.0000", "1.414", "1.155"),
    (CubicSpline(), 1.2): ("2.0680", "1.623", "1.452"),
    (CubicSpline(), 1.3): ("2.1486", "1.704", "1.533"),
    (CubicSpline(), 1.5): ("2.3263", "1.893", "1.730"),
    (WendlandC2(), 2.0): ("2.700",),
}


def spike_responses(weight: Weight, dilation: float, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Answers of S and of dx ∂/∂x₀ to a unit spike at the origin of a periodic lattice, (side,) * dim each."""
    side = max(8, int(np.ceil(2.0 * weight.support * dilation)) + 1)
    x = np.stack(np.meshgrid(*[np.arange(side) + 0.5] * dim, indexing="ij"), -1).reshape(-1, dim)
    spike = np.zeros(len(x))
    spike[0] = 1.0
    along = LinearAdvection((1.0,) + (0.0,) * (dim - 1))
    law = ConservationLaw(x, 1.0, spike, flux=along, weight=weight, dilation=dilation, periodic=(float(side),) * dim)
    law.smooth(NeighbourAverage(), law.half)
    smoothed = law.half.numpy()[:, 0].copy()
    law.half.zero_()
    law.differentiate(law.U)
    law.advance(law.half, -1.0, law.half)
    return smoothed.reshape((side,) * dim), law.half.numpy()[:, 0].reshape((side,) * dim)


def symbols(responses: tuple[np.ndarray, np.ndarray], theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """s(θ) and d(θ) for waves along the first axis, θ = k dx, and the second moment m₂ of S along it."""
    across = tuple(range(1, responses[0].ndim))
    w, g = (response.sum(axis=across) for response in responses)
    j = (np.arange(len(w)) + len(w) // 2) % len(w) - len(w) // 2  # particle j answers with the weight of offset −j
    s = (w * np.cos(np.outer(theta, j))).sum(axis=1)
    d = -(g * np.sin(np.outer(theta, j))).sum(axis=1)
    return s, d, float((w * j**2).sum())


def amplification(s: np.ndarray, d: np.ndarray, c: float) -> tuple[np.ndarray, np.ndarray]:
    """G of Lax and of Lax-Wendroff at the Courant number c."""
    return s - 1j * c * d, 1.0 - 1j * c * d * s - 0.5 * (c * d) ** 2


def limits_hold() -> bool:
    """Print the table of stability limits and compare it with the exact one."""
    good = True
    theta = np.linspace(0.0, np.pi, 4001)[1:-1]
    print(f"{'weight':>12} h/dx  CFL of Lax-Wendroff on the line, the square, the cubic lattice")
    for (weight, dilation), printed in LIMITS.items():
        found = []
        for dim, digits in enumerate(printed, start=1):
            responses = spike_responses(weight, dilation, dim)
            s, d, m_2 = symbols(responses, theta)
            limit = 2.0 * np.sqrt(m_2)
            text = f"{limit:.{len(digits.split('.')[1])}f}"
            least = (2.0 * np.sqrt(np.maximum(1.0 - s**2, 0.0)) / np.abs(d)).min()
            # Every wave of the lattice, oblique ones too, is stable at the limit; long ones are not 1 % above it.
            s_all, d_all = np.fft.fftn(responses[0]).real, np.fft.fftn(responses[1]).imag
            largest = np.abs(amplification(s_all, d_all, limit)[1]).max()
            beyond = np.abs(amplification(s, d, 1.01 * limit)[1]).max()
            agrees = text == digits and abs(least - limit) < 1e-5 and largest < 1.0 + 1e-12 and beyond > 1.0 + 1e-8
            good &= agrees
            found.append(text if agrees else f"{text} (exact {digits}, least {least:.6f}, |G| {largest:.6f})")
        print(f"{weight!r:>12} {dilation:4.1f}  {'  '.join(found)}")
    return good


def phases_hold() -> bool:
    """Compare G on three particles with its closed form, and print where a step is an exact shift."""
    theta = np.linspace(0.0, np.pi, 721)
    s, d, _ = symbols(spike_responses(CubicSpline(), 1.0, 1), theta)
    error = max(np.abs(s - np.cos(theta)).max(), np.abs(d - np.sin(theta)).max())
    shift_lax = np.abs(amplification(s, d, 1.0)[0] - np.exp(-1j * theta)).max()
    shift_lw = np.abs(amplification(s, d, 2.0)[1] - np.exp(-2j * theta)).max()
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
            G = amplification(s, d, c)[column]
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
