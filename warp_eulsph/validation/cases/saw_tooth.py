"""Pre-stressed saw-tooth: what a uniform stress does to a lattice whose neighbours move apart and together in turn.

A particle of a lattice in a uniform stress σ feels no force. Displaced by δ (−1)^a, with the neighbours found anew and
nothing but the dual divergence (M5), a line of them feels (σ/ρ)(α/dx)² δ with

    α² = 4 dx Σ_{j odd} W''(j dx) / Σ_j j |W'(j dx)| ,   j = 1, 2, …,

because K_a stays as it is and only the odd neighbours come nearer or go away. In tension, where α² σ > 0, that grows
at the rate λ dx/c = α √(σ/E), E = ρc² the modulus of the waves: α² = 8, 2.264 and 0 for the cubic spline at h = dx,
1.2 dx and 1.5 dx. An earlier measurement, whose settings are not known, gave α = 2.3, 1.1 and 0.1 for these; the closed
form and the step of this package agree on 2.83, 1.50 and 0. Total Lagrangian, displacements feed back on nothing: the
rate is zero.

The default scheme must show no growth, in tension and compression, in 1-D, 2-D and 3-D: neither of the saw-tooth nor of
anything else that a deviation contains. Beside it stands M11 without its bound on energy, solved to round-off.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...scheme.policy import Always, Never
from ...scheme.verlet import Verlet
from ..case import Case
from ..report import Figure
from ..stability import CLOSED
from ..stability_step import RESOLVED, Point, Step, spectral_radius, symbols

# Verlet takes the force of a moved neighbourhood at the start of the step, which slows growth by λΔt/4 of itself: 0.3 %
# at the largest.
SMALL_STEP = 0.02
PLAIN = Verlet(dissipation=None, correction=None)
STRAINS = (-0.1, -0.03, 0.03, 0.1)
SCHEMES = {
    "total Lagrangian": (Never(), Verlet()),
    "current, M13": (Always(), Verlet()),
    "current, M11": (Always(), Verlet(correction=CLOSED)),
}


def slope(q: float) -> tuple[float, float]:
    """W' and W'' of the cubic spline over q = r/h, but for one factor."""
    if q < 1.0:
        return -3.0 * q + 2.25 * q * q, -3.0 + 4.5 * q
    return -0.75 * (2.0 - q) ** 2, 1.5 * (2.0 - q)


def closed_form(dilation: float) -> float:
    """α of the docstring's formula; the cubic spline reaches 2 h."""
    near = [(j, slope(j / dilation)) for j in range(1, math.ceil(2.0 * dilation))]
    odd = sum(second for j, (_, second) in near if j % 2)
    return math.sqrt(max(4.0 / dilation * odd / sum(j * abs(first) for j, (first, _) in near), 0.0))


def measured(dilation: float, strain: float) -> float:
    """The same α from the step of the library: growth of the wave of two spacings over √(σ/E)."""
    point = Point(dim=1, across=16, dilation=dilation, strain=strain, reference=Always(), scheme=PLAIN, cfl=SMALL_STEP)
    step = Step(point)
    saw_tooth = np.abs(np.linalg.eigvals(symbols(step)[point.across // 2])).max()
    return math.log(saw_tooth) / SMALL_STEP / math.sqrt(step.stress[0, 0] / step.modulus)


def run(quick: bool) -> Sequence[Figure]:
    """Bands: 1 % of the closed form; no growth beyond what round-off leaves open. Quick runs take 3 % strain only."""
    figures = []
    for dilation in (1.0, 1.2, 1.5):
        alpha, exact = measured(dilation, 0.03), closed_form(dilation)
        # At h = dx and 1.5 dx neighbours lie on knots of the spline, where W'' has a kink: the difference quotient that
        # makes the Jacobian is then of first order in its step, 1e-3, and the root of it is seen where α = 0.
        figures.append(Figure(f"1d_m5_alone_alpha_h_{dilation:g}", alpha, exact - 0.03, exact + 0.03, exact))
    for dim, across in ((1, 16), (2, 8), (3, 6)):
        for strain in (-0.03, 0.03) if quick else STRAINS:
            body = Point(dim=dim, across=across, strain=strain)
            for name, (reference, scheme) in SCHEMES.items():
                found = spectral_radius(replace(body, reference=reference, scheme=scheme)) - 1.0
                label = f"{dim}d_strain_{strain:+g}: {name}, growth per step"
                figures.append(Figure(label, found, high=RESOLVED, reference=0.0))
    return figures


CASE = Case(
    name="saw_tooth",
    title="Uniformly strained lattices: growth of the saw-tooth and of everything else",
    source="closed form of the dual divergence's response; no growth",
    run=run,
)
