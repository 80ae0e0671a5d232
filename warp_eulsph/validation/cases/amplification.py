"""Amplification and phase of the Lax-CSPH and Lax-Wendroff-CSPH schemes, read from the operators (paper, Fig. 1).

The weights of S and of the gradient come from the library: it smooths and differentiates one spike on a periodic
lattice, and the Fourier transform of the answers gives the symbols s(θ) of S and i d(θ)/dx of ∂/∂x. With the Courant
number c the amplification factors per step are

    Lax: G = s − i c d,        Lax-Wendroff: G = 1 − i c d s − ½ c² d².

The stability limit of Lax-Wendroff is CFL_LW = 2 √m₂ = 2 min √(1 − s²)/|d|, m₂ the second moment of S along an axis.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...scheme.scalar import ConservationLaw, LinearAdvection
from ...scheme.smoothing import NeighbourAverage
from ...weights import CubicSpline, Weight, WendlandC2
from ..case import Case
from ..report import Figure

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


def factors(s: np.ndarray, d: np.ndarray, c: float) -> tuple[np.ndarray, np.ndarray]:
    """G of Lax and of Lax-Wendroff at the Courant number c."""
    return s - 1j * c * d, 1.0 - 1j * c * d * s - 0.5 * (c * d) ** 2


@dataclass(frozen=True)
class Limit:
    """A stability limit of Lax-Wendroff as measured.

    Args:
        cfl: 2 √m₂.
        least: 2 min √(1 − s²)/|d| over waves along an axis; the same.
        growth_at: largest |G| − 1 of all waves of the lattice at the limit, oblique ones too; round-off.
        growth_beyond: largest |G| − 1 of waves along an axis 1 % above it; positive.
    """

    cfl: float
    least: float
    growth_at: float
    growth_beyond: float


def limit(weight: Weight, dilation: float, dim: int) -> Limit:
    """The stability limit on a line, square or cubic lattice."""
    responses = spike_responses(weight, dilation, dim)
    s, d, m_2 = symbols(responses, np.linspace(0.0, np.pi, 4001)[1:-1])
    cfl = 2.0 * np.sqrt(m_2)
    s_all, d_all = np.fft.fftn(responses[0]).real, np.fft.fftn(responses[1]).imag
    return Limit(
        cfl=cfl,
        least=float((2.0 * np.sqrt(np.maximum(1.0 - s**2, 0.0)) / np.abs(d)).min()),
        growth_at=float(np.abs(factors(s_all, d_all, cfl)[1]).max() - 1.0),
        growth_beyond=float(np.abs(factors(s, d, 1.01 * cfl)[1]).max() - 1.0),
    )


def three_particles() -> dict[str, float]:
    """Errors on three particles: of s = cos θ and d = sin θ, and of the steps that are exact shifts."""
    theta = np.linspace(0.0, np.pi, 721)
    s, d, _ = symbols(spike_responses(CubicSpline(), 1.0, 1), theta)
    return {
        "symbol_error": float(max(np.abs(s - np.cos(theta)).max(), np.abs(d - np.sin(theta)).max())),
        "lax_shift_error": float(np.abs(factors(s, d, 1.0)[0] - np.exp(-1j * theta)).max()),
        "lax_wendroff_shift_error": float(np.abs(factors(s, d, 2.0)[1] - np.exp(-2j * theta)).max()),
    }


def run(quick: bool) -> Sequence[Figure]:
    """Limits to every printed digit, identities to round-off; the same when quick."""
    figures, measured = [], []
    for (weight, dilation), printed in LIMITS.items():
        for dim, digits in enumerate(printed, start=1):
            found = limit(weight, dilation, dim)
            measured.append(found)
            exact, half_digit = float(digits), 0.5 * 10.0 ** -len(digits.split(".")[1])
            name = f"cfl_{type(weight).__name__}_{dilation:g}_{dim}d".lower().replace(".", "_")
            figures.append(Figure(name, found.cfl, exact - half_digit, exact + half_digit, exact))
    spread = max(abs(found.least - found.cfl) for found in measured)
    return [
        *figures,
        Figure("cfl_by_symbols_error", spread, 0.0, 1e-5, 0.0),
        Figure("growth_at_limit", max(found.growth_at for found in measured), high=1e-12, reference=0.0),
        Figure("growth_beyond_limit", min(found.growth_beyond for found in measured), low=1e-8),
        *[Figure(name, error, 0.0, 1e-13, 0.0) for name, error in three_particles().items()],
    ]


CASE = Case(
    name="amplification",
    title="Amplification, phase and stability limits of Lax and Lax-Wendroff on lattices",
    source="exact symbols of the two schemes (paper, §4.1 and Fig. 1)",
    run=run,
)
