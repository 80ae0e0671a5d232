"""Nonlinear piston: a confined neo-Hookean bar at rest, one end set off at a constant speed.

Uniaxial strain: P(λ) = ⅔ μ (λ^{1/3} − λ^{−5/3}) + κ (λ − 1), which stiffens in compression and softens in tension. In
compression a shock runs into the bar: U (1 − λ) = v_p and ρ₀ U v_p = −P(λ). In tension a fan does: v_p = ∫ c dλ with
ρ₀ c² = dP/dλ, the stretch λ being at X = c(λ) t. Behind either the state is uniform.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...boundaries import Velocity
from ...geometry import box
from ...materials import NeoHookean
from ...scheme.arrangement import Current
from ...scheme.policy import Always, ReferencePolicy
from ...simulation import Body, Simulation
from ..case import Case
from ..figures import difference
from ..history import History, record
from ..report import Figure

DENSITY, YOUNG, POISSON = 1100.0, 17e6, 0.3
MU, KAPPA = YOUNG / 2 / (1 + POISSON), YOUNG / 3 / (1 - 2 * POISSON)
RUN, FRAMES = 0.7, 100  # the wave's way [m]


@dataclass(frozen=True)
class Piston:
    """An exact state behind the wave.

    Args:
        speed: of the piston into the bar [m/s]; negative pulls.
        stretch: λ behind the wave.
        wave_speed: in the initial configuration [m/s]: of the shock, or of the stretch halfway up the fan.
        stress: P behind the wave [Pa].
    """

    speed: float
    stretch: float
    wave_speed: float
    stress: float


def stress(stretch: np.ndarray) -> np.ndarray:
    """P [Pa] in uniaxial strain."""
    return 2.0 / 3.0 * MU * (stretch ** (1.0 / 3.0) - stretch ** (-5.0 / 3.0)) + KAPPA * (stretch - 1.0)


def stored_energy(stretch: float) -> float:
    """Ψ [J/m³] in uniaxial strain."""
    shape = stretch ** (-2.0 / 3.0) * (stretch**2 + 2.0) - 3.0
    return 0.5 * MU * shape + 0.5 * KAPPA * (stretch - 1.0) ** 2


def wave_speed(stretch: float) -> float:
    """c = √(P'/ρ₀) [m/s] in the initial configuration."""
    slope = 2.0 / 9.0 * MU * (stretch ** (-2.0 / 3.0) + 5.0 * stretch ** (-8.0 / 3.0)) + KAPPA
    return float(np.sqrt(slope / DENSITY))


#: Solutions of the jump conditions, and of the fan's integral, to six digits.
PISTONS = {
    "compression_50": Piston(50.0, 0.686238, 159.356, -8.7646e6),
    "compression_100": Piston(100.0, 0.458366, 184.627, -2.03089e7),
    "tension_50": Piston(-50.0, 1.368342, wave_speed(0.5 * (1.0 + 1.368342)), 7.47288e6),
}


def build(n: int, piston: Piston, reference: ReferencePolicy, **options: Any) -> Simulation:
    """A bar 1 m long as n particles, of which the first is the piston."""
    x, volume = box([0.0], [1.0], 1.0 / n)
    material = NeoHookean(density=DENSITY, young=YOUNG, poisson=POISSON)
    velocity = np.zeros_like(x)
    velocity[0] = piston.speed
    body = Body(x=x, volume=volume, material=material, velocity=velocity)
    return Simulation(body, boundaries=[Velocity([0], [piston.speed])], reference=reference, **options)


def front(X: np.ndarray, F: np.ndarray, piston: Piston) -> float:
    """Initial position [m] of the outermost crossing of the stretch halfway between 1 and that behind the wave."""
    passed = (F - 0.5 * (1.0 + piston.stretch)) * (piston.stretch - 1.0) > 0.0
    if not passed[:-1].any():
        return float(X[0])
    a = int(np.flatnonzero(passed[:-1])[-1])
    share = (0.5 * (1.0 + piston.stretch) - F[a]) / (F[a + 1] - F[a])
    return float(X[a] + share * (X[a + 1] - X[a]))


def measure(simulation: Simulation, piston: Piston) -> History:
    """Until the wave has run 0.7 m: where it is [m], the energy and the piston's work per unit area [J/m²]."""
    X = simulation.bodies[0].x[:, 0]

    def observe() -> dict[str, float]:
        energy = simulation.energy()
        crossing = front(X, simulation.F[:, 0, 0], piston)
        return {"front": crossing, "energy": energy["total"], "work": energy["constraint"]}

    return record(simulation, np.linspace(0.0, RUN / piston.wave_speed, FRAMES + 1), observe)


def energy_over_work(piston: Piston) -> float:
    """Stored and kinetic energy behind the wave over the piston's work: a shock turns the rest to heat, a fan none."""
    if piston.speed < 0.0:
        return 1.0
    gained = stored_energy(piston.stretch) + 0.5 * DENSITY * piston.speed**2  # J/m³
    return gained * piston.wave_speed / (-piston.stress * piston.speed)


def errors(simulation: Simulation, history: History, piston: Piston) -> dict[str, float]:
    """Relative errors of the state behind the wave, from a tenth to a half of its way, of its speed and of the energy.

    ``stretch`` is that of F, ``spacing`` that of the positions.
    """
    X, x, F = simulation.bodies[0].x[:, 0], simulation.x[:, 0], simulation.F[:, 0, 0]
    behind = (X > 0.1 * RUN) & (X < 0.5 * RUN)
    late = history["t"] > 0.3 * history["t"][-1]
    speed = np.polyfit(history["t"][late], history["front"][late], 1)[0]
    kept = history["energy"][-1] / (history["energy"][0] + history["work"][-1])
    return {
        "stretch": F[behind].mean() / piston.stretch - 1.0,
        "spacing": np.polyfit(X[behind], x[behind], 1)[0] / piston.stretch - 1.0,
        "stress": stress(F[behind]).mean() / piston.stress - 1.0,
        "wave_speed": speed / piston.wave_speed - 1.0,
        "energy": kept / energy_over_work(piston) - 1.0,
    }


def run(quick: bool) -> Sequence[Figure]:
    """Plateaus and speeds within 1 % at 400 particles; errors at a jump fall at first order, hence 4 % at 100."""
    n, band = (100, 0.04) if quick else (400, 0.01)
    figures = []
    for name, piston in PISTONS.items():
        simulation, current = build(n, piston, Always()), build(n, piston, Always(), arrangement=Current())
        history = measure(simulation, piston)
        measure(current, piston)
        for quantity, error in errors(simulation, history, piston).items():
            figures.append(Figure(f"{name}_{quantity}_error", error, -band, band, 0.0))
        apart = difference(current.x - simulation.bodies[0].x, simulation.x - simulation.bodies[0].x)
        residual = abs(simulation.energy()["residual"]) / history["work"][-1]
        figures.append(Figure(f"{name}_current_arrangement_difference", apart, 0.0, band, 0.0))
        figures.append(Figure(f"{name}_ledger_residual", residual, 0.0, 1e-10, 0.0))
    return figures


CASE = Case(
    name="piston",
    title="Shocks and a fan in a confined neo-Hookean bar: plateaus and wave speeds",
    source="exact: jump conditions and simple wave of uniaxial strain",
    run=run,
)
