"""A rubber ring filled with water under pressure, thrown and spun: momenta, hoop stress, and the water stays inside."""

import math
from collections.abc import Sequence

import numpy as np

from ...interactions import Contact
from ...materials import NeoHookean, StiffenedGas
from ...scheme.dissipation import Upwind
from ...scheme.uncorrected import Uncorrected
from ...scheme.verlet import Verlet
from ...simulation import Body, Simulation
from ..case import Case
from ..report import Figure

INNER, THICK = 0.3, 0.06  # m
SPIN, THROWN = 10.0, (1.0, 2.0)  # rad/s, m/s
WATER, SOUND, PRESSURE, GAMMA = 1e3, 30.0, 2e4, 4.4
RUBBER, YOUNG, POISSON = 1100.0, 1e7, 0.3
END, SAMPLES = 0.25, 200


def hoop_stress() -> float:
    """Mean over the thickness of the ring: what its spin and the pressure of the water ask for (statics) [Pa].

    p(a) = p0 − 2K u/a + ¼ ρω²a², for the water spins as a solid and grows with the ring; u/a is Lamé's and that of a
    spinning ring, in plane strain.
    """
    outer, K = INNER + THICK, WATER * SOUND**2
    E, nu = YOUNG / (1.0 - POISSON**2), POISSON / (1.0 - POISSON)
    by_pressure = ((outer**2 + INNER**2) / (outer**2 - INNER**2) + nu) / E
    by_spin = RUBBER * SPIN**2 / (4.0 * E) * ((3.0 + nu) * outer**2 + (1.0 - nu) * INNER**2)
    p = (PRESSURE + 0.25 * WATER * (SPIN * INNER) ** 2 - 2.0 * K * by_spin) / (1.0 + 2.0 * K * by_pressure)
    return (p * INNER + RUBBER * SPIN**2 * (outer**3 - INNER**3) / 3.0) / THICK


def circles(inner: float, outer: float, dx: float) -> tuple[np.ndarray, np.ndarray]:
    """Particles on circles dx apart, and their areas: faces without the steps of a lattice."""
    x, areas = [], []
    for k in range(round(inner / dx), round(outer / dx)):
        r = (k + 0.5) * dx
        count = max(round(2.0 * math.pi * r / dx), 3)
        turn = 2.0 * math.pi * (np.arange(count) + 0.5 * (k % 2)) / count
        x.append(r * np.stack([np.cos(turn), np.sin(turn)], axis=1))
        areas.append(np.full(count, 2.0 * math.pi * r * dx / count))
    return np.concatenate(x), np.concatenate(areas)


def build(layers: int) -> Simulation:
    """The ring, ``layers`` particles thick, with the water at a pressure that it does not bear yet."""
    dx, K = THICK / layers, WATER * SOUND**2
    water = StiffenedGas(density=WATER, gamma=GAMMA, stiffness=K / GAMMA - PRESSURE, pressure=PRESSURE)
    rubber = NeoHookean(density=RUBBER, young=YOUNG, poisson=POISSON)
    bodies = []
    for name, material, edges in (("water", water, (0.0, INNER)), ("ring", rubber, (INNER, INNER + THICK))):
        x, volume = circles(*edges, dx)
        velocity = np.array(THROWN) + SPIN * np.stack([-x[:, 1], x[:, 0]], axis=1)
        bodies.append(Body(x=x, volume=volume, material=material, velocity=velocity, spacing=dx, name=name))
    scheme = Verlet(dissipation=Upwind(volume=True, stress=True), correction=Uncorrected())
    return Simulation(bodies, interactions=[Contact()], scheme=scheme)


def measure(layers: int) -> dict[str, float]:
    """Mean hoop stress over that of statics, and what momenta and energies changed by, over what they were."""
    simulation = build(layers)
    mass = simulation.order.by_number(simulation.stepper.particles.mass.numpy()).astype(float)
    n = int((simulation.order.by_number(simulation.stepper.particles.body.numpy()) == 0).sum())

    def momenta() -> np.ndarray:
        x, v = simulation.x, simulation.v
        return np.array([*(mass @ v), mass @ (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0])])

    start, rows, dx = momenta(), [], THICK / layers
    for _ in simulation.frames(np.linspace(0.0, END, SAMPLES + 1)[1:]):
        from_centre = simulation.x - mass @ simulation.x / mass.sum()
        r = np.linalg.norm(from_centre, axis=1)
        along = np.stack([-from_centre[n:, 1], from_centre[n:, 0]], axis=1) / r[n:, None]
        stress = np.einsum("ni,nij,nj->n", along, simulation.cauchy_stress[n:, :2, :2], along)
        rows.append((mass[n:] @ stress / mass[n:].sum(), (r[n:].min() - r[:n].max()) / dx))
    hoop, gap = np.array(rows).T
    change, energy = momenta() - start, simulation.energy()
    return {
        "hoop": float(hoop[SAMPLES // 2 :].mean()) / hoop_stress(),
        "momentum": float(np.abs(change[:2]).max() / np.abs(start[:2]).max()),
        "angular_momentum": float(abs(change[2] / start[2])),
        "gap": float(gap.min()),
        "account": energy["interaction"] / energy["total"],
        "residual": abs(energy["residual"]) / energy["total"],
    }


def run(quick: bool) -> Sequence[Figure]:
    """The pressure swings between 0 and twice its mean, for the ring is at rest first; its mean is that of statics."""
    found = measure(4 if quick else 6)
    return [
        Figure("mean_hoop_stress", found["hoop"], 0.97, 1.03, 1.0),
        Figure("momentum", found["momentum"], 0.0, 1e-12, 0.0),
        Figure("angular_momentum", found["angular_momentum"], 0.0, 3e-5, 0.0),
        Figure("gap_between_water_and_ring", found["gap"], 0.5, 1.5, 1.0),
        Figure("account_of_contact", found["account"], -1e-12, 1e-12, 0.0),
        Figure("ledger_residual", found["residual"], 0.0, 1e-10, 0.0),
    ]


CASE = Case(
    name="spun_ring",
    title="Rubber ring filled with water under pressure, thrown and spun: momenta, hoop stress, nothing through it",
    source="statics of a ring under pressure and spin (Lame), and of a liquid that spins as a solid",
    run=run,
)
