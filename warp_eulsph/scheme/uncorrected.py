"""Sums without corrections, by which the pressure of a liquid is one with where its particles are (M27)."""

import functools
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..fields import clock_structure, structure
from ..linalg import inverse
from ..space import Space
from ..structs import ClockArrays, ParticleArrays, StateArrays
from ..weights import Weight
from .dissipation import UpwindForces
from .flux import Flux
from .potentials import Potentials
from .reference import Configuration
from .stabiliser import Correction, Sums

# Spacings from which a weight is summed over a lattice.
FAR = 8
# Sweeps for the potentials that shifting follows.
SWEEPS = 5


@dataclass(frozen=True)
class Uncorrected(Correction):
    """Gradients and forces of liquids without L: M4 and M5 with κ 1 in its place, κ that of a lattice (M27).

    Then J follows the arrangement: particles that crowd anywhere are compressed, and pressure drives them apart. By M4
    with L, and more so by balanced pair vectors (M13), what is not seen is not resisted: a liquid under its weight
    crowds, sinks and stirs itself up. Rigid walls are felt by what their matter would be in the sums. Dissipation (M9)
    and the flow of volume (M24) reconstruct by exact gradients all the same.

    Raises:
        ValueError: when the simulation is built: a body that flows and carries more than J.
    """

    has_potentials = True

    def build(self, space: Space, particles: ParticleArrays, flux: Flux, device: wp.DeviceLike) -> "UncorrectedForces":
        """Allocate for the bodies of ``flux``."""
        if not flux.forgets:
            raise ValueError(
                "correction=Uncorrected() is for liquids and gases, whose F is J^(1/d) I, got a solid whose "
                "arrangement is read anew; take Balance() or PlainVolume() there, or arrangement=Convected()"
            )
        return UncorrectedForces(space, len(particles.mass), device)


@functools.cache
def lattice_sum(weight: Weight, dim: int, h: float) -> float:
    """Σ_b V_b g_ab ξ_x² on a lattice of spacing 1, for smoothing length ``h``: M3, about 1."""
    axis = np.arange(-FAR, FAR + 1.0)
    xi = np.stack(np.meshgrid(*[axis] * dim, indexing="ij"), -1).reshape(-1, dim)
    q = np.linalg.norm(xi, axis=1) / h
    slope = weight.profile(wp.float64)[1]
    g = np.array([float(slope(wp.float64(each))) if 0.0 < each < weight.support else 0.0 for each in q])
    return float((g * xi[:, 0] ** 2).sum() * weight.sigma[dim - 1] / h ** (dim + 2))


def lattice_kappa(configuration: Configuration) -> np.ndarray:
    """κ of each particle, (n,): the reciprocal of that sum; reads the device."""
    particles = configuration.particles
    ratio = particles.h.numpy().astype(float) / particles.spacing.numpy()
    known, which = np.unique(ratio.round(6), return_inverse=True)
    dim = configuration.space.dim
    return np.array([1.0 / lattice_sum(configuration.weight, dim, float(each)) for each in known])[which]


@functools.cache
def _make_replace(space: Space) -> wp.Kernel:
    """Kernel: L ← κ 1, keeping what it was."""
    mat, real, dim = space.mat, space.real, space.dim

    @wp.kernel(module="unique", enable_backward=False)
    def replace(first: int, kappa: wp.array(dtype=real), L: wp.array(dtype=mat), of_pairs: wp.array(dtype=mat)):
        a = first + wp.tid()
        of_pairs[a] = L[a]
        L[a] = wp.identity(n=wp.static(dim), dtype=real) * kappa[a]

    return replace


@functools.cache
def _make_mend(space: Space, components: int) -> wp.Kernel:
    """Kernel: exact gradients of rows of ``components`` reals: by the L of M3 instead of what is in its place."""
    mat, gradient, invert = space.mat, space.row_gradient(components), inverse(space)

    @wp.kernel(module="unique", enable_backward=False)
    def mend(
        first: int,
        found: wp.array(dtype=gradient),
        L: wp.array(dtype=mat),
        of_pairs: wp.array(dtype=mat),
        out: wp.array(dtype=gradient),
    ):
        a = first + wp.tid()
        out[a] = found[a] @ (invert(L[a]) @ of_pairs[a])

    return mend


@functools.cache
def _make_turn(space: Space) -> wp.Kernel:
    """Kernel: the spin by which Q has turned in the time that it is ahead becomes that of the exact gradient."""
    mat, real, dim = space.mat, space.real, space.dim
    Flux, Reference, Clock = structure(space, "Flux"), structure(space, "Reference"), clock_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def turn(
        first: int,
        exact: wp.array(dtype=mat),
        clock: Clock,
        fraction: wp.float64,
        reference: Reference,
        dual: bool,
        flux: Flux,
    ):
        a = first + wp.tid()
        Q = flux.Q[a]
        spin = (exact[a] - wp.transpose(exact[a])) * real(wp.float64(0.5) * fraction * clock.dt[clock.run[a]])
        Q = (Q + wp.transpose(Q)) * real(0.5) + spin * (wp.trace(Q) / real(dim))
        flux.Q[a] = Q
        if dual:
            flux.Pi[a] = Q @ wp.transpose(reference.L[a])

    return turn


class UncorrectedForces(UpwindForces):
    """M9 and M27 at work: it takes L out of the reference.

    Attributes:
        kappa: κ of each particle, (n,); from the first refresh on.
    """

    takes_walls = True

    def __init__(self, space: Space, n: int, device: wp.DeviceLike):
        super().__init__(space, device)
        self._of_pairs, self._exact = (wp.zeros(n, dtype=space.mat, device=device) for _ in range(2))
        self.kappa = wp.zeros(n, dtype=space.real, device=device)
        self._L: wp.array | None = None
        self.potentials = Potentials(space, SWEEPS, n, device)

    def refresh(self, configuration: Configuration, state: StateArrays) -> None:
        """Take L out of the new reference."""
        if self._L is None:
            self.kappa.assign(lattice_kappa(configuration))
            self._L = configuration.fields.L
        self.potentials.find(configuration, state)
        self._launch(_make_replace(self.space), len(self.kappa), [self.kappa, self._L, self._of_pairs])

    def evolving(self) -> dict[str, wp.array]:
        """What L was, and κ, which goes with the particles."""
        return {
            "Uncorrected.psi": self.potentials.psi,
            "Uncorrected.of_pairs": self._of_pairs,
            "Uncorrected.kappa": self.kappa,
        }

    def turn(self, sums: Sums, clock: ClockArrays, fraction: float) -> None:
        """Pairs turn by the exact gradient, and pressure on them with them: else it has a moment."""
        dual = len(sums.flux.Pi) > 0
        arguments = [sums.grad_v, clock, fraction, sums.configuration.fields, dual, sums.flux]
        self._launch(_make_turn(self.space), len(self.kappa), arguments)

    def exact(self, gradient: wp.array) -> wp.array:
        """Exact gradients from those of the reference; of velocities in an array of its own, of others in place."""
        out = self._exact if gradient.dtype is self.space.mat else gradient
        if self._L is not None:
            kernel = _make_mend(self.space, wp.types.type_size(gradient.dtype) // self.space.dim)
            self._launch(kernel, len(out), [gradient, self._L, self._of_pairs, out])
        return out
