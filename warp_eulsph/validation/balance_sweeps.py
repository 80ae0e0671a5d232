"""Sweeps of the balance (M13) on lattices: what one corrects of each wave, and what five leave.

    python -m warp_eulsph.validation.balance_sweeps

Damped Jacobi multiplies a wave of the error of ψ by 1 − ρλ: ρ, the share ``RELAXATION`` of the residual that is
corrected, and λ, an eigenvalue of Σ_b ω_ab (ψ_a − ψ_b) over its diagonal: 1 − ŵ(k)/ŵ(0). ρ = 1/λ of the largest takes
the wave that answers most to zero in one sweep and corrects no wave too far. λ comes from a simulation's own weights.
"""

from dataclasses import dataclass

import numpy as np

from ..body import Body
from ..geometry import box
from ..materials import NeoHookean
from ..scheme.arrangement import Current
from ..scheme.balance import Balance
from ..scheme.potentials import RELAXATION
from ..simulation import Simulation

#: Particles along each axis: even, so that waves of two spacings fit in.
ACROSS = {1: 32, 2: 16, 3: 12}


@dataclass(frozen=True)
class Spectrum:
    """Eigenvalues λ on a lattice: the largest, and that of the wave of two spacings along one axis."""

    largest: float
    saw_tooth: float


def spectrum(dim: int, dilation: float = 1.3) -> Spectrum:
    """Of the lattice of ``dim`` dimensions with the default weight."""
    n = ACROSS[dim]
    x, volume = box((0.0,) * dim, (1.0,) * dim, 1.0 / n)
    body = Body(x=x, volume=volume, material=NeoHookean(density=1.0, young=1.0, poisson=0.3), surface=0.0)
    simulation = Simulation(body, periodic=(1.0,) * dim, dilation=dilation, arrangement=Current(), sort=False)
    configuration = simulation.configuration
    near = configuration.near
    row = slice(int(near.start.numpy()[0]), int(near.stop.numpy()[0]), near.stride)
    places = np.rint(n * (x[near.index.numpy()[row]] - x[0])).astype(int) % n
    weights = np.zeros((n,) * dim)
    np.add.at(weights, tuple(places.T), near.w.numpy()[row])
    eigenvalues = 1.0 - np.fft.fftn(weights).real / configuration.fields.diagonal.numpy()[0]
    return Spectrum(float(eigenvalues.max()), float(eigenvalues[(n // 2,) + (0,) * (dim - 1)]))


def left_over(eigenvalue: float, share: float, sweeps: int = Balance().sweeps) -> float:
    """Part of a wave that is left after that many sweeps."""
    return abs(1.0 - share * eigenvalue) ** sweeps


def main() -> None:
    """Print the table."""
    print("| dim | dilation | largest λ | 1/λ | share ρ | saw-tooth λ | left after five sweeps |")
    print("|---|---|---|---|---|---|---|")
    for dim, share in RELAXATION.items():
        for dilation in (1.2, 1.3, 1.5):
            found = spectrum(dim, dilation)
            left = left_over(found.saw_tooth, share)
            numbers = f"{found.largest:.3f} | {1.0 / found.largest:.3f} | {share} | {found.saw_tooth:.3f} | {left:.0e}"
            print(f"| {dim} | {dilation} | {numbers} |")


if __name__ == "__main__":
    main()
