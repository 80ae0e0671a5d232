"""Volume of what lies inside by plain sums, pressure by their adjoint: metal under pressure takes its room (M29)."""

import functools
from dataclasses import dataclass

import warp as wp

from ..fields import structure
from ..space import Space
from ..structs import ClockArrays, ParticleArrays, StateArrays
from .dissipation import UpwindForces
from .exposure import Exposure
from .flux import Flux
from .reference import Configuration
from .stabiliser import Correction, Sums
from .uncorrected import lattice_kappa


@dataclass(frozen=True)
class PlainVolume(Correction):
    """Particles inside take volume by plain sums, and have their pressure act by the adjoint of these (M29).

    For solids that are read anew and pressed: plain sums see particles that crowd, which gradients that are exact for
    linear fields do not, and pressure drives them apart. Shear goes by exact gradients, and so does volume beside free
    surfaces. Nothing is balanced (M13): what pressure does to an uneven arrangement evens it. In tension it does the
    opposite, and solids that are pulled part: keep their arrangement there. Take a weight by which particles do not
    pair, ``WendlandC2()`` at a dilation of 1.8, and planes of symmetry (``mirror``) for walls.

    Raises:
        ValueError: when the simulation is built: a liquid, whose pressure is all it has.
    """

    def build(self, space: Space, particles: ParticleArrays, flux: Flux, device: wp.DeviceLike) -> "PlainVolumeForces":
        """Allocate for the bodies of ``flux``."""
        if flux.forgets:
            raise ValueError("correction=PlainVolume() is for solids, got a liquid or gas; take Uncorrected() there")
        return PlainVolumeForces(space, particles, flux, device)


@functools.cache
def _make_choose(space: Space) -> wp.Kernel:
    """Kernel: κ of particles inside, 0 beside free surfaces and where gradients lack a direction."""
    real = space.real

    @wp.kernel(module="unique", enable_backward=False)
    def choose(
        first: int,
        kappa: wp.array(dtype=real),
        beside: wp.array(dtype=wp.int32),
        poor: wp.array(dtype=wp.int32),
        inside: wp.array(dtype=real),
    ):
        a = first + wp.tid()
        inside[a] = real(0.0)
        if beside[a] == 0 and poor[a] == 0:
            inside[a] = kappa[a]

    return choose


@functools.cache
def _make_swell(space: Space) -> wp.Kernel:
    """Kernel: the gradient that moves F, whose trace inside is that of plain sums, κ ∇v : K."""
    real, mat, dim = space.real, space.mat, space.dim

    @wp.kernel(module="unique", enable_backward=False)
    def swell(
        first: int,
        inside: wp.array(dtype=real),
        K: wp.array(dtype=mat),
        gradient: wp.array(dtype=mat),
        out: wp.array(dtype=mat),
    ):
        a = first + wp.tid()
        D = gradient[a]
        kappa = inside[a]
        if kappa > real(0.0):
            more = (kappa * wp.ddot(D, K[a]) - wp.trace(D)) / real(dim)
            D += wp.identity(n=wp.static(dim), dtype=real) * more
        out[a] = D

    return swell


@functools.cache
def _make_press(space: Space) -> wp.Kernel:
    """Kernel: Q whose dual divergence has the pressure of what is inside by plain sums: Q + ⅟d tr Q (κ K − 1)."""
    real, mat, dim = space.real, space.mat, space.dim
    Flux, Reference = structure(space, "Flux"), structure(space, "Reference")

    @wp.kernel(module="unique", enable_backward=False)
    def press(
        first: int, inside: wp.array(dtype=real), K: wp.array(dtype=mat), reference: Reference, dual: bool, flux: Flux
    ):
        a = first + wp.tid()
        kappa = inside[a]
        if kappa > real(0.0):
            Q = flux.Q[a]
            Q += (K[a] * kappa - wp.identity(n=wp.static(dim), dtype=real)) * (wp.trace(Q) / real(dim))
            flux.Q[a] = Q
            if dual:
                flux.Pi[a] = Q @ wp.transpose(reference.L[a])

    return press


class PlainVolumeForces(UpwindForces):
    """M9 and M29 at work.

    Attributes:
        inside: κ of particles inside, 0 of others, (n,).
    """

    def __init__(self, space: Space, particles: ParticleArrays, flux: Flux, device: wp.DeviceLike):
        super().__init__(space, device)
        n = len(particles.mass)
        self.inside, self._kappa = (wp.zeros(n, dtype=space.real, device=device) for _ in range(2))
        self._defect = wp.zeros(n, dtype=space.vec, device=device)
        self._moving = wp.zeros(n, dtype=space.mat, device=device)
        everyone = wp.full(n, 1, dtype=wp.int32, device=device)
        self._exposure = Exposure(space, particles, everyone, len(flux.bodies) > 1, device)
        self._configuration: Configuration | None = None

    def refresh(self, configuration: Configuration, state: StateArrays) -> None:
        """Look who is inside; where the arrangement does not move nobody crowds, and nothing is done."""
        if configuration.fixed:
            return
        if self._configuration is None:
            self._kappa.assign(lattice_kappa(configuration))
            self._configuration = configuration
        configuration.defect(state.surface, self._defect)
        self._exposure.find(configuration, state.surface, self._defect)
        arguments = [self._kappa, self._exposure.beside, configuration.poor, self.inside]
        self._launch(_make_choose(self.space), len(self.inside), arguments)

    def evolving(self) -> dict[str, wp.array]:
        """Who is inside until the next refresh, and κ, which goes with the particles."""
        return {"PlainVolume.inside": self.inside, "PlainVolume.kappa": self._kappa}

    def moving(self, gradient: wp.array) -> wp.array:
        """The gradient that moves F: inside with the trace of plain sums."""
        if self._configuration is None:
            return gradient
        arguments = [self.inside, self._configuration.K, gradient, self._moving]
        self._launch(_make_swell(self.space), len(self.inside), arguments)
        return self._moving

    def turn(self, sums: Sums, clock: ClockArrays, fraction: float) -> None:
        """Have pressure act by the adjoint of plain sums."""
        arguments = [self.inside, sums.configuration.K, sums.configuration.fields, len(sums.flux.Pi) > 0, sums.flux]
        self._launch(_make_press(self.space), len(self.inside), arguments)
