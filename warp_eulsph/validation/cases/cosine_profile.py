"""Propagation of a cosine profile by the Lax-CSPH and Lax-Wendroff-CSPH schemes (paper §6.1, Fig. 2).

u_t + u_x = 0 on ]0, 1[ with u = ½ (1 + cos(π (x − 0.2)/0.12)) within 0.12 of 0.2 and zero elsewhere, to t = 0.6, on 50
particles at (i + ½)/50. The lattice continues beyond both ends, as a periodic box of length 3 whose far parts nothing
reaches; the figures are those of the particles in ]0, 1[. On a lattice Shepard and linear values are the same.
"""

from collections.abc import Sequence

import numpy as np

from ...scheme.scalar import ConservationLaw, LinearAdvection, OneStepLax, ScalarScheme, TwoStepLaxWendroff
from ..case import Case
from ..figures import order, rms
from ..report import Figure

LAX, LAX_WENDROFF = OneStepLax(), TwoStepLaxWendroff()
#: (scheme, h/dx, CFL) -> largest value, place, least value, L2 error, as text so that every printed digit counts: the
#: two schemes written as finite differences. On three particles (h = dx) Lax at CFL 1 and Lax-Wendroff at CFL 2 are
#: exact shifts.
EXPECTED = {
    (LAX, 1.0, 0.5): ("0.33843", "0.8088", "0.0000", "0.20153"),
    (LAX, 1.0, 1.0): ("0.98296", "0.8000", "0.0000", "0.00000"),
    (LAX_WENDROFF, 1.0, 0.5): ("0.70083", "0.7418", "-0.2778", "0.19629"),
    (LAX_WENDROFF, 1.0, 1.0): ("0.71695", "0.7544", "-0.2025", "0.16321"),
    (LAX_WENDROFF, 1.0, 1.5): ("0.77236", "0.7724", "-0.1234", "0.11623"),
    (LAX_WENDROFF, 1.0, 2.0): ("0.98296", "0.8000", "0.0000", "0.00000"),
    (LAX_WENDROFF, 1.2, 1.0): ("0.69243", "0.7475", "-0.2219", "0.17935"),
    (LAX_WENDROFF, 1.2, 2.0): ("0.89140", "0.7830", "-0.1062", "0.07041"),
}
QUANTITIES = ("largest", "place", "least", "error")
PARTICLES, BOX, END = 50, 3.0, 0.6


def profile(x: np.ndarray, centre: float) -> np.ndarray:
    """The cosine hat of half width 0.12."""
    away = np.abs(x - centre)
    return np.where(away <= 0.12, 0.5 * (1.0 + np.cos(np.pi * away / 0.12)), 0.0)


def solve(scheme: ScalarScheme, dilation: float, cfl: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions in ]0, 1[ and the solution there at t = 0.6."""
    dx = 1.0 / PARTICLES
    x = (np.arange(round(BOX / dx)) + 0.5) * dx
    law = ConservationLaw(
        x[:, None],
        dx,
        profile(x, 0.2),
        flux=LinearAdvection((1.0,)),
        scheme=scheme,
        dilation=dilation,
        periodic=(BOX,),
    )
    law.run(END, cfl * dx)
    return x[:PARTICLES], law.values[:PARTICLES]


def measure(x: np.ndarray, u: np.ndarray) -> tuple[float, float, float, float]:
    """Largest value, its place (vertex of the parabola through the highest particle and its neighbours), least value,
    and L2 error √(Σ (u − exact)² dx)."""
    top = int(np.argmax(u))
    left, middle, right = u[top - 1 : top + 2]
    dx = x[1] - x[0]
    place = x[top] + 0.5 * dx * (left - right) / (left - 2.0 * middle + right)
    error = np.sqrt(((u - profile(x, 0.2 + END)) ** 2).sum() * dx)
    return u.max(), place, u.min(), error


def observed_order(scheme: ScalarScheme, cfl: float, levels: Sequence[int]) -> float:
    """Order on a smooth profile, a Gaussian of width 0.07 that runs a quarter round the unit circle."""
    errors = []
    for n in levels:
        x = (np.arange(n) + 0.5) / n
        start, end = (np.exp(-((x - centre) ** 2) / (2.0 * 0.07**2)) for centre in (0.375, 0.625))
        flux = LinearAdvection((1.0,))
        law = ConservationLaw(x[:, None], 1.0 / n, start, flux=flux, scheme=scheme, dilation=1.0, periodic=(1.0,))
        law.run(0.25, cfl / n)
        errors.append(rms(law.values - end))
    return order(levels, errors)


def run(quick: bool) -> Sequence[Figure]:
    """Every printed digit; the same when quick. Orders: Lax approaches 1 from below, Lax-Wendroff 2."""
    figures = []
    for (scheme, dilation, cfl), printed in EXPECTED.items():
        who = "lax" if scheme == LAX else "lax_wendroff"
        found = measure(*solve(scheme, dilation, cfl))
        for quantity, value, digits in zip(QUANTITIES, found, printed, strict=True):
            exact, half_digit = float(digits), 0.5 * 10.0 ** -len(digits.split(".")[1])
            name = f"{who}_{dilation:g}_cfl_{cfl:g}_{quantity}".replace(".", "_")
            figures.append(Figure(name, value, exact - half_digit, exact + half_digit, exact))
    levels = (160, 320, 640)
    lax, lax_wendroff = observed_order(LAX, 0.8, levels), observed_order(LAX_WENDROFF, 0.5, levels)
    return [
        *figures,
        Figure("order_lax", lax, 0.9, 1.1, 1.0),
        Figure("order_lax_wendroff", lax_wendroff, 1.95, 2.05, 2.0),
    ]


CASE = Case(
    name="cosine_profile",
    title="A cosine profile carried by Lax and Lax-Wendroff, 50 particles",
    source="the same schemes as finite differences on a lattice (paper, §6.1 and Fig. 2); exact shifts",
    run=run,
)
